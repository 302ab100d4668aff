//! Texts that look like something else: decimal commas, directions and units in brackets, degrees, colours, apostrophes.

use crs::Unit;
use points::{TextOptions, open};

use crate::cloud::file;
use crate::first_warning;
use crate::layouts::{assert_two_points, text};
use sys::ErrorKind;

#[test]
fn a_commented_header_does_not_hide_decimal_commas() {
    let rows = |row: fn(usize) -> String| -> String { (0..50).map(row).collect() };
    let plain = rows(|i| format!("{},{},{},{},25,{}\n", 565_013 + i, 44 - i % 30, 5_933_084 + i, 74 - i, i % 10));
    let numbered =
        rows(|i| format!("{i},{},{},{},{},25,{}\n", 565_013 + i, 44 - i % 30, 5_933_084 + i, 74 - i, i % 10));
    let coded = rows(|i| format!("{},{},{},{},25,GND\n", 565_013 + i, 44 - i % 30, 5_933_084 + i, 74 - i));
    for (comment, rows) in [
        ("# x,y,z\n", &plain),
        ("# y,x,z\n", &plain),
        ("# z,x,y\n", &plain),
        ("//X,Y,Z,R\n", &plain),
        ("# id,x,y,z\n", &numbered),
        ("# x,y,z,code\n", &coded),
        ("x,y,z,code\n", &coded),
        ("", &coded),
    ] {
        let error = text(&format!("{comment}{rows}")).err().unwrap_or_else(|| panic!("{comment:?} was read"));
        let words = ["before decimals", "565000,25,5933000,50"];
        assert!(
            error.kind() == ErrorKind::Input && words.iter().all(|word| error.to_string().contains(word)),
            "{comment:?}: {error}"
        );
    }
    // A point shows that commas part columns.
    assert_two_points("# z,y,x\n3.25,2,1.5,9\n6,5,4,9\n");
    let counted: String =
        (1..50).map(|i| format!("{i} {}.5 {}.25 7.1\n", 565_000 + i * i % 7, 5_933_000 + i)).collect();
    let error = text(&format!("# x y z\n{counted}")).err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("counts the rows"), "{error}");
}

#[test]
fn decimal_commas_beside_whole_columns_are_read() {
    for content in [
        "1,5;2,0;3,25;10;20;30\n4,0;5,0;6,0;11;21;31\n",
        "id;x;y;z;intensity;class\n1;1,5;2,0;3,25;100;2\n2;4;5;6;101;2\n",
        "X\tY\tZ\tR\tG\tB\n1,5\t2,0\t3,25\t10\t20\t30\n4\t5\t6\t10\t20\t30\n",
        "1,5 2,0 3,25 10 20 30\n4,0 5,0 6,0 10 20 30\n",
    ] {
        assert_two_points(content);
    }
}

#[test]
fn a_date_beside_decimal_commas_is_no_decimal_point() {
    let table = |line: &dyn Fn(&str) -> String| -> String {
        [line("1;1,5;2,0;3,25;5;2"), line("2;4,0;5,0;6,0;5;3")].map(|row| row + "\n").concat()
    };
    for last in ["01.02.2024", "img1.jpg", "12:30:01.5", "v1.0", "scan_1.las", "2.5"] {
        let header = "id;x;y;z;code;n;last\n";
        let rows = table(&|row| format!("{row};{last}"));
        assert_two_points(&format!("{header}{rows}"));
        assert_two_points(&format!("{header}{rows}").replace(';', "\t"));
        assert_two_points(&format!("{header}{rows}").replace(';', " "));
        let quoted = |row: &str| row.split(';').map(|field| format!("\"{field}\"")).collect::<Vec<_>>().join(";");
        assert_two_points(&format!("{header}{}", table(&|row| quoted(&format!("{row};{last}")))));
        // What the user says of the layout changes nothing.
        let path = file(".csv", format!("{header}{rows}").as_bytes());
        let columns = Some(["id", "x", "y", "z"].map(str::to_owned).to_vec());
        let options = TextOptions { delimiter: Some(';'), header: Some(true), columns, comment: None };
        let source = open(&path, &options).unwrap();
        assert_eq!((source.min, source.max), ([1.5, 2.0, 3.25], [4.0, 5.0, 6.0]), "{last}");
        assert_eq!(source.known_malformed(), 0, "{last}");
    }
    // Points before decimals beside a column with commas, as of a list.
    assert_two_points("x;y;z;lines\n1.5;2.0;3.25;1,2\n4.0;5.0;6.0;2,3\n");
}

