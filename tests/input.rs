//! Point clouds of every kind in: real ones against what is known of them and against another reader, made-up ones of
//! every point format, and broken ones.

#[path = "common/cloud.rs"]
mod cloud;
mod common;
#[path = "common/las_file.rs"]
mod las_file;

use std::collections::BTreeMap;
use std::path::PathBuf;

use cloud::{Cloud, decode, file, lattice, read, read_bytes, rules, survives};
use gdt_batch::Error;
use gdt_batch::geometry::lattice::REACH;
use gdt_batch::input::{Point, PointCounts, TextOptions, Unit, open};
use las_file::{LasFile, points_at};
use proptest::prelude::*;
use rayon::prelude::*;

/// What is known of a real file: name, bounds of x, y, z, points by class, greatest colour.
type Known = (&'static str, [[f64; 2]; 3], &'static [(u8, usize)], u16);

const AUTZEN: [[f64; 2]; 3] = [[635619.85, 638982.55], [848899.7, 853535.43], [406.59, 586.38]];
const TOPOGRAPHY: [[f64; 2]; 3] = [[273357.14475, 273642.8565], [5274357.1435, 5274642.8475], [788.99325, 829.75825]];

const KNOWN: [Known; 20] = [
    (
        "autzen_trim.las",
        [[636001.76, 637179.22], [848935.2, 849497.9], [406.26, 520.51]],
        &[(1, 83893), (2, 26107)],
        236,
    ),
    ("1.2-with-color.las", AUTZEN, &[(1, 789), (2, 276)], 249),
    ("1.2-with-color.copc.laz", AUTZEN, &[(1, 789), (2, 276)], 249),
    ("extrabytes.las", AUTZEN, &[(1, 789), (2, 276)], 249),
    ("bad/simple-laszip-compressor-version-1.2r0.laz", AUTZEN, &[(1, 789), (2, 276)], 249),
    ("100-points.las", [[635717.85, 638944.95], [848953.74, 853483.3], [409.19, 530.61]], &[(1, 73), (2, 27)], 229),
    ("Topography.laz", TOPOGRAPHY, &[(1, 61347), (2, 8159), (9, 3897)], 0),
    ("topography.csv", TOPOGRAPHY, &[(0, 73403)], 0),
    ("crop.laz", [[84600.0, 84699.998], [447000.0, 447099.999], [-0.391, 14.46]], &[(2, 140576), (6, 71974)], 0),
    ("crop_1.laz", [[84600.0, 84649.999], [447000.001, 447099.998], [-0.391, 14.46]], &[(2, 34122), (6, 64818)], 0),
    ("crop_2.laz", [[84650.0, 84699.998], [447000.0, 447099.999], [-0.008, 14.301]], &[(2, 106454), (6, 7156)], 0),
    (
        "file_with_both_wkt_and_geotiff_vlrs.las",
        [[2445180.0, 2445239.99], [604300.0, 604339.98], [1352.7, 1403.96]],
        &[(2, 9808), (3, 158), (4, 724), (5, 10956), (6, 3737), (7, 25)],
        0,
    ),
    (
        "append-bug.laz",
        [[698000.0, 699000.0], [6259242.79, 6260000.0], [11.72, 266.03]],
        &[(1, 355), (2, 22859), (3, 929), (4, 1816), (5, 9974), (17, 1333), (65, 539)],
        65280,
    ),
    ("simple1_4.las", [[1.0, 226.0], [1.0, 100.0], [44.0, 254.0]], &[(0, 22600)], 65024),
    (
        "autzen-dd.las",
        [[-123.0749695, -123.0625001], [44.0500086, 44.0624972], [123.93, 178.73]],
        &[(1, 789), (2, 276)],
        249,
    ),
    ("dbh.laz", [[101.101, 101.695], [151.869, 152.748], [4.129, 4.227]], &[(1, 1369)], 0),
    (
        "warsaw_small.las",
        [[639913.26, 639946.75], [485143.14, 485175.91], [84.7, 104.55]],
        &[(0, 433), (2, 1381), (3, 257), (4, 27), (5, 902)],
        53760,
    ),
    (
        "32-1-472-150-76.laz",
        [[326400.01, 327199.99], [6724172.52, 6724199.99], [-0.37, 202.74]],
        &[(1, 3648), (2, 1461), (7, 30), (9, 519)],
        0,
    ),
    ("utm15.las", [[470692.44, 470692.44], [4602888.9, 4602888.9], [16.0, 16.0]], &[(2, 1)], 255),
    ("data.xyz", [[440750.0, 441890.0], [3750150.0, 3751290.0], [74.0, 255.0]], &[(0, 400)], 0),
];

