//! The layouts of texts that programs write: names of columns, lines before them, delimiters, colours.

use crs::Unit;
use points::{Point, TextOptions, open};
use sys::{ErrorKind, Result};

use crate::cloud::{Cloud, file, read_bytes};
use crate::first_warning;

pub(crate) fn text(content: &str) -> Result<Cloud> {
    read_bytes(".csv", content.as_bytes())
}

/// Asserts that the text holds (1.5, 2, 3.25) and (4, 5, 6).
#[track_caller]
pub(crate) fn assert_two_points(content: &str) -> Cloud {
    let cloud = text(content).unwrap_or_else(|error| panic!("{content:?}: {error}"));
    let world = |p: &Point| [0, 1, 2].map(|axis| cloud.lattice.world(axis, p.corner()[axis]));
    let found: Vec<[f64; 3]> = cloud.points.iter().map(world).collect();
    assert_eq!(found, [[1.5, 2.0, 3.25], [4.0, 5.0, 6.0]], "{content:?}: {:?}", cloud.counts.examples);
    assert_eq!(cloud.counts.malformed, 0, "{content:?}");
    cloud
}

#[test]
fn names_of_columns_that_programs_write_are_known() {
    for header in [
        "POINT_Z;POINT_Y;POINT_X",
        "Z [m];Y [m];X [m]",
        "z(m);y(m);x(m)",
        "Höhe;Hochwert;Rechtswert",
        "Elevation;North;East",
        "z;lat;x;y;lon",
    ] {
        let wide = header.starts_with("z;lat");
        let rows = if wide { "3.25;50;1.5;2;9\n6;50;4;5;9\n" } else { "3.25;2;1.5\n6;5;4\n" };
        assert_two_points(&format!("{header}\n{rows}"));
    }
}

#[test]
fn lines_before_the_rows_are_understood() {
    for content in [
        "Survey of a hill 2020\nz;y;x\n3.25;2;1.5\n6;5;4\n",
        "z;y;x\nm;m;m\n3.25;2;1.5\n6;5;4\n",
        "Survey\n\nz;y;x\n[m];[m];[m]\n\n3.25;2;1.5\n6;5;4\n",
        "sep=;\nz;y;x\n3.25;2;1.5\n6;5;4\n",
        "sep=;\r\n\"z\";\"y\";\"x\"\r\n\"3.25\";\"2\";\"1.5\"\r\n6;5;4\r\n",
        "# z y x\n3.25 2 1.5\n6 5 4\n",
        "# made today\n# z;y;x\n# and more\n3.25;2;1.5\n6;5;4\n",
        "//Z Y X\n2\n3.25 2 1.5\n6 5 4\n",
        "z|y|x\n3.25|2|1.5\n6|5|4\n",
        "1.5|2|3.25\n4|5|6\n",
        "name,z,y,x\n\"5\"\" pipe, old\",3.25,2,1.5\n\"a\",6,5,4\n",
        "z,y,x,\n3.25,2,1.5,\n6,5,4,\n",
        "z,y,x\n3.25,2,1.5,\n6,5,4\n",
    ] {
        assert_two_points(content);
    }
    // A comment that says what is so without it may have more words.
    assert_two_points("# x y z of the hill\n1.5 2 3.25\n4 5 6\n");
    let error = text("# z y x of the hill\n3.25 2 1.5\n6 5 4\n").err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("names x, y and z, but"), "{error}");
}