#[test]
fn wide_rows_with_commas_before_decimals_are_refused() {
    let row = |i: usize| {
        let (x, y, z) = (75_404 + i % 60, 80_200 + i / 60, 266 + i % 5);
        format!("{x},{},{y},{},{z},{},127,68,44", i * 7 % 10, i * 3 % 10, i * i % 10)
    };
    let rows = |more: &str| (0..3000).map(|i| format!("{}{more}\n", row(i))).collect::<String>();
    let wide = ",2,1,1,0,7";
    for (comment, more) in [
        ("# x y z red green blue\n", ""),
        ("#x,y,z\n", ""),
        ("# x,y,z,red,green,blue\n", ""),
        ("", ""),
        ("# x y z red green blue\n", wide),
        ("#x,y,z\n", wide),
    ] {
        let error = text(&format!("{comment}{}", rows(more))).err().unwrap_or_else(|| panic!("{comment:?} was read"));
        let words = ["before decimals", "columns", "565000,25,5933000,50"];
        assert!(
            error.kind() == ErrorKind::Input && words.iter().all(|word| error.to_string().contains(word)),
            "{comment:?}: {error}"
        );
    }
}

#[test]
fn wide_tables_of_whole_numbers_are_read() {
    let row = |i: usize| {
        let color = [i % 256, 5 * i % 256, i * i % 256].map(|channel| channel.to_string()).join(",");
        format!("{},{},{},{color}", 565_000 + 3 * i, 5_933_000 + 7 * i, 12 + i % 90)
    };
    let more = |count: usize| (0..count).map(|more| format!(",{more}")).collect::<String>();
    for (comment, count) in [
        ("# x y z red green blue", 3),
        ("# x y z", 3),
        ("#x,y,z", 3),
        ("#x,y,z", 14),
        ("# made today", 3),
        ("# made today", 14),
        ("x,y,z,r,g,b,0,1,2,3,4,5,6,7,8,9,a,b,c", 13),
    ] {
        let rows: String = (0..3000).map(|i| format!("{}{}\n", row(i), more(count))).collect();
        let cloud = text(&format!("{comment}\n{rows}")).unwrap_or_else(|error| panic!("{comment:?}: {error}"));
        assert_eq!((cloud.counts.kept, cloud.source.max[0]), (3000, 573_997.0), "{comment:?}");
    }
}

#[test]
fn decimal_commas_in_quotes_are_read_between_commas() {
    for content in [
        "\"1,5\",\"2,0\",\"3,25\"\n\"4,0\",\"5,0\",\"6,0\"\n",
        "name,z,y,x,r,g,b\r\n\"Baum, alt\",\"3,25\",2,\"1,5\",1,2,3\r\nb,6,5,\"4,0\",1,2,3\r\n",
        "\"x\",\"y\",\"z\",i\n\"1,5\",2,\"3,25\",10\n4,5,6,20\n",
    ] {
        let cloud = assert_two_points(content);
        assert!(cloud.points.iter().all(|point| !cloud.source.has_rgb || point.rgb == [1, 2, 3]), "{content:?}");
    }
    let error = text("\"565,000\",\"933,012\",\"1,120\"\n\"565,001\",\"933,013\",\"1,121\"\n").err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("thousands"), "{error}");
}

#[test]
fn an_apostrophe_quotes_no_delimiter() {
    let rows = |before: &str, after: &str| format!("{before},1.5,2,3.25,{after}\n{before},4,5,6,{after}\n");
    for (header, after) in
        [("name,x,y,z,remark", "'t Hof"), ("name,x,y,z,remark,u,v,w", "'t,7,8,9"), ("name,x,y,z,r", "Hans'")]
    {
        assert_two_points(&format!("{header}\n{}", rows("'s-Gravenhage 7", after)));
    }
    assert_two_points("'z','y','x'\n'3.25','2','1.5'\n6,5,4\n");
}

#[test]
fn a_letter_with_a_direction_in_brackets_is_read_by_the_direction() {
    for header in ["Z;X (Northing);Y (Easting)", "Z [m];X [north];Y [east]", "Höhe;X (Hochwert);Y (Rechtswert)"] {
        assert_two_points(&format!("{header}\n3.25;2;1.5\n6;5;4\n"));
    }
    assert_two_points("X (Easting);Y (Northing);Z\n1.5;2;3.25\n4;5;6\n");
    let error = text("X (Northing);Y;Z\n1.5;2;3.25\n4;5;6\n").err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("names no column x"), "{error}");
}

