//! Real files, sound and broken, against what is known about them.

use std::collections::BTreeMap;

use crs::Unit;
use points::{Point, PointCounts, TextOptions, open};
use rayon::prelude::*;

use crate::cloud::{Cloud, lattice, read, rules};
use crate::common;
use sys::ErrorKind;

/// What is known about a real file: name, bounds of x, y, z, points by class, greatest colour.
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

/// Returns the least and greatest x, y, z of the points.
fn bounds(cloud: &Cloud) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        let lattice = |point: &Point| if axis == 2 { point.z } else { point.position[axis] };
        let values = cloud.points.iter().map(lattice);
        [values.clone().min(), values.max()].map(|value| cloud.lattice.world(axis, value.unwrap()))
    })
}

/// Returns the number of points of each class.
fn classes(cloud: &Cloud) -> BTreeMap<u8, usize> {
    let mut classes = BTreeMap::new();
    for point in &cloud.points {
        *classes.entry(point.class).or_default() += 1;
    }
    classes
}

#[test]
fn real_files_hold_what_is_known_about_them() {
    let Some(shared) = common::shared() else { return };
    for (name, known_bounds, known_classes, max_rgb) in KNOWN {
        let cloud = read(&shared.join("data").join(name)).unwrap();
        assert_eq!(cloud.counts.malformed, 0, "{name}: {:?}", cloud.counts.examples);
        assert_eq!(classes(&cloud), known_classes.iter().copied().collect(), "{name}");
        assert_eq!(cloud.counts.max_rgb, max_rgb, "{name}");
        for (axis, (own, known)) in bounds(&cloud).iter().zip(&known_bounds).enumerate() {
            for (own, known) in own.iter().zip(known) {
                assert!((own - known).abs() < 1e-9 * known.abs().max(1.0), "{name}: axis {axis}: {own}, known {known}");
            }
        }
        let orders: Vec<u64> = cloud.points.iter().map(Point::order).collect();
        assert!(orders.iter().copied().eq(0..cloud.counts.read), "{name}: the orders are not those of the records");
    }
}

#[test]
fn many_threads_decode_all_of_the_big_file() {
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
    let counts = (0..source.chunks()).into_par_iter().map(decode).reduce(PointCounts::default, sum);
    assert_eq!((counts.kept, counts.malformed, counts.max_rgb), (10_653_336, 0, 255));
    assert_eq!((source.records, source.crs.horizontal), (10_653_336, Unit::Foot));
}

#[test]
fn records_are_the_same_as_those_of_the_las_crate() {
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
fn coordinate_systems_of_real_files_are_read() {
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
    assert!(crs("autzen.laz").differences(&crs("autzen_trim.las")).is_empty());
    assert!(crs("crop.laz").differences(&crs("Topography.laz")).is_empty());
    assert!(!crs("append-bug.laz").differences(&crs("Topography.laz")).is_empty());
}

#[test]
fn bad_files_are_read_as_far_as_possible_or_refused() {
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
        assert_eq!((cloud.counts.kept, cloud.counts.malformed), (kept, malformed), "{name}");
        assert!(words.is_empty() == cloud.counts.examples.is_empty(), "{name}");
        let known_missing = if words.contains("missing") { malformed } else { 0 };
        assert_eq!(cloud.source.missing, known_missing, "{name}");
        assert!(words.is_empty() || cloud.counts.examples[0].contains(words), "{name}: {:?}", cloud.counts.examples);
    }
    for (name, words) in [("git-lfs-pointer.laz", "git lfs pull"), ("badheader.txt", "names 2 columns x")] {
        let error = bad(name).err().unwrap();
        assert!(error.kind() == ErrorKind::Input && error.to_string().contains(words), "{name}: {error}");
    }
    let prefix = bad("truncated-mid-chunk.laz").unwrap().points;
    let whole = read(&shared.join("data/Topography.laz")).unwrap().points;
    assert_eq!(prefix, whole[..prefix.len()]);
}