#[test]
fn a_commented_header_fits_as_a_plain_one_does() {
    for content in [
        "# z,y,x\n3.25,2,1.5,\n6,5,4,\n",
        "# z,y,x,\n3.25,2,1.5,\n6,5,4,\n",
        "# z;y;x\n3.25;2;1.5;\n6;5;4\n",
        "# Z Y X\n3.25 2 1.5 9\n6 5 4 9\n",
        "# Columns: Z Y X\n3.25 2 1.5\n6 5 4\n",
        "# Columns: Z Y X\n3.25 2 1.5 9\n6 5 4 9\n",
        "# z y x\n# made by me\n3.25 2 1.5\n6 5 4\n",
        "# z y x\n6 5 4\n3.25 2 1.5\n",
    ] {
        let cloud = text(content).unwrap_or_else(|error| panic!("{content:?}: {error}"));
        assert_eq!(cloud.counts.malformed, 0, "{content:?}");
        assert_eq!((cloud.source.min, cloud.source.max), ([1.5, 2.0, 3.25], [4.0, 5.0, 6.0]), "{content:?}");
    }
}

#[test]
fn names_after_a_title_of_numbers_are_not_lost() {
    for names in ["y x z", "y,x,z"] {
        let error = text(&format!("Scan 2023 05 12\n{names}\n2 1.5 3.25\n5 4 6\n")).err().expect("was read");
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("names the columns"), "{error}");
    }
    let path = file(".csv", b"Scan 2023 05 12\ny x z\n1.5 2 3.25\n4 5 6\n");
    let options = TextOptions { header: Some(false), ..TextOptions::default() };
    assert_eq!(open(&path, &options).unwrap().known_malformed(), 2);
}

#[test]
fn the_number_of_a_point_is_not_taken_for_x() {
    for row in [
        |i: usize| format!("{},{}.5,{}.25,{}.1\n", i + 1, 5_933_000 + i, 565_000 + i * i % 7, 12 + i % 5),
        |i| format!("{} {}.5 {}.25 {}.1 GND\n", 100 + 3 * i, 5_933_000 + i, 565_000 + i * i % 7, 12 + i % 5),
    ] {
        let rows: String = (0..20).map(row).collect();
        let error = text(&rows).err().expect("was read");
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("counts the rows"), "{error}");
        assert_eq!(text(&format!("id y x z code\n{}", rows.replace(',', " "))).unwrap().source.max[2], 16.1);
    }
}

#[test]
fn units_beside_and_below_the_names_are_used() {
    let crs = |text_of: &str| text(text_of).unwrap_or_else(|error| panic!("{text_of:?}: {error}")).source.crs;
    let rows = "1.5;2;3.25\n4;5;6\n";
    for (header, unit, vertical) in [
        ("x [m];y [m];z [m]", Unit::Metre, Some(1.0)),
        ("x [m];y [m];z", Unit::Metre, None),
        ("x [mm];y [mm];z [mm]", Unit::Other(0.001), Some(0.001)),
        ("x [km];y [km];z [m]", Unit::Other(1000.0), Some(1.0)),
        ("x;y;z\n[m];[m];[cm]", Unit::Metre, Some(0.01)),
        ("x;y;z\nft;ft;ft", Unit::Foot, Some(Unit::FOOT)),
        ("x [us-ft];y [us-ft];z [us-ft]", Unit::UsFoot, Some(Unit::US_FOOT)),
        ("x;y;z", Unit::Unknown, None),
        ("x (local);y (local);z (NAVD88)", Unit::Unknown, None),
        ("lon;lat;z\ndeg;deg;m", Unit::Degree, Some(1.0)),
        ("x [dd];y [dd];z", Unit::Degree, None),
    ] {
        let found = crs(&format!("{header}\n{rows}"));
        assert_eq!((found.horizontal, found.vertical), (unit, vertical), "{header}");
    }
    // Names that the user gives take no unit away.
    for header in ["a [ft];b [ft];c [cm]", "x;y;z\n[ft];[ft];[cm]", "# a [ft];b [ft];c [cm]"] {
        let path = file(".csv", format!("{header}\n{rows}").as_bytes());
        let named = |names: [&str; 3]| TextOptions {
            columns: Some(names.map(str::to_owned).to_vec()),
            ..TextOptions::default()
        };
        let crs = |names| open(&path, &named(names)).unwrap().crs;
        assert_eq!(
            (crs(["y", "x", "z"]).horizontal, crs(["y", "x", "z"]).vertical),
            (Unit::Foot, Some(0.01)),
            "{header}"
        );
        assert_eq!(crs(["x [m]", "y [m]", "z"]).horizontal, Unit::Metre);
    }
    for (header, words) in
        [("x [m];y [ft];z", "m for x and ft for y"), ("x [m];y [m];z\nmm;mm;mm", "the line below it has mm")]
    {
        let error = text(&format!("{header}\n{rows}")).err().expect("was read");
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains(words), "{error}");
    }
}