#[test]
fn all_brackets_after_a_name_are_read() {
    for header in ["Z [m];X (Northing) [m];Y (Easting) [m]", "Z;X [m] (Hochwert);Y [m] (Rechtswert)"] {
        let crs = assert_two_points(&format!("{header}\n3.25;2;1.5\n6;5;4\n")).source.crs;
        assert_eq!(crs.horizontal, Unit::Metre, "{header}");
    }
    for header in [
        "Easting (X) [ft];Northing (Y) [ft];Z [ft]",
        "X [Easting (ft)];Y [Northing (ft)];Z [Height (ft)]",
        "X (Easting in feet);Y (Northing in feet);Z (feet)",
        "X (Easting ft);Y (Northing ft);Z (Height ft)",
        "X (Easting / ft);Y (Northing / ft);Z (Height / ft)",
    ] {
        let cloud = assert_two_points(&format!("{header}\n1.5;2;3.25\n4;5;6\n"));
        assert_eq!(
            (cloud.source.crs.horizontal, cloud.source.crs.vertical),
            (Unit::Foot, Some(Unit::FOOT)),
            "{header}"
        );
        assert!(first_warning(&cloud).contains("international feet"), "{header}");
    }
    for header in ["X [ft (US)];Y [ft (US)];Z", "X [ft US survey];Y [ft US survey];Z", "X (foot us);Y [ft-US];Z"] {
        let cloud = assert_two_points(&format!("{header}\n1.5;2;3.25\n4;5;6\n"));
        assert_eq!(cloud.source.crs.horizontal, Unit::UsFoot, "{header}");
        assert_eq!(first_warning(&cloud), "", "{header}");
    }
}

#[test]
fn units_in_a_comment_below_names_in_a_comment_are_used() {
    for comments in ["# x,y,z\n# ft,ft,ft", "# x,y,z\n# made today\n#[ft],[ft],[ft]", "// x y z\n// units: ft ft ft"] {
        let cloud = assert_two_points(&format!("{comments}\n1.5,2,3.25\n4,5,6\n"));
        assert_eq!(
            (cloud.source.crs.horizontal, cloud.source.crs.vertical),
            (Unit::Foot, Some(Unit::FOOT)),
            "{comments}"
        );
    }
    // A sentence is no line of units.
    let cloud = assert_two_points("# x y z\n# in m\n# ft, m, see below\n1.5,2,3.25\n4,5,6\n");
    assert_eq!(cloud.source.crs.horizontal, Unit::Unknown);
    let error = text("# x [m],y [m],z [m]\n# ft,ft,ft\n1.5,2,3.25\n4,5,6\n").err().expect("was read");
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("the line below it has ft"), "{error}");
}

#[test]
fn units_that_are_not_known_are_named() {
    for (header, unknown) in [
        ("x [rod];y [rod];z [rod]", "\"rod\""),
        ("x (local);y (local);z", "\"local\""),
        ("X [Easting (rod)];Y [Northing (rod)];z", "\"rod\""),
        ("x [m];y [m];Z (local)", "\"local\""),
    ] {
        let cloud = assert_two_points(&format!("{header}\n1.5;2;3.25\n4;5;6\n"));
        let warning = first_warning(&cloud);
        assert!(warning.contains(unknown) && warning.contains("is unknown, and ignored"), "{header}: {warning:?}");
    }
    for header in [
        "x [yd];y [yd];z [yd]",
        "x (survey feet);y (survey feet);z (m ü. NN)",
        "x [Mètres];y [Mètres];z (Höhe)",
        "x [m];y [m];Z (m.s.l.)",
        "x [m];y [m];z (AHD)",
    ] {
        let cloud = assert_two_points(&format!("{header}\n1.5;2;3.25\n4;5;6\n"));
        assert!(cloud.source.crs.horizontal != Unit::Unknown && first_warning(&cloud).is_empty(), "{header}");
    }
}

#[test]
fn degrees_that_no_name_tells_are_a_warning() {
    let row =
        |i: usize| format!("{:.7},{:.7},{}.5\n", 11.5 + i as f64 / 1e5, 48.1 + (i * i % 50) as f64 / 1e5, 500 + i % 9);
    let rows: String = (0..50).map(row).collect();
    for header in ["X,Y,Z\n", "POINT_X,POINT_Y,POINT_Z\n", ""] {
        let cloud = text(&format!("{header}{rows}")).unwrap();
        assert!(
            first_warning(&cloud).contains("look like longitude and latitude, but are treated as lengths"),
            "{header:?}"
        );
    }
    assert_eq!(first_warning(&text(&format!("x [m],y [m],z [m]\n{rows}")).unwrap()), "");
    // A scanner's own coordinates.
    let scan: String =
        (0..50).map(|i| format!("{:.7} {:.7} 1.2345678\n", (i as f64).sin(), (i as f64).cos())).collect();
    assert_eq!(first_warning(&text(&scan).unwrap()), "");
}

