//! EPT: the points are those of one file, bounds read only the nodes that meet them, and what is wrong is named with its file.

use std::path::Path;

use points::{Point, PointCounts, PointRules, RowChoice, Source, TextOptions, open, open_chosen};
use sys::{ErrorKind, Result};

use crate::cloud::{decode, file, lattice, rules};
use crate::copc_file::CopcFile;
use crate::ept_files::{EptFiles, NodeType, one_file};
use crate::las_file::LasFile;

/// A cloud of points within 1000 m of (500000, 4000000).
fn made() -> CopcFile {
    CopcFile::new(&LasFile::new(4, 7, 0, 10_000), 4)
}

/// A hundredth of the cloud's area.
const SMALL: [f64; 4] = [500_050.0, 4_000_060.0, 500_250.0, 4_000_260.0];

fn opened(path: &Path, bounds: [f64; 4], use_index: bool) -> Result<Source> {
    let choice = RowChoice { bounds: Some(bounds), use_index, ..RowChoice::all() };
    open_chosen(path, &TextOptions::default(), &choice)
}

fn within(source: &Source, bounds: [f64; 4]) -> PointRules {
    PointRules { bounds: source.raw_bounds(bounds), ..rules(source, &lattice(source)) }
}

#[test]
fn the_points_are_those_of_one_file() {
    let cloud = made();
    let path = file(".laz", &one_file(&cloud));
    let laz = open(&path, &TextOptions::default()).unwrap();
    let lattice = lattice(&laz);
    let (expected, counts) = decode(&laz, &rules(&laz, &lattice)).unwrap();
    for kind in NodeType::ALL {
        let folder = tempfile::tempdir().unwrap();
        let source = open(&EptFiles::of(&cloud, kind).write(folder.path()), &TextOptions::default()).unwrap();
        assert_eq!((source.records, source.axes, source.min, source.max), (10_000, laz.axes, laz.min, laz.max));
        let (points, its_counts) = decode(&source, &rules(&source, &lattice)).unwrap();
        assert!(points == expected, "{kind:?}");
        assert_eq!(its_counts, counts, "{kind:?}");
    }
}

/// Asserts that bounds give the same points and the same counts whether the octree is used or not. Returns the counts with it.
#[track_caller]
fn assert_same(path: &Path, bounds: [f64; 4]) -> PointCounts {
    let (with, without) = (opened(path, bounds, true).unwrap(), opened(path, bounds, false).unwrap());
    let (points, counts) = decode(&with, &within(&with, bounds)).unwrap();
    let (expected, all): (Vec<Point>, PointCounts) = decode(&without, &within(&without, bounds)).unwrap();
    // The numbers of points depend on which nodes there are, but not their order.
    let places = |points: &[Point]| points.iter().map(|point| (point.position, point.z)).collect::<Vec<_>>();
    assert!(places(&points) == places(&expected), "{bounds:?}: {} points of {}", points.len(), expected.len());
    assert_eq!(PointCounts { not_decoded: 0, ..counts.clone() }, all);
    let written = serde_json::to_string(&with).unwrap();
    let read: Source = serde_json::from_str(&written).unwrap();
    assert_eq!(decode(&read, &within(&read, bounds)).unwrap().1, counts);
    counts
}

#[test]
fn bounds_read_only_the_nodes_that_meet_them() {
    let folder = tempfile::tempdir().unwrap();
    for kind in NodeType::ALL {
        let path = EptFiles::of(&made(), kind).write(folder.path());
        let counts = assert_same(&path, SMALL);
        assert!(counts.not_decoded * 10 > counts.read * 7 && counts.kept > 50, "{counts:?}");
        let all = assert_same(&path, [0.0, 0.0, 1e7, 1e7]);
        assert_eq!((all.not_decoded, all.kept + all.withheld), (0, 10_000));
        let none = assert_same(&path, [0.0, 0.0, 1.0, 1.0]);
        assert_eq!((none.not_decoded, none.kept), (10_000, 0));
    }
    // Nodes and pages of the other three quarters are not looked at.
    let path = EptFiles::of(&made(), NodeType::Laszip).write(folder.path());
    for folder in ["ept-data", "ept-hierarchy"].map(|name| folder.path().join(name)) {
        for file in folder.read_dir().unwrap().map(|entry| entry.unwrap().path()) {
            let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
            let [level, x, ..] = name.split('-').map(|number| number.parse::<u32>().unwrap()).collect::<Vec<_>>()[..]
            else {
                panic!("{name}")
            };
            if level > 0 && x < 1 << (level - 1) {
                std::fs::remove_file(file).unwrap();
            }
        }
    }
    let source = opened(&path, SMALL, true).unwrap();
    let (points, counts) = decode(&source, &within(&source, SMALL)).unwrap();
    assert!(points.len() > 50 && counts.malformed == 0, "{counts:?}");
}

