//! COPC: bounds decode only the nodes that meet them, and a wrong octree loses no point in silence.

use std::path::Path;

use points::{Point, PointCounts, PointRules, RowChoice, Source, TextOptions, open_chosen};
use proptest::prelude::*;
use sys::Result;

use crate::cloud::{decode, file, lattice, rules};
use crate::common;
use crate::copc_file::{CopcFile, Entry, without_octree};
use crate::las_file::LasFile;

/// A cloud of points within 2000 m of (500000, 4000000).
fn made() -> CopcFile {
    CopcFile::new(&LasFile::new(4, 7, 0, 20_000), 4)
}

/// What makes an octree wrong.
type Edit<'a> = &'a dyn Fn(&mut Vec<Entry>);

/// A hundredth of the cloud's area.
const SMALL: [f64; 4] = [500_050.0, 4_000_060.0, 500_450.0, 4_000_460.0];

fn opened(path: &Path, bounds: [f64; 4], use_index: bool) -> Source {
    let choice = RowChoice { bounds: Some(bounds), use_index, ..RowChoice::all() };
    open_chosen(path, &TextOptions::default(), &choice).unwrap()
}

fn rules_within(source: &Source, bounds: [f64; 4]) -> PointRules {
    PointRules { bounds: source.raw_bounds(bounds), ..rules(source, &lattice(source)) }
}

/// Decodes what the index leaves out.
fn left_out(source: &Source, rules: &PointRules) -> (Vec<Point>, PointCounts) {
    let (mut points, mut counts) = (Vec::new(), PointCounts::default());
    let mut decode_chunk = |chunk| -> Result<()> {
        counts += source.decode_left_out(chunk, rules, &mut |slice| {
            points.extend_from_slice(slice);
            Ok(())
        })?;
        Ok(())
    };
    (0..source.chunks()).try_for_each(&mut decode_chunk).unwrap();
    (points, counts)
}

/// Asserts that bounds give the same points and the same counts whether the octree is used or not. Returns the counts with it.
#[track_caller]
fn assert_same(bytes: &[u8], bounds: [f64; 4]) -> PointCounts {
    let path = file(".laz", bytes);
    let (with, without) = (opened(&path, bounds, true), opened(&path, bounds, false));
    let rules = rules_within(&with, bounds);
    let (points, counts) = decode(&with, &rules).unwrap();
    let (expected, all) = decode(&without, &rules).unwrap();
    assert!(points == expected, "{bounds:?}: {} points of {}", points.len(), expected.len());
    assert_eq!(PointCounts { not_decoded: 0, ..counts.clone() }, all);
    let (rest, of_rest) = left_out(&with, &rules);
    assert_eq!((rest.len(), of_rest.out_of_bounds), (0, counts.not_decoded), "what is left out is out of bounds");
    assert_eq!(with.decoded_chunks(rules.bounds.as_ref()).records, with.records - counts.not_decoded);
    let written = serde_json::to_string(&with).unwrap();
    let read: Source = serde_json::from_str(&written).unwrap();
    assert_eq!(decode(&read, &rules).unwrap().1, counts);
    counts
}

#[test]
fn bounds_decode_only_the_nodes_that_meet_them() {
    let bytes = made().bytes();
    let counts = assert_same(&bytes, SMALL);
    assert!(counts.not_decoded * 10 > counts.read * 8 && counts.kept > 50, "{counts:?}");
    let all = assert_same(&bytes, [0.0, 0.0, 1e7, 1e7]);
    assert_eq!((all.not_decoded, all.kept + all.withheld), (0, 20_000));
    let none = assert_same(&bytes, [0.0, 0.0, 1.0, 1.0]);
    assert_eq!((none.not_decoded, none.kept), (20_000, 0));
    for i in 0..3 {
        let [x, y] = [i * 137 % 400, i * 291 % 400].map(|step| step as f64 * 10.0 - 2000.0);
        let bounds =
            [500_000.0 + x, 4_000_000.0 + y, 500_000.1 + x + i as f64 * 4.0, 4_000_000.1 + y + 100.0 / (i + 1) as f64];
        assert_same(&bytes, bounds);
    }
}