#[test]
fn the_message_names_the_column_that_is_missing() {
    let error = text("Latitude (deg),Longitude (deg),Geoidal height (m)\n48.1,11.5,3\n").err().expect("was read");
    assert!(error.to_string().contains("names no column z"), "{error}");
}

#[test]
fn an_empty_last_column_is_no_column_without_a_name() {
    for row in ["1,2,3,\n4,5,7,\n", "1,2,3,,\n4,5,7,,\n", " 1\t 2\t 3 \t\n 4\t 5\t 7 \t\n"] {
        assert_eq!(first_warning(&text(row).unwrap()), "", "{row:?}");
    }
    assert!(first_warning(&text("1,2,3,9\n4,5,7,9\n").unwrap()).contains("it has no header"));
}

#[test]
fn the_scale_of_colours_is_that_of_the_whole_text() {
    let rows = |colors: &str, count: usize| -> String {
        (0..count).map(|i| format!("{i}.250,{}.500,{}.125,{colors}\n", i * 7 % 1000, i % 9)).collect()
    };
    let last = |first: &str, count: usize, second: &str| {
        let content = format!("x,y,z,r,g,b\n{}{}", rows(first, 5000), rows(second, count));
        assert!(content.len() > 1 << 17);
        let cloud = text(&content).unwrap();
        let warned = first_warning(&cloud).contains("from 0 to 1 in");
        (cloud.points[cloud.points.len() - 1].rgb, warned)
    };
    assert_eq!(last("0.000,0.000,0.000", 5000, "0.400,0.600,0.200"), ([26214, 39321, 13107], false));
    assert_eq!(last("0.400,0.600,0.200", 5000, "0.400,0.600,0.200"), ([26214, 39321, 13107], false));
    assert_eq!(last("0.4,0.6,0.2", 5100, "140,160,120"), ([140, 160, 120], true));
    assert_eq!(last("0.4,0.6,0.2", 4000, "140,160,120"), ([65535; 3], true));
    assert_eq!(last("0.4,0.6,0.2", 1, "140,160,120"), ([65535; 3], false));
    assert_eq!(last("0,0,0", 5000, "140,160,120"), ([140, 160, 120], false));
}

/// Rows in the order northing, easting, height.
const NORTH_FIRST: &str = "5933001.5 565002.25 12.5\n5933004.5 565005.25 13.5\n5933011.5 565001.25 14.5\n";

#[test]
fn names_in_many_languages_and_forms_are_read() {
    for header in [
        "# N/E/H (m)",
        "# X_north Y_east Z",
        "X_north Y_east Z",
        "# utm_north utm_east ellipsoidal_h",
        "% Hochwert Rechtswert Hoehe",
        "; N E H",
        "-- N E H",
        "Columns: N E H",
        "\u{feff}# Norden Osten Höhe",
        "# nord est hauteur",
        "# Norte Este Altura",
        "# Noord Oost Hoogte",
        "# Północ Wschód Wysokość",
        "# Sever Východ Výška",
        "# Norr Öster Höjd",
        "# Pohjoinen Itä Korkeus",
        "# Север Восток Высота",
    ] {
        let cloud = text(&format!("{header}\n{NORTH_FIRST}")).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(cloud.source.min, [565_001.25, 5_933_001.5, 12.5], "{header}");
    }
}

#[test]
fn comments_that_list_columns_in_another_order_are_no_remarks() {
    for header in [
        "# north, east",
        "# NEZ",
        "# col1: north\n# col2: east\n# col3: height",
        "# column 2 = easting\n# column 1 = northing\n# column 3 = height",
        "# Northing\n# Easting\n# Height",
        "# X Y Z are in the order north east up",
        "# Northing and easting in metres, heights DHHN2016",
        "# export of a device, X (north), Y (east), Z",
        "# column 2: x (east)\n# column 1: y (north)\n# column 3: z",
    ] {
        let error = text(&format!("{header}\n{NORTH_FIRST}")).err().unwrap_or_else(|| panic!("{header} was read"));
        let message = error.to_string();
        assert!(
            error.kind() == ErrorKind::Input && message.contains("`columns` under [input.csv]"),
            "{header}: {message}"
        );
        assert!(message.contains("the comment"), "{header}: {message}");
    }
    for header in ["# X Y Z\n# North East Up", "# X = north, Y = east\nX Y Z"] {
        let error = text(&format!("{header}\n{NORTH_FIRST}")).err().unwrap_or_else(|| panic!("{header} was read"));
        assert!(
            error.kind() == ErrorKind::Input && error.to_string().contains("gives them other directions"),
            "{header}: {error}"
        );
    }
}

