//! The rules of a job: which points are kept, and where they land on the lattice.

use delaunay::geometry::REACH;
use lattice::Lattice;
use points::{OptionalFields, Point, RawBounds, TextOptions, open};
use sys::{Error, ErrorKind};

use crate::cloud::{decode, file, lattice, rules};
use crate::las_file::LasFile;

#[test]
fn class_bounds_order_color_and_intensity_rules_hold() {
    let path = file(".las", &LasFile::new(2, 2, 0, 1000).las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let lattice = lattice(&source);
    let mut rules = rules(&source, &lattice);
    let (all, _) = decode(&source, &rules).unwrap();
    let world = |axis: usize, steps: i32| lattice.world(axis, steps);
    // The middle of the spiral.
    let [x, y] = [50_000_000, 400_000_000];
    let (low, high) = ([world(0, x - 1000), world(1, y - 2000)], [world(0, x + 3000), world(1, y + 4000)]);
    let corners = [low[0] - 0.004, low[1] - 0.004, high[0] + 0.004, high[1] + 0.004];
    rules.classes = std::array::from_fn(|class| class == 5 || class == 6);
    rules.bounds = source.raw_bounds(corners);
    (rules.first_order, rules.fields) = (1 << 36, OptionalFields { rgb: false, intensity: true });
    let (some, counts) = decode(&source, &rules).unwrap();
    let inside =
        |p: &Point| (-1000..=3000).contains(&(p.position[0] - x)) && (-2000..=4000).contains(&(p.position[1] - y));
    let wanted = all.iter().filter(|p| (p.class == 5 || p.class == 6) && inside(p));
    let as_wanted = |p: &Point| {
        let intensity = (p.order() * 7 % 3000) as u16;
        Point::new(p.position, p.z, [0; 3], p.class, p.order() + (1 << 36)).with_intensity(intensity)
    };
    let wanted: Vec<Point> = wanted.map(as_wanted).collect();
    assert!(all.iter().all(|p| p.intensity == 0) && !wanted.is_empty());
    assert_eq!(some, wanted);
    assert!(counts.withheld > 0 && counts.other_class > 0 && counts.out_of_bounds > 0, "{counts:?}");
    rules.numbered = false;
    let without_number = |p: &Point| Point::new(p.position, p.z, p.rgb, p.class, 0).with_intensity(p.intensity);
    let (some, _) = decode(&source, &rules).unwrap();
    assert_eq!(some, wanted.iter().map(without_number).collect::<Vec<_>>());
}

#[test]
fn points_outside_the_lattice_are_malformed_and_named() {
    let mut made = LasFile::new(2, 0, 0, 10);
    made.records[4 * 20..4 * 20 + 4].copy_from_slice(&i32::MAX.to_le_bytes());
    let path = file(".las", &made.las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let lattice = lattice(&source);
    let mut rules = rules(&source, &lattice);
    let (_, counts) = decode(&source, &rules).unwrap();
    assert_eq!((counts.malformed, counts.examples.len()), (1, 1));
    assert!(counts.examples[0].contains("point 4: x = 21974836.47 lies outside"), "{}", counts.examples[0]);
    rules.bounds = source.raw_bounds([-1e7, -1e7, 1e7, 1e7]);
    let (_, counts) = decode(&source, &rules).unwrap();
    assert_eq!((counts.malformed, counts.out_of_bounds), (0, 1));
}

#[test]
fn an_error_of_the_sink_stops_the_decoding() {
    let path = file(".las", &LasFile::new(2, 1, 0, 1000).las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    let refuse = &mut |_: &[Point]| Err(Error::Memory("none left".to_string()));
    assert_eq!(source.decode(0, &rules, refuse).unwrap_err().kind(), ErrorKind::Retry);
}

#[test]
fn the_least_lattice_integer_is_outside_the_lattice() {
    let mut made = LasFile::new(2, 0, 0, 3);
    for (record, raw) in [i32::MIN, -REACH - 1, -REACH].into_iter().enumerate() {
        made.records[20 * record..][..4].copy_from_slice(&raw.to_le_bytes());
    }
    let path = file(".las", &made.las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let [x, y, z] = source.axes;
    let lattice = Lattice { offset: [x.offset, y.offset, z.offset], resolution: x.scale, resolution_z: z.scale };
    let (points, counts) = decode(&source, &rules(&source, &lattice)).unwrap();
    assert_eq!((points.len(), counts.malformed), (1, 2));
    assert_eq!(points[0].position[0], -REACH);
}

#[test]
fn bounds_without_a_lattice_point_keep_no_point() {
    let path = file(".las", &LasFile::new(2, 0, 0, 100).las());
    let source = open(&path, &TextOptions::default()).unwrap();
    let mut rules = rules(&source, &lattice(&source));
    rules.bounds = Some(RawBounds { min: [5, i64::MIN], max: [4, i64::MAX] });
    let (points, counts) = decode(&source, &rules).unwrap();
    assert!(points.is_empty() && counts.out_of_bounds + counts.withheld == 100, "{counts:?}");
}