#[test]
fn a_real_file_gives_the_same_points() {
    let Some(shared) = common::shared() else { return };
    let bytes = std::fs::read(shared.join("data/1.2-with-color.copc.laz")).unwrap();
    let path = file(".laz", &bytes);
    let whole = opened(&path, [0.0, 0.0, 1e8, 1e8], true);
    assert!(whole.warnings.is_empty(), "{:?}", whole.warnings);
    let middle = [0, 1].map(|axis| (whole.min[axis] + whole.max[axis]) / 2.0);
    let counts = assert_same(&bytes, [whole.min[0], whole.min[1], middle[0], middle[1]]);
    assert!(counts.kept > 100 && counts.kept < whole.records);
}

#[test]
fn without_bounds_the_octree_is_not_even_read() {
    let bytes = made().bytes_with(|entries| entries.clear());
    let source = opened(&file(".laz", &bytes), SMALL, false);
    assert!(source.warnings.is_empty());
    let cloud = crate::cloud::read_bytes(".laz", &bytes).unwrap();
    assert!(cloud.source.warnings.is_empty() && cloud.counts.read == 20_000);
}

#[test]
fn a_wrong_octree_is_left_aside_with_a_warning() {
    let made = CopcFile::new(&LasFile::new(4, 7, 0, 2000), 3);
    let edits: [(Edit, &str); 10] = [
        (&|entries| entries.truncate(entries.len() - 1), "has no node for 1 of the chunks"),
        (&|entries| entries.clear(), "has no node for"),
        (&|entries| entries.push(entries[3]), "twice"),
        (&|entries| entries[2].points += 1, "the table of chunks has not"),
        (&|entries| entries[2].bytes -= 1, "the table of chunks has not"),
        (&|entries| entries[2].at += 1, "the table of chunks has not"),
        (&|entries| entries[4].key = [3, 8, 0, 0], "[3, 8, 0, 0] (level, x, y, z), which lies outside the octree"),
        (&|entries| entries[4].key = [31, 0, 0, 0], "lies outside the octree"),
        (&|entries| entries[1].points = -1, "is none"),
        (&|entries| entries.iter_mut().for_each(|entry| entry.key.swap(1, 2)), "where it does not lie"),
    ];
    for (edit, words) in edits {
        let bytes = made.bytes_with(edit);
        let path = file(".laz", &bytes);
        let source = opened(&path, SMALL, true);
        let warnings: Vec<&str> = source.warnings.iter().collect();
        assert!(matches!(warnings[..], [one] if one.contains(words)), "{words}: {warnings:?}");
        assert_eq!(assert_same(&bytes, SMALL).not_decoded, 0, "{words}");
    }
    // What describes the octree: no cube, no page, and a page that is its own second page.
    let bytes = made.bytes();
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let (info, root) = (429, number(429 + 40) as usize);
    let last = root + number(info + 48) as usize - 32;
    for (at, value, words) in [
        (info, f64::NAN.to_bits(), "an invalid cube"),
        (info + 24, (-1.0f64).to_bits(), "an invalid cube"),
        (info + 24, f64::MAX.to_bits(), "an invalid cube"),
        (info + 24, 1.0f64.to_bits(), "where it does not lie"),
        (info + 40, u64::MAX - 5, "which is none"),
        (info + 48, 33, "which is none"),
        (last + 16, root as u64, "twice"),
    ] {
        let mut wrong = bytes.clone();
        wrong[at..at + 8].copy_from_slice(&value.to_le_bytes());
        if at > last {
            let size = number(info + 48) as u32;
            wrong[last + 24..last + 28].copy_from_slice(&size.to_le_bytes());
        }
        let source = opened(&file(".laz", &wrong), SMALL, true);
        assert!(source.warnings.iter().any(|warning| warning.contains(words)), "{words}: {:?}", source.warnings);
        assert_eq!(assert_same(&wrong, SMALL).not_decoded, 0, "{words}");
    }
    // A page that has nothing but itself.
    let mut circle = bytes.clone();
    let mut put = |at: usize, value: &[u8]| circle[at..at + value.len()].copy_from_slice(value);
    put(info + 40, &(last as u64).to_le_bytes());
    put(info + 48, &32u64.to_le_bytes());
    put(last + 16, &(last as u64).to_le_bytes());
    put(last + 24, &32u32.to_le_bytes());
    let source = opened(&file(".laz", &circle), SMALL, true);
    assert!(source.warnings.iter().any(|warning| warning.contains("leads in a circle")), "{:?}", source.warnings);
}