#[test]
fn decimal_commas_are_read_where_something_else_parts_columns() {
    for content in [
        "1,5;2;3,25\n4;5;6\n",
        "x;y;z\n1,5;2,0;3,25\n4,0;5,0;6,0\n",
        "sep=;\r\n\"z\";\"y\";\"x\"\r\n\"3,25\";\"2\";\"1,5\"\r\n6;5;4\r\n",
        "1,5\t2\t3,25\n4\t5\t6\n",
        "1,5 2,0 3,25\n4 5 6\n",
        "Punkt;Rechtswert;Hochwert;Höhe;Bemerkung\nA,1;1,5;2,0;3,25;Baum, alt\nA,2;4;5;6;\n",
        "z,y,x\n3,25;2;1,5\n6;5;4\n",
        "1,5e0;2;3,25\n4;5;6\n",
    ] {
        assert_two_points(content);
    }
    let cloud = text("x;y;z\n1,5;2;3\n2,5;1.234;3\n1,5;1.234,5;3\n").unwrap();
    assert_eq!((cloud.counts.kept, cloud.counts.malformed), (1, 2));
    assert!(cloud.counts.examples[0].contains("a comma before them in this file"), "{:?}", cloud.counts.examples);
}

#[test]
fn the_last_of_decimal_commas_can_be_cut_off() {
    let rows: String = (0..20).map(|i| format!("{i},50;{},25;{},125\n", 3 * i, 1000 + i)).collect();
    let cut = text(&rows[..rows.len() - 3]).unwrap();
    assert_eq!((cut.counts.kept, cut.counts.malformed), (19, 1));
}