/// Returns the error of a data set that `edit` has changed: on opening it, or on decoding it.
fn error_of(kind: NodeType, bounds: [f64; 4], edit: impl FnOnce(&mut EptFiles)) -> String {
    let mut files = EptFiles::of(&made(), kind);
    edit(&mut files);
    let folder = tempfile::tempdir().unwrap();
    let source = opened(&files.write(folder.path()), bounds, true);
    let error = match source.and_then(|source| decode(&source, &within(&source, bounds))) {
        Ok((_, counts)) => panic!("{counts:?}"),
        Err(error) => error,
    };
    assert_eq!(error.kind(), ErrorKind::Input, "{error}");
    error.to_string()
}

fn replaced(from: &str, to: &str) -> impl FnOnce(&mut Vec<u8>) {
    let (from, to) = (from.to_owned(), to.to_owned());
    move |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).unwrap();
        assert!(text.contains(&from), "{text}");
        *bytes = text.replacen(&from, &to, 1).into_bytes();
    }
}

const ALL: [f64; 4] = [0.0, 0.0, 1e7, 1e7];

#[test]
fn an_index_that_cannot_be_used_is_refused() {
    for (from, to, words) in [
        ("\"laszip\"", "\"draco\"", "nodes of the type \"draco\""),
        ("\"json\"", "\"gz\"", "a hierarchy of the type \"gz\""),
        ("\"points\":10000", "\"points\":9999", "claims 9999 points, but the nodes of its hierarchy have 10000"),
        ("\"points\":10000", "\"points\":-1", "is not a readable EPT index"),
        ("\"name\":\"Y\"", "\"name\":\"y\"", "has no dimension Y"),
        ("\"type\":\"signed\"", "\"type\":\"floating\"", "has X as floating numbers without a scale"),
        ("\"scale\":0.01", "\"scale\":0", "as the scale of x"),
        ("\"scale\":0.01", "\"scale\":0.001", "this node has another scale or offset than the index"),
        ("\"bounds\":[", "\"bounds\":[1e9, 1e9, 1e9, 0, 0, 0], \"other\":[", "not a cube"),
        (
            "\"version\":\"1.0.0\"",
            "\"version\":\"2.0.0\"",
            "has the version \"2.0.0\" of EPT: only versions 1.0 to 1.x",
        ),
        ("\"name\":\"Intensity\"", "\"name\":\"X\"", "has the dimension X twice"),
    ] {
        let error = error_of(NodeType::Laszip, ALL, |files| files.edit("ept.json", replaced(from, to)));
        assert!(error.contains(words), "{words}: {error}");
    }
}

#[test]
fn nodes_that_do_not_fit_the_hierarchy_are_named() {
    let root = "ept-hierarchy/0-0-0-0.json";
    let name = |kind| if kind == NodeType::Laszip { "ept-data/0-0-0-0.laz" } else { "ept-data/0-0-0-0.bin" };
    let points = made().nodes[&[0; 4]].len();
    let (entry, less) = (format!("\"0-0-0-0\":{points}"), format!("\"0-0-0-0\":{}", points - 1));
    for (kind, words) in [
        (NodeType::Laszip, format!("has {points} points, and its hierarchy says")),
        (NodeType::Binary, "has more bytes".into()),
    ] {
        let error = error_of(kind, ALL, |files| {
            files.edit(root, replaced(&entry, &less));
            files.edit("ept.json", replaced("\"points\":10000", "\"points\":9999"));
        });
        assert!(error.contains(&words) && error.contains(name(kind)), "{error}");
    }
}