/// Least and greatest x, y, z of the points.
fn bounds(cloud: &Cloud) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        let lattice = |point: &Point| if axis == 2 { point.z } else { point.position[axis] };
        let values = cloud.points.iter().map(lattice);
        [values.clone().min(), values.max()].map(|value| cloud.lattice.world(axis, value.unwrap()))
    })
}

/// The number of points of each class.
fn classes(cloud: &Cloud) -> BTreeMap<u8, usize> {
    let mut classes = BTreeMap::new();
    for point in &cloud.points {
        *classes.entry(point.class).or_default() += 1;
    }
    classes
}

#[test]
fn real_files_hold_what_is_known_of_them() {
    let Some(shared) = common::shared() else { return };
    for (name, known_bounds, known_classes, max_rgb) in KNOWN {
        let cloud = read(&shared.join("data").join(name)).unwrap();
        assert_eq!(cloud.tally.malformed, 0, "{name}: {:?}", cloud.tally.examples);
        assert_eq!(classes(&cloud), known_classes.iter().copied().collect(), "{name}");
        assert_eq!(cloud.tally.max_rgb, max_rgb, "{name}");
        for (axis, (own, known)) in bounds(&cloud).iter().zip(&known_bounds).enumerate() {
            for (own, known) in own.iter().zip(known) {
                assert!((own - known).abs() < 1e-9 * known.abs().max(1.0), "{name}: axis {axis}: {own}, known {known}");
            }
        }
        let orders: Vec<u64> = cloud.points.iter().map(Point::order).collect();
        assert!(orders.iter().copied().eq(0..cloud.tally.read), "{name}: the orders are not those of the records");
    }
}

