//! Points as text: the layouts that people use, options, malformed lines, and any bytes at all.

#[path = "common/cloud.rs"]
mod cloud;
mod common;

use std::path::Path;

use cloud::{Cloud, decode, file, lattice, read, read_bytes, read_with, rules, survives};
use points::{FileFormat, Point, TextOptions, open};
use proptest::prelude::*;
use rust_decimal::Decimal;
use sys::{ErrorKind, Result};

#[test]
fn small_real_texts_of_every_layout_are_read() {
    let Some(shared) = common::shared() else { return };
    let expected = [("autzen-point-format-3.txt", 106, true), ("crlf_test.txt", 10, false), ("quoted2.txt", 9, false)];
    for (name, points, rgb) in expected {
        let cloud = read(&shared.join("data").join(name)).unwrap();
        assert_eq!((cloud.counts.kept, cloud.counts.malformed), (points, 0), "{name}");
        assert_eq!((cloud.source.format, cloud.source.has_rgb), (FileFormat::Text, rgb), "{name}");
        assert!(cloud.source.warnings.is_empty(), "{name}");
    }
}

#[test]
fn a_text_has_the_same_points_as_the_laz_file_from_which_it_was_made() {
    let Some(shared) = common::shared() else { return };
    let laz = open(&shared.join("data/Topography.laz"), &TextOptions::default()).unwrap();
    let csv = open(&shared.join("data/topography.csv"), &TextOptions::default()).unwrap();
    let lattice = lattice(&csv);
    let (from_laz, laz_counts) = decode(&laz, &rules(&laz, &lattice)).unwrap();
    let (from_csv, csv_counts) = decode(&csv, &rules(&csv, &lattice)).unwrap();
    assert_eq!((laz_counts.rounded_xy, csv_counts.rounded_xy), (0, 0));
    assert_eq!(from_laz.len(), 73_403);
    assert!(from_laz.iter().zip(&from_csv).all(|(a, b)| (a.position, a.z, a.order()) == (b.position, b.z, b.order())));
}

fn text(content: &str) -> Result<Cloud> {
    read_bytes(".csv", content.as_bytes())
}

fn coordinates(cloud: &Cloud) -> Vec<[f64; 3]> {
    let world = |p: &Point| [0, 1, 2].map(|axis| cloud.lattice.world(axis, [p.position[0], p.position[1], p.z][axis]));
    cloud.points.iter().map(world).collect()
}

#[test]
fn texts_of_many_layouts_have_the_same_points() {
    let layouts = [
        "1.5,2,3.25\n4,5,6\n",
        "x,y,z\n1.5,2,3.25\n4,5,6",
        "1.5;2;3.25\r\n4;5;6\r\n",
        "1.5\t2\t3.25\n4\t5\t6\n",
        "  1.5   2 \t 3.25  \n\n4 5 6\n",
        "1.5 , 2 ,  3.25\n4, 5, 6\n",
        "\u{feff}X;Y;Z\n1.5;2;3.25\n4;5;6\n",
        "\"Z\",\"name\",\"Easting\",\"Northing\"\n3.25,\"a, b\",1.5,2\n6,c,4,5\n",
        "# a comment\n// another\nlat lon height\n2 1.5 3.25\n# end\n5 4 6\n",
        "2\n1.5 2 3.25\n4 5 6\n",
        "\"1.5\",'2',\"3.25\"\n\"4\",5,6\n",
        "+15e-1,2.000000000000000000,325E-2\n4.,5,0.6e+1\n",
    ];
    for layout in layouts {
        let cloud = text(layout).unwrap_or_else(|error| panic!("{layout:?}: {error}"));
        assert_eq!(coordinates(&cloud), [[1.5, 2.0, 3.25], [4.0, 5.0, 6.0]], "{layout:?}: {:?}", cloud.counts.examples);
        assert_eq!(cloud.counts.malformed, 0, "{layout:?}");
    }
}

#[test]
fn colors_and_classes_of_texts_are_read() {
    let cloud = text("r,g,b,class,z,y,x\n1,2,3,9,30,20,10\n255.0,0,65535,2,31,21,11\n").unwrap();
    assert!(cloud.source.has_rgb && cloud.source.has_class);
    let found: Vec<_> = cloud.points.iter().map(|p| (p.rgb, p.class)).collect();
    assert_eq!(found, [([1, 2, 3], 9), ([255, 0, 65535], 2)]);
}