#[test]
fn points_that_lie_elsewhere_than_the_octree_says_are_noticed() {
    let mut made = made();
    // The nodes of the lowest level are 8 by 8.
    let node = |range: std::ops::Range<i32>| {
        let is_there = |key: &&[i32; 4]| {
            key[0] == 3 && range.contains(&key[1]) && range.contains(&key[2]) && made.nodes[*key].len() > 3
        };
        *made.nodes.keys().find(is_there).unwrap()
    };
    let (first, last) = (node(1..3), node(5..7));
    // The last points of two nodes far from each other change places.
    let [a, b] = [first, last].map(|key| made.nodes.get_mut(&key).unwrap().pop().unwrap());
    made.nodes.get_mut(&first).unwrap().push(b);
    made.nodes.get_mut(&last).unwrap().push(a);
    let bytes = made.bytes();
    let path = file(".laz", &bytes);
    let whole = [400_000.0, 3_900_000.0, 600_000.0, 4_100_000.0];
    let source = opened(&path, whole, true);
    assert!(source.warnings.is_empty());
    assert_eq!(decode(&source, &rules_within(&source, whole)).unwrap().1.misplaced, 2);
    // A quarter of the cloud: one of the two nodes is decoded.
    let bounds = [400_000.0, 3_900_000.0, 500_000.0, 4_000_000.0];
    let rules = rules_within(&source, bounds);
    let (mut points, mut counts) = decode(&source, &rules).unwrap();
    assert_eq!(counts.misplaced, 1);
    let (more, of_more) = left_out(&source, &rules);
    assert!(!more.is_empty(), "the point in the wrong node");
    points.extend(more);
    points.sort_by_key(Point::order);
    counts.take_back_not_decoded();
    counts += of_more;
    let (expected, all) = decode(&opened(&path, bounds, false), &rules).unwrap();
    assert!(points == expected);
    assert_eq!(PointCounts { misplaced: 0, ..counts }, all);
}

#[test]
fn other_records_of_an_octree_are_strange() {
    let bytes = without_octree(&made().bytes());
    assert_eq!(assert_same(&bytes, SMALL).not_decoded, 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn wrong_bytes_in_an_octree_never_panic(
        wrong in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        in_info in any::<bool>(),
    ) {
        let mut bytes = CopcFile::new(&LasFile::new(4, 6, 0, 300), 2).bytes();
        let at = u64::from_le_bytes(bytes[429 + 40..429 + 48].try_into().unwrap()) as usize;
        let range = if in_info { 429..429 + 56 } else { at..bytes.len() };
        for (index, value) in wrong {
            bytes[range.start + index.index(range.len())] = value;
        }
        let path = file(".laz", &bytes);
        let bounds = [499_000.0, 3_999_000.0, 500_010.0, 4_000_010.0];
        let source = opened(&path, bounds, true);
        let rules = rules_within(&source, bounds);
        let (points, counts) = decode(&source, &rules).unwrap();
        let (more, _) = left_out(&source, &rules);
        let (expected, _) = decode(&opened(&path, bounds, false), &rules).unwrap();
        prop_assert_eq!(points.len() + more.len(), expected.len());
        prop_assert_eq!(counts.read, 300);
    }
}