#[test]
fn the_big_file_is_whole_when_many_threads_decode_it() {
    let Some(shared) = common::shared() else { return };
    let source = open(&shared.join("data/autzen.laz"), &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    let decode = |chunk: usize| {
        let mut order = None;
        let check = &mut |points: &[Point]| {
            assert!(points.windows(2).all(|pair| pair[0].order() + 1 == pair[1].order()));
            assert!(order.is_none_or(|last| last + 1 == points[0].order()));
            order = points.last().map(Point::order);
            Ok(())
        };
        source.decode(chunk, &rules, check).unwrap()
    };
    let sum = |mut a: PointCounts, b: PointCounts| {
        a += b;
        a
    };
    let tally = (0..source.chunks()).into_par_iter().map(decode).reduce(PointCounts::default, sum);
    assert_eq!((tally.kept, tally.malformed, tally.max_rgb), (10_653_336, 0, 255));
    assert_eq!((source.records, source.crs.horizontal), (10_653_336, Unit::Foot));
}

#[test]
fn records_are_those_the_las_crate_reads() {
    let Some(shared) = common::shared() else { return };
    let names =
        ["Topography.laz", "crop_1.laz", "append-bug.laz", "dbh.laz", "1.2-with-color.copc.laz", "extrabytes.las"];
    for name in names.into_iter().chain(["32-1-472-150-76.laz", "simple1_4.las", "warsaw_small.las", "autzen_trim.las"])
    {
        let path = shared.join("data").join(name);
        let cloud = read(&path).unwrap();
        let rules = rules(&cloud.source, &cloud.lattice);
        let mut reader = las::Reader::from_path(&path).unwrap();
        let data = reader.read_all().unwrap();
        let lattice = |axis: usize, raw: i32| rules.maps[axis].apply(raw as i64).unwrap().0;
        let position = data.x_raw().zip(data.y_raw()).zip(data.z_raw());
        let mut rgb: Box<dyn Iterator<Item = (u16, u16, u16)>> = match data.rgb() {
            Some(colors) => Box::new(colors),
            None => Box::new(std::iter::repeat((0, 0, 0))),
        };
        assert_eq!(data.len(), cloud.points.len(), "{name}");
        for ((((x, y), z), class), point) in position.zip(data.classification()).zip(&cloud.points) {
            let expected =
                ([lattice(0, x), lattice(1, y)], lattice(2, z), class, <[u16; 3]>::from(rgb.next().unwrap()));
            assert_eq!((point.position, point.z, point.class, point.rgb), expected, "{name}: record {}", point.order());
        }
    }
}

#[test]
fn coordinate_systems_are_those_of_the_files() {
    let Some(shared) = common::shared() else { return };
    let crs = |name: &str| open(&shared.join("data").join(name), &TextOptions::default()).unwrap().crs;
    let us_foot = Some(Unit::US_FOOT);
    for (name, epsg, unit, vertical) in [
        ("autzen.laz", None, Unit::Foot, None),
        ("Topography.laz", Some(2949), Unit::Metre, None),
        ("append-bug.laz", Some(2154), Unit::Metre, None),
        ("1.2-with-color.copc.laz", Some(2991), Unit::Metre, us_foot),
        ("file_with_both_wkt_and_geotiff_vlrs.las", None, Unit::UsFoot, None),
        ("autzen-dd.las", Some(4326), Unit::Degree, None),
        ("crop.laz", None, Unit::Unknown, None),
        ("warsaw_small.las", None, Unit::Unknown, None),
        ("32-1-472-150-76.laz", Some(25832), Unit::Metre, Some(1.0)),
    ] {
        let crs = crs(name);
        assert_eq!((crs.epsg, crs.horizontal), (epsg, unit), "{name}");
        let close = |a: f64, b: f64| (a - b).abs() < 1e-8;
        assert!(
            crs.vertical == vertical || close(crs.vertical.unwrap(), vertical.unwrap()),
            "{name}: {:?}",
            crs.vertical
        );
    }
    assert!(crs("autzen.laz").same_as(&crs("autzen_trim.las")));
    assert!(crs("crop.laz").same_as(&crs("Topography.laz")));
    assert!(!crs("append-bug.laz").same_as(&crs("Topography.laz")));
}

#[test]
fn bad_files_are_read_as_far_as_they_go_or_refused() {
    let Some(shared) = common::shared() else { return };
    let bad = |name: &str| read(&shared.join("data/bad").join(name));
    for (name, kept, malformed, words) in [
        ("garbage_nVariableLength.las", 718, 1, "1 are missing"),
        ("bad_vlr_count.las", 10, 0, ""),
        ("1.2-with-color-clipped.las", 1064, 1, "1 are missing"),
        ("1.2-no-points.las", 0, 1065, "1065 are missing"),
        ("simple-laszip-compressor-version-1.2r0.laz", 1065, 0, ""),
        ("truncated-mid-chunk.laz", 44372, 29031, "29031 points are lost"),
    ] {
        let cloud = bad(name).unwrap();
        assert_eq!((cloud.tally.kept, cloud.tally.malformed), (kept, malformed), "{name}");
        assert!(words.is_empty() == cloud.tally.examples.is_empty(), "{name}");
        let known_missing = if words.contains("missing") { malformed } else { 0 };
        assert_eq!(cloud.source.missing, known_missing, "{name}");
        assert!(words.is_empty() || cloud.tally.examples[0].contains(words), "{name}: {:?}", cloud.tally.examples);
    }
    for (name, words) in [("git-lfs-pointer.laz", "git lfs pull"), ("badheader.txt", "names 2 columns x")] {
        let error = bad(name).err().unwrap();
        assert!(error.exit_code() == 3 && error.to_string().contains(words), "{name}: {error}");
    }
    let prefix = bad("truncated-mid-chunk.laz").unwrap().points;
    let whole = read(&shared.join("data/Topography.laz")).unwrap().points;
    assert_eq!(prefix, whole[..prefix.len()]);
}

/// The points that a file made by `LasFile::new` must give.
fn expected(file: &LasFile, cloud: &Cloud) -> Vec<Point> {
    let rules = rules(&cloud.source, &cloud.lattice);
    let rgb_at = match file.format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    };
    let mut points = Vec::new();
    for (order, bytes) in file.records.chunks_exact(file.length() as usize).enumerate() {
        if order % 17 == 3 {
            continue;
        }
        let raw = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as i64;
        let [x, y, z] = [0, 1, 2].map(|axis| rules.maps[axis].apply(raw(4 * axis)).unwrap().0);
        let color = |at: usize| u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap());
        let rgb = rgb_at.map_or([0; 3], |at| [color(at), color(at + 2), color(at + 4)]);
        let class = if file.format >= 6 { (order % 70) as u8 } else { (order % 19) as u8 };
        points.push(Point::new([x, y], z, rgb, class, order as u64));
    }
    points
}

