//! Sources and rules written down as JSON and read back, as the plan of a job needs it.

use std::path::Path;

use points::{KeptReturns, PointRules, RawBounds, Source, TextOptions, open};
use rayon::prelude::*;

use crate::cloud::{decode, file, lattice, rules};
use crate::common;
use crate::las_file::{LasFile, points_at};

/// Writes the source at `path` and rules for it down, reads both back, and asserts that they say and decode the same. Returns
/// the source that was read back.
fn assert_survives_json(path: &Path, options: &TextOptions) -> Source {
    let source = open(path, options).unwrap();
    let mut rules = rules(&source, &lattice(&source));
    rules.classes = std::array::from_fn(|class| class % 3 != 1);
    rules.returns = KeptReturns::Numbers(0b10110);
    rules.bounds = Some(RawBounds { min: [-100_000, -90_000], max: [100_000, i64::MAX] });
    rules.first_order = (1 << 40) - 1 - source.records;
    let text = serde_json::to_string(&(&source, &rules)).unwrap();
    let (read_source, read_rules): (Source, PointRules) = serde_json::from_str(&text).unwrap();
    assert_eq!(read_rules, rules, "{}", path.display());
    assert_eq!(serde_json::to_string(&(&read_source, &read_rules)).unwrap(), text, "{}", path.display());
    // A plan may also go through a value, which keeps less of a number than a text does.
    let value = serde_json::to_value((&source, &rules)).unwrap();
    assert_eq!(value, serde_json::from_str::<serde_json::Value>(&text).unwrap());
    let (_, of_value): (Source, PointRules) = serde_json::from_value(value).unwrap();
    assert_eq!(of_value, rules);

    assert_eq!((read_source.axes, read_source.grid, &read_source.crs), (source.axes, source.grid, &source.crs));
    assert_eq!(
        [read_source.min, read_source.max].map(|corner| corner.map(f64::to_bits)),
        [source.min, source.max].map(|corner| corner.map(f64::to_bits))
    );
    assert_eq!(read_source.warnings, source.warnings);
    assert!(
        decode(&read_source, &read_rules).unwrap() == decode(&source, &rules).unwrap(),
        "{}: points differ",
        path.display()
    );
    read_source
}

#[test]
fn las_is_read_back_as_it_was_written() {
    for (minor, format) in [(2, 3), (4, 7)] {
        let made = LasFile::new(minor, format, 3, 120_000);
        let bytes = made.las();
        assert_eq!(assert_survives_json(&file(".las", &bytes), &TextOptions::default()).chunks(), 3);
        let cut = &bytes[..bytes.len() - 100];
        assert!(assert_survives_json(&file(".las", cut), &TextOptions::default()).missing > 0);
    }
}

#[test]
fn bounds_that_only_floating_point_can_hold_are_read_back_exactly() {
    let mut bytes = LasFile::new(2, 3, 0, 100).las();
    for (at, value) in [(179, f64::MAX), (187, -f64::MIN_POSITIVE), (195, 0.1 + 0.2), (203, -0.0), (211, 5e-324)] {
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
    // The steps have 17 digits and are no round decimals.
    for (at, value) in [(131, 0.010000000000000009), (155, 1234567.8901234567)] {
        bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
    }
    let source = assert_survives_json(&file(".las", &bytes), &TextOptions::default());
    assert_eq!((source.max[0], source.max[2]), (f64::MAX, 5e-324));
    assert!(source.min[1] == 0.0 && source.min[1].is_sign_negative());
}

#[test]
fn laz_is_read_back_with_every_kind_of_chunks() {
    let unfinished = |mut bytes: Vec<u8>| {
        let at = points_at(&bytes);
        bytes[at..at + 8].copy_from_slice(&(-1i64).to_le_bytes());
        bytes
    };
    // Pointwise compression, layered compression, and both with extra bytes and wave packets.
    for (minor, format, extra) in [(2, 3, 0), (4, 7, 0), (3, 5, 4), (4, 10, 4)] {
        let made = LasFile::new(minor, format, extra, 2000);
        let (fixed, variable) = (made.laz(&[300], false), made.laz(&[10, 1400, 590], true));
        for bytes in [&fixed, &variable, &fixed[..fixed.len() * 2 / 3].to_vec(), &unfinished(fixed.clone())] {
            assert_survives_json(&file(".laz", bytes), &TextOptions::default());
        }
    }
}

#[test]
fn many_chunks_of_a_laz_file_become_one_chunk_of_the_source() {
    let made = LasFile::new(4, 7, 0, 120_000);
    let source = assert_survives_json(&file(".laz", &made.laz(&[1000], false)), &TextOptions::default());
    assert_eq!(source.chunks(), 3);
}

#[test]
fn text_is_read_back_as_it_was_written() {
    let mut rows = String::from("% names\nclass;x;y;z;red;green;blue\n");
    for i in 0..100_000 {
        rows.push_str(&format!("{};{}.{:03};\"-{}.5\";1e-3;1;2;3\n", i % 20, i, i % 1000, i / 7));
    }
    let options = TextOptions { comment: Some("%".to_string()), ..TextOptions::default() };
    assert!(assert_survives_json(&file(".csv", rows.as_bytes()), &options).chunks() > 1);
    for text in ["1 2 3\n4 x 6\n7 8 9", "x,y,z\n", "\u{feff}X\tY\tZ\n1\t2\t3\n0.30000000000000004\t1\t-0\n"] {
        assert_survives_json(&file(".csv", text.as_bytes()), &TextOptions::default());
    }
}

#[test]
fn real_files_are_read_back_as_they_were_written() {
    let Some(shared) = common::shared() else { return };
    let names = [
        "Topography.laz",
        "topography.csv",
        "crop_1.laz",
        "1.2-with-color.copc.laz",
        "file_with_both_wkt_and_geotiff_vlrs.las",
        "autzen-dd.las",
        "32-1-472-150-76.laz",
        "data.xyz",
        "quoted2.txt",
        "bad/truncated-mid-chunk.laz",
        "bad/simple-laszip-compressor-version-1.2r0.laz",
        "bad/bad_vlr_count.las",
    ];
    names.into_par_iter().for_each(|name| {
        assert_survives_json(&shared.join("data").join(name), &TextOptions::default());
    });
}

#[test]
fn damaged_json_of_a_source_is_refused() {
    let source = open(&file(".laz", &LasFile::new(2, 3, 0, 100).laz(&[50], false)), &TextOptions::default()).unwrap();
    let sound = serde_json::to_value(&source).unwrap();
    for (pointer, wrong) in [
        ("/axes/0/scale", serde_json::json!("a hundredth")),
        ("/points/laz/compression/items/0", serde_json::json!([99, 20, 2])),
        ("/min/0", serde_json::json!(null)),
    ] {
        let mut value = sound.clone();
        *value.pointer_mut(pointer).unwrap() = wrong;
        assert!(serde_json::from_value::<Source>(value).is_err(), "{pointer}");
    }
}