#[test]
fn names_for_some_columns_do_not_hide_decimal_commas() {
    let rows: String =
        (0..50).map(|i| format!("{},25,{},50,12,{}\n", 565_000 + i, 5_933_000 + 7 * i, i % 10)).collect();
    let path = file(".csv", rows.as_bytes());
    let named = |names: &[&str]| {
        let columns = Some(names.iter().map(|name| name.to_string()).collect());
        open(&path, &TextOptions { columns, ..TextOptions::default() })
    };
    let error = named(&["x", "y", "z"]).expect_err("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("all of its columns"), "{error}");
    assert_eq!(named(&["x", "_", "y", "_", "z", "_"]).unwrap().records, 50);
}

#[test]
fn a_whole_table_without_some_of_its_last_column_is_read() {
    let row = |i: usize| {
        format!("{},{},{}{}\n", 565_000 + i, 5_933_000 + 7 * i, 12 + i, if i.is_multiple_of(3) { "" } else { ",2" })
    };
    let rows: String = (0..50).map(row).collect();
    assert_eq!(text(&format!("x,y,z,note\n{rows}")).unwrap().counts.kept, 50);
}

#[test]
fn the_columns_of_late_rows_are_counted_before_they_are_read() {
    let rows: String = (0..20_000).map(|i| format!("{i}.25,{}.5,{}.1,7\n", 3 * i, i % 9)).collect();
    let late = format!("x,y,z,i\n{rows}565000.25,5933000.50,12.123456,1,2,3\n");
    assert!(late.len() > 1 << 18);
    let cloud = text(&late).unwrap();
    assert_eq!((cloud.source.known_malformed(), cloud.counts.malformed), (1, 1));
    assert_eq!(cloud.source.axes[2].scale.to_string(), "0.1");
}

#[test]
fn messages_about_rows_name_the_right_column() {
    for (content, words) in [
        ("1 2 3\n1 2 15e29\n", "column 3 (z) is \"15e29\", which is too large"),
        ("1 2 3\n1 -3.4028235e+38 3\n", "\"-3.4028235e+38\", which is too large"),
        ("id,desc,x,y,z\n1,a,1,2,3\n77\n", "column 2 is missing"),
        ("P1 565026.16 5933012.3 12.1\nP2 565027.16 5933013.3 12.2\n", "column 1 (x) is \"P1\""),
    ] {
        let cloud = text(content).unwrap();
        assert!(cloud.counts.examples[0].contains(words), "{content:?}: {:?}", cloud.counts.examples);
    }
}

#[test]
fn the_warning_about_noise_shows_what_is_written() {
    let cloud = text("5.650231400000000139e+05 1 2\n1 2 3\n").unwrap();
    let warning = first_warning(&cloud);
    assert!(warning.contains("such as 5.650231400000000139e+05: read as 565023.14"), "{warning}");
}

#[test]
fn heights_from_single_precision_move_neither_x_nor_y() {
    let z = |i: usize| f64::from((100_000 + 37 * i) as f32 / 1000.0);
    for count in [4, 5, 9, 40, 400] {
        let rows: String = (0..count)
            .map(|i| {
                format!("{} {} {:.14}\n", 1_565_000.125 + 0.25 * i as f64, 5_400_000.125 + 0.25 * (i % 7) as f64, z(i))
            })
            .collect();
        let cloud = text(&rows).unwrap();
        assert_eq!(cloud.source.axes.map(|axis| axis.scale.to_string()), ["0.001"; 3], "{count} rows");
        assert_eq!((cloud.source.min[0], cloud.counts.rounded_xy), (1_565_000.125, 0), "{count} rows");
    }
    // One such number of a few says nothing about the others.
    let few = text("1 2 3.125\n2 3 4.0625\n4 5 12.300000190734863\n5 7 1000000.0625\n").unwrap();
    assert_eq!((few.source.axes[2].scale.to_string(), few.counts.rounded_z), ("0.0001".to_string(), 1));
}

#[test]
fn a_broken_row_after_the_header_is_not_taken_for_units() {
    let cloud = text("x,y,z\nfour,5,6\n1,2,3\n").unwrap();
    assert_eq!((cloud.counts.kept, cloud.counts.malformed), (1, 1));
    assert!(cloud.counts.examples[0].contains("line 2"), "{:?}", cloud.counts.examples);
}

#[test]
fn a_decimal_comma_between_commas_is_refused() {
    for content in ["565000,25,5933000,50,12,1\n565001,25,5933001,50,12,3\n", "12,05,50,50,12,10\n12,15,50,55,13,10\n"]
    {
        let error = text(content).err().unwrap_or_else(|| panic!("{content:?} was read"));
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("before decimals"), "{error}");
    }
    for header in ["x,y,z", "x,y,z,r,g,b", "x,y,z,i,j", "Rechtswert,Hochwert,Hoehe,Code,Datum,Bem"] {
        let rows: String = (0..50).map(|i| format!("{},25,{},5,12,1\n", 565_000 + i, 5_933_000 + 7 * i)).collect();
        let error = text(&format!("{header}\n{rows}")).err().unwrap_or_else(|| panic!("{header:?} was read"));
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("before decimals"), "{error}");
    }
    let cloud = text("x;y;z\n1.5;2.5;3\n1.5;2.5;3.5\n1,5;2,5;3,5\n").unwrap();
    assert!(cloud.counts.examples[0].contains("decimals have a point"), "{:?}", cloud.counts.examples);
    // Colours in whole numbers are no decimals.
    assert_eq!(text("565000,5933000,12,255,128,3\n565001,5933001,13,255,128,3\n").unwrap().counts.kept, 2);
}