#[test]
fn remarks_are_no_headers() {
    for remark in [
        "# made by a scanner, north of the river",
        "# scanned from north to east, height in m",
        "# WGS84, UTM32N, EGM96",
        "# surveyed 2020, Meyer, Bern",
        "# north: 5933200.5, east: 565400.25, height: 14",
        "# X Y Z, north east corner",
        "# Author: Y. Nord",
        "# exported from X for the Y district",
        "# X Y Z (Y = north, X = east)",
    ] {
        let cloud = text(&format!("{remark}\n1.5,2,3.25\n4,5,6\n")).unwrap_or_else(|error| panic!("{remark}: {error}"));
        assert_eq!(cloud.source.min, [1.5, 2.0, 3.25], "{remark}");
        assert!(cloud.source.warnings.iter().next().is_none(), "{remark}: {:?}", cloud.source.warnings);
    }
    let cloud = text("# Meyer, Berger, Bern\n1.5,2,3.25\n4,5,6\n").unwrap();
    assert!(first_warning(&cloud).contains("the first three are taken as x, y and z"));
}

#[test]
fn a_mark_that_may_be_the_name_of_a_column_is_not_left_out() {
    for header in ["#\tX\tY\tZ", "%\tX\tY\tZ"] {
        let error = text(&format!("{header}\n17\t1.5\t2\t3.25\n12\t4\t5\t6\n")).err().expect("was read");
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains("rows have 4"), "{error}");
    }
}

#[test]
fn blanks_commas_and_points_between_thousands_are_refused() {
    let pointed = |value: usize| match value {
        0..1000 => value.to_string(),
        _ => format!("{}.{:03}", value / 1000, value % 1000),
    };
    for row in [
        &|i: usize| format!("565 {:03},50\t5 933 {},25\t99,5\n", 10 * i, 300 + i) as String,
        &|i: usize| format!("565,{:03},5,933,{},100\n", 10 * i, 300 + i),
        &|i: usize| format!("{};{};7.5\n", pointed(137 * i), pointed(91 * i)),
    ] as [&dyn Fn(usize) -> String; 3]
    {
        let rows: String = (1..90).map(row).collect();
        let error = text(&rows).err().unwrap_or_else(|| panic!("{} was read", row(1)));
        assert!(
            error.kind() == ErrorKind::Input && error.to_string().contains("between thousands"),
            "{}: {error}",
            row(1)
        );
    }
}

#[test]
fn lines_between_rows_that_name_the_same_columns_are_no_news() {
    let rows: String =
        (0..50).map(|i| format!("{}.25 {}.5 {}\n", 5_933_000 + i, 565_000 + i * i % 50, i % 9)).collect();
    for (header, between) in [
        ("# N E H\n", "# N E H\n"),
        ("# N E H\n", "\n## Northing [m] Easting [m] Height\n"),
        ("# old: E N H\n# N E H\n", "# the second day, from the north east corner\n"),
        ("N E H\n", "# x y z of the hill\n// end of part 1\n"),
        ("", "# x y z\n"),
        ("# 100 points\n# N E H\n", "# Scan 2, 50 points\n"),
    ] {
        let cloud =
            text(&format!("{header}{rows}{between}{rows}")).unwrap_or_else(|error| panic!("{between}: {error}"));
        assert!(!first_warning(&cloud).contains("gives"), "{between}: {}", first_warning(&cloud));
    }
    let named = TextOptions { columns: Some(["y", "x", "z"].map(String::from).to_vec()), ..TextOptions::default() };
    let path = file(".csv", format!("# N E H\n{rows}# E N H\n{rows}").as_bytes());
    assert!(open(&path, &named).is_ok());
}

#[test]
fn heights_of_no_place_on_earth_show_that_z_is_another_column() {
    let row = |i: usize| format!("{} {}.25 {}.5\n", 1000 + i * 7 % 50, 565_000 + i, 5_933_000 + i * i % 50);
    let rows: String = (0..50).map(row).collect();
    let cloud = text(&rows).unwrap();
    let warning = first_warning(&cloud);
    assert!(
        warning.contains("all heights are from 5933000.5 to 5933049.5") && warning.contains("columns 1, 2 and 3"),
        "{warning}"
    );
    assert_eq!(first_warning(&text(&format!("x y z\n{rows}")).unwrap()), "");
}