fn assert_reads(file: &LasFile, name: &str, bytes: &[u8]) -> Cloud {
    let cloud = read_bytes(".laz", bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(cloud.tally.malformed, 0, "{name}: {:?}", cloud.tally.examples);
    assert!(cloud.points == expected(file, &cloud), "{name}: points differ");
    cloud
}

#[test]
fn every_point_format_is_read_plain_and_compressed() {
    for format in 0..=10 {
        for extra in [0, 5] {
            let minor = if format >= 6 {
                4
            } else if format >= 4 {
                3
            } else {
                2
            };
            let mut file = LasFile::new(minor, format, extra, 500);
            file.stray = 3;
            let name = format!("format {format}, {extra} extra bytes");
            assert_reads(&file, &name, &file.las());
            assert_reads(&file, &name, &file.laz(&[120], false));
            assert_reads(&file, &name, &file.laz(&[7, 300, 1, 192], true));
            file.minor = 4;
            assert_reads(&file, &name, &file.las());
        }
    }
}

#[test]
fn files_without_points_have_no_pieces() {
    for format in [1, 7] {
        let file = LasFile::new(4, format, 0, 0);
        for bytes in [file.las(), file.laz(&[50], false), file.laz(&[50], true)] {
            let cloud = read_bytes(".laz", &bytes).unwrap();
            assert_eq!((cloud.source.records, cloud.source.chunks(), cloud.tally.read), (0, 0, 0));
        }
    }
}

#[test]
fn chunks_are_found_without_their_table() {
    let unfinished = |mut bytes: Vec<u8>| {
        let at = points_at(&bytes);
        bytes[at..at + 8].copy_from_slice(&(-1i64).to_le_bytes());
        bytes
    };
    for (format, minor) in [(3, 2), (7, 4)] {
        let file = LasFile::new(minor, format, 2, 1000);
        let cloud = assert_reads(&file, "fixed", &unfinished(file.laz(&[300], false)));
        assert!(cloud.source.warnings[0].contains("chunks is missing"), "{:?}", cloud.source.warnings);
    }
    let layered = LasFile::new(4, 7, 0, 1000);
    assert_reads(&layered, "layered, variable", &unfinished(layered.laz(&[10, 400, 590], true)));
    let pointwise = LasFile::new(2, 3, 0, 1000);
    let error = read_bytes(".laz", &unfinished(pointwise.laz(&[10, 400, 590], true))).err().unwrap();
    assert!(error.exit_code() == 3 && error.to_string().contains("lost the table"), "{error}");
}

#[test]
fn a_wrong_table_is_not_trusted() {
    for (format, minor) in [(3, 2), (7, 4)] {
        let file = LasFile::new(minor, format, 0, 1000);
        let sound = file.laz(&[300], false);
        let at = points_at(&sound);
        let table = u64::from_le_bytes(sound[at..at + 8].try_into().unwrap()) as usize;
        let mut too_many = sound.clone();
        too_many[table + 4..table + 8].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut too_far = sound.clone();
        too_far[table + 8..].fill(0x5a);
        for (bytes, words) in [(too_many, "claims 4294967295 chunks"), (too_far, "beyond the points")] {
            let cloud = assert_reads(&file, words, &bytes);
            assert!(cloud.source.warnings[0].contains(words), "{:?}", cloud.source.warnings);
        }
    }
}

#[test]
fn a_damaged_chunk_costs_its_own_points_alone() {
    let file = LasFile::new(4, 7, 0, 1000);
    let mut bytes = file.laz(&[300], false);
    let whole = read_bytes(".laz", &bytes).unwrap().points;
    // The first layer of the first chunk, after its first point and its number of points, becomes far too long.
    let at = points_at(&bytes) + 8 + file.length() as usize + 4;
    bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let cloud = read_bytes(".laz", &bytes).unwrap();
    assert!(cloud.tally.malformed == 300 && cloud.tally.examples[0].contains("chunk 0 is damaged"));
    let rest: Vec<Point> = whole.into_iter().filter(|point| point.order() >= 300).collect();
    assert_eq!(cloud.points, rest);
}

#[test]
fn the_position_of_the_table_may_be_at_the_end() {
    let file = LasFile::new(4, 6, 0, 1000);
    let mut bytes = file.laz(&[300], false);
    let at = points_at(&bytes);
    let position: [u8; 8] = bytes[at..at + 8].try_into().unwrap();
    bytes[at..at + 8].copy_from_slice(&(-1i64).to_le_bytes());
    bytes.extend(position);
    let cloud = assert_reads(&file, "table position at the end", &bytes);
    assert!(cloud.source.warnings.is_empty());
}

#[test]
fn a_laz_cut_anywhere_gives_the_points_before_the_cut() {
    for (format, minor) in [(3, 2), (7, 4)] {
        let file = LasFile::new(minor, format, 0, 1000);
        let bytes = file.laz(&[300], false);
        let whole = read_bytes(".laz", &bytes).unwrap().points;
        for cut in (points_at(&bytes)..bytes.len() - 1).step_by(bytes.len() / 23) {
            let cloud = read_bytes(".laz", &bytes[..cut]).unwrap();
            assert_eq!(cloud.points, whole[..cloud.points.len()], "format {format}, cut at {cut}");
            assert!(cloud.tally.malformed > 0 && cloud.points.len() < whole.len(), "format {format}, cut at {cut}");
        }
    }
}

#[test]
fn class_bounds_order_and_color_rules_hold() {
    let path = file(".las", &LasFile::new(2, 2, 0, 1000).las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let mut rules = rules(&source, &lattice(&source));
    let (all, _) = decode(&source, &rules).unwrap();
    rules.classes = std::array::from_fn(|class| class == 5 || class == 6);
    rules.bounds = Some([-1000, -2000, 3000, 4000]);
    (rules.first_order, rules.rgb) = (1 << 36, false);
    let (some, tally) = decode(&source, &rules).unwrap();
    let inside = |p: &Point| (-1000..=3000).contains(&p.position[0]) && (-2000..=4000).contains(&p.position[1]);
    let wanted = all.iter().filter(|p| (p.class == 5 || p.class == 6) && inside(p));
    let wanted: Vec<Point> =
        wanted.map(|p| Point::new(p.position, p.z, [0; 3], p.class, p.order() + (1 << 36))).collect();
    assert_eq!(some, wanted);
    assert!(tally.withheld > 0 && tally.other_class > 0 && tally.out_of_bounds > 0, "{tally:?}");
}

#[test]
fn points_outside_the_lattice_are_malformed_and_named() {
    let mut made = LasFile::new(2, 0, 0, 10);
    made.records[4 * 20..4 * 20 + 4].copy_from_slice(&i32::MAX.to_le_bytes());
    let path = file(".las", &made.las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let lattice = lattice(&source);
    let mut rules = rules(&source, &lattice);
    let (_, tally) = decode(&source, &rules).unwrap();
    assert_eq!((tally.malformed, tally.examples.len()), (1, 1));
    assert!(tally.examples[0].contains("point 4: x = 21974836.47 lies outside"), "{}", tally.examples[0]);
    rules.bounds = Some([-REACH, -REACH, REACH, REACH]);
    let (_, tally) = decode(&source, &rules).unwrap();
    assert_eq!((tally.malformed, tally.out_of_bounds), (0, 1));
}

#[test]
fn every_wrong_header_field_is_named() {
    let double = |value: f64| value.to_le_bytes().to_vec();
    let table: Vec<(usize, Vec<u8>, &str)> = vec![
        (24, vec![2], "version 2.4"),
        (25, vec![9], "version 1.9"),
        (94, vec![100, 0], "header has 100 bytes"),
        (96, vec![0, 0, 0, 0], "points begin at byte 0"),
        (96, vec![0xff, 0xff, 0xff, 0x7f], "points begin at byte 2147483647"),
        (104, vec![11], "format 11"),
        (104, vec![6 | 0x80], "no LASzip record"),
        (105, vec![29, 0], "format 6 needs 30"),
        (131, double(0.0), "scale of x"),
        (139, double(-0.01), "scale of y"),
        (147, double(f64::NAN), "scale of z"),
        (131, double(f64::INFINITY), "scale of x"),
        (131, double(1e-300), "scale of x"),
        (155, double(f64::NAN), "offset of x"),
        (163, double(1e300), "offset of y"),
        (171, double(f64::NEG_INFINITY), "offset of z"),
        (179, double(f64::NAN), "bounds"),
        (219, double(f64::INFINITY), "bounds"),
        (247, vec![0xff; 8], "18446744073709551615 points"),
    ];
    let sound = LasFile::new(4, 6, 0, 50).las();
    for (at, value, words) in table {
        let mut bytes = sound.clone();
        bytes[at..at + value.len()].copy_from_slice(&value);
        let error = read_bytes(".las", &bytes).err().unwrap_or_else(|| panic!("{words}: was read"));
        assert_eq!(error.exit_code(), 3, "{words}");
        assert!(error.to_string().contains(words), "{words}: {error}");
    }
    for length in [0, 1, 3, 4, 100, 226, 227, 374] {
        let error = read_bytes(".las", &sound[..length]).err().unwrap();
        assert_eq!(error.exit_code(), 3, "{length} bytes: {error}");
    }
}

#[test]
fn odd_headers_are_read_all_the_same() {
    let made = LasFile::new(4, 6, 0, 50);
    let sound = made.las();
    let patched = |at: usize, value: &[u8]| {
        let mut bytes = sound.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        bytes
    };
    // A wrong 32-bit count beside the right one, bounds that are wrong, records promised that are not there.
    let cloud = assert_reads(&made, "legacy count", &patched(107, &7u32.to_le_bytes()));
    assert!(cloud.source.warnings[0].contains("differ"));
    assert_reads(&made, "bounds", &patched(179, &1.5f64.to_le_bytes()));
    let cloud = assert_reads(&made, "records", &patched(100, &u32::MAX.to_le_bytes()));
    assert!(cloud.source.warnings[0].contains("only 0 fit"));
    let cloud = assert_reads(&made, "extended", &patched(235, &[0xff; 12]));
    assert!(cloud.source.warnings[0].contains("only 0 are there"));
    let legacy = [&patched(247, &[0; 8])[..107], &50u32.to_le_bytes(), &patched(247, &[0; 8])[111..]].concat();
    assert_reads(&made, "only a 32-bit count", &legacy);
    let cloud = read_bytes(".las", &patched(247, &1000u64.to_le_bytes())).unwrap();
    assert_eq!((cloud.tally.malformed, cloud.points), (950, expected(&made, &assert_reads(&made, "sound", &sound))));
}

#[test]
fn a_file_that_changes_while_in_use_is_an_error() {
    let bytes = LasFile::new(2, 1, 0, 1000).laz(&[300], false);
    let path = file(".laz", &bytes);
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let error = source.decode(0, &rules, &mut |_| Ok(())).unwrap_err();
    assert!(error.exit_code() == 1 && error.to_string().contains("has changed"), "{error}");
    let gone = PathBuf::from(&path);
    drop(path);
    let error = source.decode(0, &rules, &mut |_| Ok(())).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if *path == gone) && error.exit_code() == 1, "{error}");
}

#[test]
fn what_the_sink_refuses_stops_the_decoding() {
    let path = file(".las", &LasFile::new(2, 1, 0, 1000).las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    let refuse = &mut |_: &[Point]| Err(Error::Memory("none left".to_string()));
    assert_eq!(source.decode(0, &rules, refuse).unwrap_err().exit_code(), 1);
}

#[test]
fn descriptions_say_what_a_file_holds() {
    let path = file(".laz", &LasFile::new(4, 7, 0, 100).laz(&[40], false));
    let description = gdt_batch::input::info::describe(&open(&path, &TextOptions::default()).unwrap());
    let json = serde_json::to_value(&description).unwrap();
    assert_eq!(
        (json["points"].as_u64(), json["version"].as_str(), json["format"].as_str()),
        (Some(100), Some("1.4"), Some("laz"))
    );
    assert!(description.to_string().contains("LAZ 1.4, point format 7"), "{description}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn wrong_bytes_in_a_laz_never_panic(
        format in 0usize..11,
        variable in any::<bool>(),
        wrong in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let minor = if format >= 6 { 4 } else { 2 };
        let mut bytes = LasFile::new(minor, format as u8, 1, 200).laz(&[60, 70, 70], variable);
        for (at, value) in wrong {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        survives(".laz", &bytes);
    }

    #[test]
    fn a_random_header_never_panics(random in proptest::collection::vec(any::<u8>(), 500), keep in any::<u64>()) {
        let mut bytes = LasFile::new(4, 6, 0, 20).las();
        for (at, value) in random.iter().enumerate().take(375).skip(24) {
            if keep >> (at % 64) & 1 == 0 && at % 3 == 0 {
                bytes[at] = *value;
            }
        }
        survives(".las", &bytes);
    }
}