#[test]
fn points_that_lie_outside_their_nodes_are_named() {
    for bounds in [SMALL, ALL] {
        let error = error_of(NodeType::Binary, bounds, |files| {
            let [east, west] = ["ept-data/1-1-1-1.bin", "ept-data/1-0-1-1.bin"];
            let length = files.0[east].len();
            let other = files.0[west].repeat(length / files.0[west].len() + 1);
            files.edit(east, |bytes| bytes.copy_from_slice(&other[..length]));
        });
        assert!(error.contains("point 0 of ") && error.contains("ept-data/1-1-1-1.bin, at (49"), "{error}");
        assert!(error.contains("outside its cell of the octree"), "{error}");
    }
    // Records have no scale of their own. Each axis has another place in the schema.
    let axis = |name: &str, scale: &str, offset: f64| {
        format!("\"name\":\"{name}\",\"offset\":{offset:?},\"scale\":{scale},\"size\":4")
    };
    for (kind, name, offset, wider) in [
        (NodeType::Binary, "X", 500_000.0, "0.02"),
        (NodeType::Zstandard, "Y", 4_000_000.0, "0.02"),
        // Heights are small, and cells as high as they are wide.
        (NodeType::Binary, "Z", 0.0, "1000.0"),
    ] {
        for (scale, moved) in [(wider, 0.0), ("0.01", 300.0)] {
            let other = axis(name, scale, offset + moved);
            let error = error_of(kind, ALL, |files| {
                files.edit("ept.json", replaced(&axis(name, "0.01", offset), &other));
            });
            assert!(error.contains("outside its cell of the octree: bounds, scale or offset"), "{other}: {error}");
        }
    }
}

#[test]
fn a_box_of_the_points_beyond_the_octree_is_ignored() {
    let mut files = EptFiles::of(&made(), NodeType::Binary);
    files.edit("ept.json", replaced("\"boundsConforming\":[", "\"boundsConforming\":[0, 0, 0, 1, 1, 1], \"other\":["));
    let folder = tempfile::tempdir().unwrap();
    let source = open(&files.write(folder.path()), &TextOptions::default()).unwrap();
    let warnings: Vec<&str> = source.warnings.iter().collect();
    assert!(
        warnings[0].contains("boundsConforming [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], which are not within"),
        "{warnings:?}"
    );
    assert!(source.min[0] < 500_000.0 && source.max[0] > 500_000.0);
    assert_eq!(decode(&source, &rules(&source, &lattice(&source))).unwrap().1.kept, decode_all());
}

/// Returns the number of points of the cloud that are kept.
fn decode_all() -> u64 {
    let folder = tempfile::tempdir().unwrap();
    let source = open(&EptFiles::of(&made(), NodeType::Binary).write(folder.path()), &TextOptions::default()).unwrap();
    decode(&source, &rules(&source, &lattice(&source))).unwrap().1.kept
}

#[test]
fn lost_points_are_malformed_and_named() {
    let lost = |kind, edit: &dyn Fn(&mut EptFiles)| {
        let mut files = EptFiles::of(&made(), kind);
        edit(&mut files);
        let folder = tempfile::tempdir().unwrap();
        let source = open(&files.write(folder.path()), &TextOptions::default()).unwrap();
        let counts = decode(&source, &rules(&source, &lattice(&source))).unwrap().1;
        assert_eq!(counts.read, source.records);
        (counts.malformed, counts.examples.concat())
    };
    let points = made().nodes[&[0; 4]].len() as u64;
    for (kind, ending) in [(NodeType::Laszip, "laz"), (NodeType::Binary, "bin"), (NodeType::Zstandard, "zst")] {
        let name = format!("ept-data/0-0-0-0.{ending}");
        let (count, example) = lost(kind, &|files| drop(files.0.remove(&name)));
        assert!(
            count == points && example.contains(&format!("{name}: this node of the hierarchy is not there")),
            "{example}"
        );
        let (count, example) = lost(kind, &|files| files.edit(&name, |bytes| bytes.truncate(bytes.len() / 2)));
        assert!((1..=points).contains(&count) && example.contains(&name), "{count} {example}");
    }
    let (count, example) =
        lost(NodeType::Laszip, &|files| files.edit("ept.json", replaced("\"points\":10000", "\"points\":10007")));
    assert!(count == 7 && example.contains("promises 7 points more"), "{count} {example}");
}
