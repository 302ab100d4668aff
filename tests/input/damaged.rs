//! Damaged files, files that change, and any bytes at all.

use std::path::PathBuf;

use points::{Point, TextOptions, open};
use proptest::prelude::*;
use sys::{Error, ErrorKind};

use crate::cloud::{file, lattice, read_bytes, rules, survives};
use crate::las_file::{LasFile, points_at};
use crate::{assert_reads, first_warning};

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
            assert!(first_warning(&cloud).contains(words), "{:?}", cloud.source.warnings);
        }
    }
}

#[test]
fn a_table_with_a_wrong_bit_anywhere_leads_to_no_wrong_point() {
    for (format, minor) in [(3, 2), (7, 4)] {
        let file = LasFile::new(minor, format, 0, 1000);
        let sound = file.laz(&[300], false);
        let at = points_at(&sound);
        let table = u64::from_le_bytes(sound[at..at + 8].try_into().unwrap()) as usize;
        for bit in 4 * 8..(sound.len() - table) * 8 {
            let mut wrong = sound.clone();
            wrong[table + bit / 8] ^= 1 << (bit % 8);
            assert_reads(&file, &format!("format {format}, bit {bit}"), &wrong);
        }
        for length in 1..sound.len() - table {
            let mut zeros = sound.clone();
            zeros[table..table + length].fill(0);
            assert_reads(&file, &format!("format {format}, {length} zeros"), &zeros);
        }
    }
}

#[test]
fn a_damaged_chunk_loses_only_its_own_points() {
    let file = LasFile::new(4, 7, 0, 1000);
    let mut bytes = file.laz(&[300], false);
    let whole = read_bytes(".laz", &bytes).unwrap().points;
    // The size of the first layer, after the chunk's first point and its number of points, becomes far too large.
    let at = points_at(&bytes) + 8 + file.length() as usize + 4;
    bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let cloud = read_bytes(".laz", &bytes).unwrap();
    assert!(cloud.counts.malformed == 300 && cloud.counts.examples[0].contains("chunk 0 is damaged"));
    let rest: Vec<Point> = whole.into_iter().filter(|point| point.order() >= 300).collect();
    assert_eq!(cloud.points, rest);
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
            assert!(cloud.counts.malformed > 0 && cloud.points.len() < whole.len(), "format {format}, cut at {cut}");
        }
    }
}

#[test]
fn a_file_that_changes_while_in_use_is_an_error() {
    let bytes = LasFile::new(2, 1, 0, 1000).laz(&[300], false);
    let path = file(".laz", &bytes);
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let error = source.decode(0, &rules, &mut |_| Ok(())).unwrap_err();
    assert!(error.kind() == ErrorKind::Retry && error.to_string().contains("has changed"), "{error}");
    let gone = PathBuf::from(&path);
    drop(path);
    let error = source.decode(0, &rules, &mut |_| Ok(())).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if *path == gone) && error.kind() == ErrorKind::Retry, "{error}");
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
