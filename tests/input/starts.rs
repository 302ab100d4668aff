//! The start of a chunk is decoded as the whole chunk is.

use points::{Point, TextOptions, open};

use crate::cloud::{file, lattice, rules};
use crate::las_file::LasFile;

/// Asserts that the first records of every chunk give the first points, and only those.
#[track_caller]
fn starts_agree(name: &str, bytes: &[u8], is_exact: bool) {
    let path = file(".bin", bytes);
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    let take = |chunk: usize, records: u64| {
        let mut points: Vec<Point> = Vec::new();
        let mut sink = |slice: &[Point]| {
            points.extend_from_slice(slice);
            Ok(())
        };
        let counts = source.decode_start(chunk, records, &rules, &mut sink).unwrap();
        assert_eq!(counts.kept, points.len() as u64);
        (points, counts)
    };
    for chunk in 0..source.chunks() {
        let (all, counts) = take(chunk, u64::MAX);
        for records in [0, 1, 5, 700, counts.read, counts.read + 1] {
            let (start, seen) = take(chunk, records);
            assert!(all.starts_with(&start), "{name}, {records} records of chunk {chunk}");
            assert_eq!(seen.malformed, 0, "{name}: {:?}", seen.examples);
            let expected = records.min(counts.read);
            let near = if is_exact { expected..=expected } else { expected * 9 / 10..=expected * 11 / 10 + 1 };
            assert!(near.contains(&seen.read), "{name}: {} records, not {expected}", seen.read);
        }
    }
}

#[test]
fn the_start_of_a_chunk_gives_its_first_points() {
    for (minor, format) in [(2, 3), (4, 7)] {
        let made = LasFile::new(minor, format, 2, 70_000);
        starts_agree("las", &made.las(), true);
        for (chunks, variable) in [(&[50_000][..], false), (&[300], false), (&[1_000, 7, 20_000, 3], true)] {
            starts_agree(&format!("laz {format} {chunks:?}"), &made.laz(chunks, variable), true);
        }
    }
    let text: String = (100_000..250_000).map(|i| format!("{i}.25,{},{}\n", i * 7 % 900_000, i % 90)).collect();
    starts_agree("text", text.as_bytes(), false);
}

/// The last chunk counts the records that the file lacks. Its start does not.
#[test]
fn the_start_of_the_last_chunk_counts_no_missing_records() {
    let made = LasFile::new(2, 0, 0, 1_000);
    let mut bytes = made.las();
    bytes.truncate(bytes.len() - 20 * 100);
    let path = file(".las", &bytes);
    let source = open(&path, &TextOptions::default()).unwrap();
    let rules = rules(&source, &lattice(&source));
    let counts = |records: u64| source.decode_start(0, records, &rules, &mut |_| Ok(())).unwrap();
    assert_eq!((counts(10).read, counts(10).malformed), (10, 0));
    assert_eq!((counts(1_000).read, counts(1_000).malformed), (1_000, 100));
}
