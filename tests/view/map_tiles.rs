//! `terrain.pmtiles` in MapLibre, as a user has it: the page is on another server, and `gdt-batch view --cors` serves the archive.

use std::path::Path;
use std::process::Command;

use crs::GlobeWay;
use crs::from_wkt::from_epsg;
use serde_json::{Value, json};

use crate::rig::{Server, Terrain, chromium, point};

/// A slope: point number `i`, `j` of the rough grid, with the height of a plane, in hundredths of a unit.
fn slope(i: i64, j: i64) -> [i64; 3] {
    let [x, y, _] = point(i, j);
    [x, y, height([x, y])]
}

/// Returns the height of the plane to the next hundredth: it rises by 20 % to the east and 10 % to the south.
fn height([x, y]: [i64; 2]) -> i64 {
    20_000 + ((x - 50_000_000) * 2 - (y - 480_000_000)).div_euclid(10)
}

#[test]
fn maplibre_shows_the_terrain_at_its_heights() {
    let Some(chromium) = chromium() else { return };
    let npm = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm");
    if !["maplibre-gl", "pmtiles"].iter().all(|package| npm.join("node_modules").join(package).is_dir()) {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no MapLibre in tests/npm");
        eprintln!("not tested: no MapLibre; run `npm ci` in tests/npm, or tests/run");
        return;
    }
    let crs = from_epsg(32610).unwrap();
    let way = GlobeWay::of(&crs, &crs.proj4_definition().unwrap(), 1.0).unwrap();
    let places: Vec<[i64; 2]> =
        [[20, 20], [35, 50], [50, 30]].map(|[i, j]| [50_000_000 + 300 * i, 480_000_000 + 300 * j]).into();
    let degrees = |place: &[i64; 2]| {
        way.geographic(place.map(|hundredths| hundredths as f64 / 100.0)).unwrap().map(f64::to_degrees)
    };
    for encoding in ["terrarium", "terrain-rgb"] {
        let raster = format!("raster = {{ resolution = 1, pmtiles = \"{encoding}\" }}");
        let terrain = Terrain::of(&slope, "crs = \"EPSG:32610\"", &raster);
        let server = Server::with(&terrain.out(), &["--cors"]);
        let request = json!({
            "places": places.iter().map(degrees).collect::<Vec<_>>(),
            "archive": format!("{}terrain.pmtiles", server.url),
        });
        let path = terrain.folder.path().join("request.json");
        std::fs::write(&path, request.to_string()).unwrap();
        let output = Command::new("node")
            .arg(npm.join("view.mjs"))
            .args([&terrain.out(), &chromium, &terrain.picture()])
            .arg("maplibre")
            .arg(path)
            .output();
        let output = output.expect("node runs");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
        let seen: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&seen["complaints"], &seen["tileSize"]), (&json!([]), &json!(512)), "{seen}");
        let heights = seen["heights"].as_array().unwrap();
        for (found, place) in heights.iter().zip(&places) {
            let expected = height(*place) as f64 / 100.0;
            // MapLibre reads a pixel up to half a pixel beside its place.
            assert!((found.as_f64().unwrap() - expected).abs() < 0.25, "{encoding}: {found} {expected}");
        }
    }
}
