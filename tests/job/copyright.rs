//! `[output] copyright`: every file that viewers open tells whose the data are.

use std::fs;

use serde_json::Value;

use crate::clouds;
use crate::program::Job;
use crate::tileset::files_below;

/// Quotes, a sign of HTML, two signs beyond ASCII, and what separates two owners for CesiumJS.
const OWNERS: &str = "© 2024 \"Stadt\" <Köln> \\ A & B; CC BY 4.0";

/// Returns the JSON of a GLB.
fn document(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

#[test]
fn every_tile_and_tileset_has_the_copyright_to_the_letter() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::gaussian(8_000));
    let job = |lines: &str| {
        let levels = format!("max_points_per_level_tile = 100\nmax_edge = \"auto\"\n{lines}");
        let job = Job::on(&[&cloud]).tiles_of(300).with("output", &levels);
        job.report();
        job.verified();
        job
    };
    let marked = job(&format!("copyright = {:?}", OWNERS));
    let plain = job("");
    let (mut tiles, mut tilesets) = (0, 0);
    for path in files_below(&marked.out()) {
        let asset = |path: &std::path::Path| match path.extension().and_then(|ending| ending.to_str()) {
            Some("glb") => Some(document(&fs::read(path).unwrap())["asset"].take()),
            Some("json") if path.to_string_lossy().contains("tileset") => {
                Some(serde_json::from_slice::<Value>(&fs::read(path).unwrap()).unwrap()["asset"].take())
            }
            _ => None,
        };
        let Some(found) = asset(&path) else { continue };
        assert_eq!(found["copyright"], OWNERS, "{path:?}");
        let same = plain.out().join(path.strip_prefix(marked.out()).unwrap());
        assert!(asset(&same).unwrap()["copyright"].is_null(), "{same:?}");
        if path.extension().unwrap() == "glb" { tiles += 1 } else { tilesets += 1 }
    }
    assert!(tiles > 30 && tilesets >= 1, "{tiles} {tilesets}");
}

#[test]
fn a_copyright_is_one_line_of_text() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::grid(4, 4));
    let long = format!("{:?}", "x".repeat(501));
    let breaking =
        ["\"two\\nlines\"", "\"bell \\u0007\"", "\"two\\u2028lines\"", "\"two\\u2029lines\"", "\"a\\u0085b\""];
    let turning = ["\"(c) \\u202Eytic\"", "\"\\u202Aa\"", "\"\\u2067a\\u2069\""];
    for wrong in ["\"\"", "\"  \"", "7", &long].into_iter().chain(breaking).chain(turning) {
        let job = Job::on(&[&cloud]).with("output", &format!("copyright = {wrong}"));
        job.run().refused(2, &["line", "copyright"]);
    }
    let longest = format!("copyright = {:?}", "ü".repeat(500));
    Job::on(&[&cloud]).with("output", &longest).report();
}