#[test]
fn whole_columns_that_may_be_decimals_need_names() {
    let rows: String = (0..50).map(|i| format!("{},{},12,{}\n", 565_000 + i, 5_933_000 + 7 * i, 10 + i % 90)).collect();
    let error = text(&rows).err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("columns"), "{error}");
    assert_eq!(text(&format!("x,y,z,intensity\n{rows}")).unwrap().counts.kept, 50);
    let columns = Some(["x", "y", "z", "i"].map(str::to_owned).to_vec());
    let path = file(".csv", rows.as_bytes());
    assert_eq!(open(&path, &TextOptions { columns, ..TextOptions::default() }).unwrap().records, 50);
}

#[test]
fn a_column_after_whole_coordinates_is_read_with_a_warning() {
    let rows: String = (0..60).map(|i| format!("{},{},{},{}\n", 1000 + i / 4, i % 4, 200 + i % 3, 1 + i % 7)).collect();
    let cloud = text(&rows).unwrap();
    assert_eq!((cloud.counts.kept, cloud.source.max[2]), (60, 202.0));
    let warnings = cloud.source.warnings.iter().map(|warning| warning.to_string()).collect::<String>();
    assert!(warnings.contains("[input.csv] columns") && warnings.contains("decimal commas"), "{warnings}");
}

#[test]
fn names_and_texts_may_be_in_windows_1252() {
    let utf8 = "Punkt;Rechtswert;Hochwert;H\u{f6}he\nT\u{fc}r;1,5;2;3,25\nB;4;5;6\n";
    let western: Vec<u8> = utf8.chars().map(|character| u32::from(character) as u8).collect();
    for bytes in [utf8.as_bytes(), &western] {
        let cloud = read_bytes(".csv", bytes).unwrap();
        assert_eq!((cloud.counts.kept, cloud.source.min, cloud.source.max), (2, [1.5, 2.0, 3.25], [4.0, 5.0, 6.0]));
    }
}

#[test]
fn a_title_is_no_header() {
    for title in ["My x y z file", "Points x y z"] {
        let error = text(&format!("{title}\n1.5,2,3.25\n4,5,6\n")).err().expect("was read");
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("and the rows have 3"), "{error}");
        assert_two_points(&format!("{title}\nz,y,x\n3.25,2,1.5\n6,5,4\n"));
    }
    assert_two_points("z y x\n3.25,2,1.5\n6,5,4\n");
    assert_two_points("z,y,x,note,more\n3.25,2,1.5,a\n6,5,4,b\n");
}

#[test]
fn any_number_of_comments_may_come_before_the_rows() {
    let comments: String = (0..20_000).map(|i| format!("# {i} comment\n")).collect();
    assert!(comments.len() > 1 << 18);
    assert_two_points(&format!("{comments}z;y;x\n3.25;2;1.5\n6;5;4\n"));
    assert_two_points(&format!("\u{feff}{comments}# z;y;x\n3.25;2;1.5\n6;5;4\n"));
}

#[test]
fn coordinates_too_small_to_tell_apart_are_refused() {
    let rows: String = (1..50).map(|i| format!("{i}e-16 {}e-17 {i}\n", i * i)).collect();
    let error = text(&rows).err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("smaller unit"), "{error}");
    assert_eq!(text("1e-400 0 2\n1 0 3\n").unwrap().counts.kept, 2);
}

#[test]
fn a_last_line_that_may_be_cut_off_gives_a_warning() {
    let rows: String = (0..20).map(|i| format!("{i} {} {}\n", 3 * i, 1000 + i)).collect();
    let cut = text(&rows[..rows.len() - 3]).unwrap();
    assert_eq!(cut.counts.kept, 20);
    assert!(first_warning(&cut).contains("may be cut off"), "{}", first_warning(&cut));
    assert_eq!(first_warning(&text(rows.trim_end()).unwrap()), "");
}

