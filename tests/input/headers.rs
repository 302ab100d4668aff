//! Headers with wrong, odd and extreme fields.

use lattice::AxisMap;
use points::{KeptReturns, OptionalFields, PointRules, TextOptions, open};

use crate::cloud::{decode, file, read_bytes};
use crate::las_file::LasFile;
use crate::{assert_reads, expected, first_warning};
use sys::ErrorKind;

#[test]
fn every_wrong_header_field_is_named() {
    let double = |value: f64| value.to_le_bytes().to_vec();
    let table: Vec<(usize, Vec<u8>, &str)> = vec![
        (24, vec![2], "version 2.4"),
        (25, vec![9], "version 1.9"),
        (94, vec![100, 0], "header of 100 bytes"),
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
        assert_eq!(error.kind(), ErrorKind::Input, "{words}");
        assert!(error.to_string().contains(words), "{words}: {error}");
    }
    for length in [0, 1, 3, 4, 100, 226, 227, 374] {
        let error = read_bytes(".las", &sound[..length]).err().unwrap();
        assert_eq!(error.kind(), ErrorKind::Input, "{length} bytes: {error}");
    }
}

#[test]
fn odd_headers_are_read_correctly() {
    let made = LasFile::new(4, 6, 0, 50);
    let sound = made.las();
    let patched = |at: usize, value: &[u8]| {
        let mut bytes = sound.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        bytes
    };
    // A wrong 32-bit count next to a right 64-bit one, wrong bounds, records that the header promises and that are not there.
    let cloud = assert_reads(&made, "legacy count", &patched(107, &7u32.to_le_bytes()));
    assert!(first_warning(&cloud).contains("differ"));
    assert_reads(&made, "bounds", &patched(179, &1.5f64.to_le_bytes()));
    let cloud = assert_reads(&made, "records", &patched(100, &u32::MAX.to_le_bytes()));
    assert!(first_warning(&cloud).contains("only 0 fit"));
    let cloud = assert_reads(&made, "extended", &patched(235, &[0xff; 12]));
    assert!(first_warning(&cloud).contains("only 0 are there"));
    let legacy = [&patched(247, &[0; 8])[..107], &50u32.to_le_bytes(), &patched(247, &[0; 8])[111..]].concat();
    assert_reads(&made, "only a 32-bit count", &legacy);
    let cloud = read_bytes(".las", &patched(247, &1000u64.to_le_bytes())).unwrap();
    assert_eq!((cloud.counts.malformed, cloud.points), (950, expected(&made, &assert_reads(&made, "sound", &sound))));
}

#[test]
fn extreme_scales_and_offsets_are_decoded_exactly_or_refused() {
    let numbers = [0.0, 5e-324, 1e-29, 1e-28, 1.5e-15, 0.01, 3.0, 1e12, 1e27, 7.9228162514264e28, 7.93e28, f64::MAX];
    let mut made = LasFile::new(4, 6, 0, 10);
    for (record, raw) in [(0, i32::MIN), (1, i32::MAX)] {
        let at = record * made.length() as usize;
        (0..3).for_each(|axis| made.records[at + 4 * axis..][..4].copy_from_slice(&raw.to_le_bytes()));
    }
    let sound = made.las();
    let mut decoded = 0;
    for scale in numbers {
        for offset in numbers.iter().flat_map(|number| [*number, -number]) {
            let mut bytes = sound.clone();
            for axis in 0..3 {
                bytes[131 + 8 * axis..][..8].copy_from_slice(&scale.to_le_bytes());
                bytes[155 + 8 * axis..][..8].copy_from_slice(&offset.to_le_bytes());
            }
            let path = file(".las", &bytes);
            let source = match open(&path, &TextOptions::default()) {
                Ok(source) => source,
                Err(error) => {
                    let message = error.to_string();
                    assert_eq!(error.kind(), ErrorKind::Input, "{scale:e} and {offset:e}: {message}");
                    assert!(message.contains(".las: has ") && message.contains(" of x in its header"), "{message}");
                    continue;
                }
            };
            let own = source.axes[0];
            let map = AxisMap::new(own.offset, own.scale, own.offset, own.scale).unwrap();
            let (maps, classes) = ([map; 3], [true; 256]);
            let (returns, fields) = (KeptReturns::All, OptionalFields::default());
            let rules =
                PointRules { maps, classes, returns, bounds: None, clip: None, first_order: 0, numbered: true, fields };
            let (points, counts) = decode(&source, &rules).unwrap();
            // The first two records lie outside the reach of the lattice, and the fourth is withheld.
            assert_eq!((points.len(), counts.malformed), (7, 2), "{scale:e} and {offset:e}");
            for (example, raw) in counts.examples.iter().zip([i32::MIN, i32::MAX]) {
                let value = own.value(raw.into());
                assert!(value.is_finite() && example.contains(&format!(": x = {value} lies outside")), "{example}");
            }
            decoded += 1;
        }
    }
    assert!(decoded > 50, "only {decoded}");
}