#[test]
fn options_overrule_detection() {
    let path = file(".csv", b"a|b|c|d\n%skip\n9|1|2|3\n8|4|5|6\n");
    let columns = Some(["_", "y", "x", "z"].map(String::from).to_vec());
    let options = TextOptions { delimiter: Some('|'), header: Some(true), columns, comment: Some("%".to_string()) };
    assert_eq!(coordinates(&read_with(&path, &options).unwrap()), [[2.0, 1.0, 3.0], [5.0, 4.0, 6.0]]);
    for (columns, words) in [(["x", "x", "y", "z"], "2 columns x"), (["x", "y", "a", "b"], "no column z")] {
        let options = TextOptions { columns: Some(columns.map(String::from).to_vec()), ..options.clone() };
        let error = read_with(&path, &options).err().unwrap();
        assert!(error.kind() == ErrorKind::Usage && error.to_string().contains(words), "{error}");
    }
    let delimiter = TextOptions { delimiter: Some('7'), ..TextOptions::default() };
    let comment = TextOptions { comment: Some("7".to_string()), ..TextOptions::default() };
    for options in [delimiter, comment] {
        assert_eq!(read_with(&path, &options).err().unwrap().kind(), ErrorKind::Usage);
    }
    let path = file(".csv", b"-- x y z\n-1 2 3\n");
    let options = TextOptions { comment: Some("--".to_string()), ..TextOptions::default() };
    assert_eq!(coordinates(&read_with(&path, &options).unwrap()), [[-1.0, 2.0, 3.0]]);
}

#[test]
fn malformed_lines_are_counted_and_named() {
    let long = "1".repeat(100_000);
    let content = format!("x,y,z\n1,2,3\n4,five,6\n7,8\n# fine\nnan,1,2\n{long}\n1,inf,2\n9,9,9\n1e300,0,0\n");
    let cloud = text(&content).unwrap();
    assert_eq!((cloud.counts.kept, cloud.counts.malformed), (2, 6));
    for (example, words) in cloud.counts.examples.iter().zip([
        "line 3: column 2 (y) is \"five\", not a number",
        "line 4: column 3 (z) is missing",
        "line 6: column 1 (x) is \"nan\"",
        "line 7 has more than 65536 bytes",
        "line 8: column 2 (y) is \"inf\"",
    ]) {
        assert!(example.contains(words), "{example}");
    }
    let orders: Vec<u64> = cloud.points.iter().map(Point::order).collect();
    assert_eq!(orders, [0, 6]);
}

#[test]
fn a_file_that_is_not_a_table_is_refused() {
    for (content, words) in [
        ("", "is empty"),
        ("\n\n# nothing\n", "no line with numbers"),
        ("hello world\nnothing here\n", "names no column x"),
        ("a\0b", "neither LAS nor LAZ nor UTF-8"),
        ("x,y\n1,2\n", "names no column z"),
        ("1,5;2,5\n1,5;2,5\n", "a point before their decimals"),
        ("1 2 3\r4 5 6\r", "carriage return"),
        ("565,000;933,012;12\n565,001;933,011;13\n", "between thousands"),
    ] {
        let error = text(content).err().unwrap_or_else(|| panic!("{content:?} was read"));
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains(words), "{content:?}: {error}");
    }
    let error = read_bytes(".laz", b"LAZF and so on").err().unwrap();
    assert!(error.to_string().contains("LASF"), "{error}");
    assert_eq!(read(Path::new("/nowhere/at/all.las")).err().unwrap().kind(), ErrorKind::Retry);
}

#[test]
fn noise_beyond_fifteen_decimals_is_rounded_and_counted() {
    let cloud = text("0.30000000000000004,1,2\n0.5,1,2.5\n").unwrap();
    assert_eq!(cloud.source.axes[0].scale, Decimal::new(1, 1));
    assert_eq!((cloud.counts.rounded_xy, cloud.counts.rounded_z), (1, 0));
}

#[test]
fn a_text_of_many_chunks_keeps_its_order() {
    let mut content = String::from("x y z\n");
    for i in 0..300_000 {
        content.push_str(&format!("{} {} {}.{:02}\n", i, i % 1000, i / 100, i % 100));
    }
    let cloud = text(&content).unwrap();
    assert!(cloud.source.chunks() > 1);
    assert_eq!((cloud.counts.kept, cloud.counts.malformed), (300_000, 0));
    assert!(cloud.points.iter().enumerate().all(|(i, p)| p.order() == i as u64 && p.z == i as i32));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_texts_never_panic(content in proptest::collection::vec(any::<u8>(), 0..300)) {
        survives(".csv", &content);
    }

    #[test]
    fn texts_of_likely_characters_never_panic(content in "[xyzrgb0-9,;. \"'#\\-\\n\\r\\te]{0,200}") {
        survives(".csv", content.as_bytes());
    }
}
