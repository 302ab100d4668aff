//! The layouts of texts that programs write: names of columns, lines before them, delimiters, colours.

use gdt_batch::Result;
use gdt_batch::input::{Point, TextOptions, open};

use crate::cloud::{Cloud, file, read_bytes};
use crate::first_warning;

fn text(content: &str) -> Result<Cloud> {
    read_bytes(".csv", content.as_bytes())
}

/// Asserts that the text holds (1.5, 2, 3.25) and (4, 5, 6).
#[track_caller]
fn assert_two_points(content: &str) -> Cloud {
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
    // A comment that names other columns than the rows have says nothing about them.
    assert_two_points("# z y x of the hill\n1.5 2 3.25\n4 5 6\n");
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
        assert!(error.exit_code() == 3 && error.to_string().contains("before decimals"), "{error}");
    }
    for header in ["x,y,z", "x,y,z,r,g,b", "x,y,z,i,j", "Rechtswert,Hochwert,Hoehe,Code,Datum,Bem"] {
        let rows: String = (0..50).map(|i| format!("{},25,{},5,12,1\n", 565_000 + i, 5_933_000 + 7 * i)).collect();
        let error = text(&format!("{header}\n{rows}")).err().unwrap_or_else(|| panic!("{header:?} was read"));
        assert!(error.exit_code() == 3 && error.to_string().contains("before decimals"), "{error}");
    }
    let cloud = text("x;y;z\n1,5;2,5;3,5\n").unwrap();
    assert!(cloud.counts.examples[0].contains("decimals have a point"), "{:?}", cloud.counts.examples);
    // Colours in whole numbers are no decimals.
    assert_eq!(text("565000,5933000,12,255,128,3\n565001,5933001,13,255,128,3\n").unwrap().counts.kept, 2);
}

#[test]
fn whole_columns_that_may_be_decimals_need_names() {
    let rows: String = (0..50).map(|i| format!("{},{},12,{}\n", 565_000 + i, 5_933_000 + 7 * i, 10 + i % 90)).collect();
    let error = text(&rows).err().expect("was read");
    assert!(error.exit_code() == 3 && error.to_string().contains("columns"), "{error}");
    assert_eq!(text(&format!("x,y,z,intensity\n{rows}")).unwrap().counts.kept, 50);
    let columns = Some(["x", "y", "z", "i"].map(str::to_owned).to_vec());
    let path = file(".csv", rows.as_bytes());
    assert_eq!(open(&path, &TextOptions { columns, ..TextOptions::default() }).unwrap().records, 50);
}

#[test]
fn a_title_is_no_header() {
    for title in ["My x y z file", "Points x y z"] {
        let error = text(&format!("{title}\n1.5,2,3.25\n4,5,6\n")).err().expect("was read");
        assert!(error.exit_code() == 3 && error.to_string().contains("and the rows have 3"), "{error}");
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
    assert!(error.exit_code() == 3 && error.to_string().contains("smaller unit"), "{error}");
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
fn formats_that_are_no_tables_are_named() {
    for (content, words) in [
        (&b"ply\nformat ascii 1.0\nend_header\n1 2 3\n"[..], "is PLY"),
        (b"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nDATA ascii\n1 2 3\n", "is PCD"),
        (b"<!DOCTYPE html>\n<html></html>\n", "HTML"),
        (b"{\"points\": [[1, 2, 3]]}\n", "is JSON"),
        (&[0x1f, 0x8b, 8, 0], "gzip -dk"),
    ] {
        let error = read_bytes(".csv", content).err().unwrap_or_else(|| panic!("{words}: was read"));
        assert!(error.exit_code() == 3 && error.to_string().contains(words), "{error}");
    }
}
