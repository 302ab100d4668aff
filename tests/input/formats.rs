//! Made-up files of every point format, uncompressed and compressed.

use points::{TextOptions, open};

use crate::cloud::{file, read_bytes};
use crate::las_file::{LasFile, points_at};
use crate::{assert_reads, first_warning};
use sys::ErrorKind;

#[test]
fn every_point_format_is_read_uncompressed_and_compressed() {
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
            for later in [4, 5] {
                file.minor = later;
                assert_reads(&file, &name, &file.las());
                assert_reads(&file, &name, &file.laz(&[120], false));
            }
        }
    }
}

#[test]
fn files_without_points_have_no_chunks() {
    for format in [1, 7] {
        let file = LasFile::new(4, format, 0, 0);
        for bytes in [file.las(), file.laz(&[50], false), file.laz(&[50], true)] {
            let cloud = read_bytes(".laz", &bytes).unwrap();
            assert_eq!((cloud.source.records, cloud.source.chunks(), cloud.counts.read), (0, 0, 0));
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
        assert!(first_warning(&cloud).contains("chunk table is missing"), "{:?}", cloud.source.warnings);
    }
    let layered = LasFile::new(4, 7, 0, 1000);
    assert_reads(&layered, "layered, variable", &unfinished(layered.laz(&[10, 400, 590], true)));
    let pointwise = LasFile::new(2, 3, 0, 1000);
    let error = read_bytes(".laz", &unfinished(pointwise.laz(&[10, 400, 590], true))).err().unwrap();
    assert!(error.kind() == ErrorKind::Input && error.to_string().contains("lost the table"), "{error}");
}

#[test]
fn the_position_of_the_table_may_be_stored_at_the_end() {
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
fn a_description_says_what_a_file_holds() {
    let path = file(".laz", &LasFile::new(4, 7, 0, 100).laz(&[40], false));
    let description = points::info::describe(&open(&path, &TextOptions::default()).unwrap());
    let json = serde_json::to_value(&description).unwrap();
    assert_eq!(
        (json["points"].as_u64(), json["version"].as_str(), json["format"].as_str()),
        (Some(100), Some("1.4"), Some("laz"))
    );
    assert!(description.to_string().contains("LAZ 1.4, point format 7"), "{description}");
}