#[test]
fn a_row_with_more_columns_than_the_header_names_is_malformed() {
    for (content, line) in [
        ("x,y,z\n1,2,3\n1,2,3,4\n", "line 3"),
        ("x y z\n1 2 3\n\n1 2 3 4\n", "line 4"),
        ("x,y,z,note\n1,2,3,a\n1,2,3,a,b\n", "line 3"),
        ("\"x\",\"y\",\"z\"\n\"1\",273357,5274357,3\n1,2,3\n", "line 2"),
    ] {
        let cloud = text(content).unwrap();
        assert_eq!((cloud.counts.kept, cloud.counts.malformed), (1, 1), "{content:?}");
        let example = &cloud.counts.examples[0];
        assert!(example.contains(line) && example.contains("but the header names"), "{example}");
    }
    assert_eq!(text("x,y,z,note\n1,2,3,\"a, b\"\n1,2,3,\n1,2,3\n").unwrap().counts.malformed, 0);
    assert_eq!(text("1,2,3\n1,2,3,4\n").unwrap().counts.malformed, 0);
}

#[test]
fn colours_from_0_to_1_and_an_empty_class_are_read() {
    let cloud = assert_two_points("x,y,z,r,g,b,class\n1.5,2,3.25,0.5,0,1,\n4,5,6,1,0.25,0,2\n");
    let found: Vec<_> = cloud.points.iter().map(|p| (p.rgb, p.class)).collect();
    assert_eq!(found, [([32768, 0, 65535], 0), ([65535, 16384, 0], 2)]);
    let cloud = assert_two_points("x,y,z,r,g,b\n1.5,2,3.25,12.6,,255\n4,5,6,1,0,0\n");
    assert_eq!(cloud.points[0].rgb, [13, 0, 255]);
}

#[test]
fn colours_and_classes_that_cannot_be_read_lose_no_point() {
    for class in ["Ground", "nan", "-1", "1000", "2.5"] {
        let cloud = assert_two_points(&format!("x,y,z,class\n1.5,2,3.25,{class}\n4,5,6,2\n"));
        assert_eq!([cloud.points[0].class, cloud.points[1].class], [0, 2], "{class}");
        assert!(first_warning(&cloud).contains(class), "{}", first_warning(&cloud));
    }
    for color in ["nan", "ff", "-5", "70000"] {
        let cloud = assert_two_points(&format!("x,y,z,r,g,b\n1.5,2,3.25,1,2,{color}\n4,5,6,4,5,6\n"));
        assert_eq!(cloud.points[0].rgb, [1, 2, 0], "{color}");
        assert!(first_warning(&cloud).contains("they are read as 0"), "{}", first_warning(&cloud));
        let cloud = assert_two_points(&format!("x,y,z,r,g,b\n1.5,2,3.25,1,2,{color}\n4,5,6,4,{color},6\n"));
        assert!(
            !cloud.source.has_rgb && first_warning(&cloud).contains("and are ignored"),
            "{}",
            first_warning(&cloud)
        );
    }
}

#[test]
fn formats_that_are_no_tables_are_named() {
    for (content, words) in [
        (&b"ply\nformat ascii 1.0\nend_header\n1 2 3\n"[..], "is PLY"),
        (b"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nDATA ascii\n1 2 3\n", "is PCD"),
        (b"<!DOCTYPE html>\n<html></html>\n", "HTML"),
        (b"{\"points\": [[1, 2, 3]]}\n", "is JSON"),
        (&[0x1f, 0x8b, 8, 0], "gzip -dk"),
    ] {
        let error = read_bytes(".csv", content).err().unwrap_or_else(|| panic!("{words}: was read"));
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains(words), "{error}");
    }
}
