//! Viewers open what a job wrote and show all of it in the right place: three.js and CesiumJS in a headless browser, and Blender on
//! request.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use tiles::tiles3d::globe::relative_transform;

use crate::breaklines::Survey;
use crate::clouds;
use crate::common::shared;
use crate::globe::{is_exact as is_leaf, wide, wide_in_many_tiles};
use crate::levels::hills;
use crate::program::{Job, number};
use crate::random::Random;
use crate::terrain_tiles::hills_in_utm;
use crate::tileset::{Tile, applied, extent, files_below, keeps_the_rules, tiles, triangles};
use crate::validator::validate;

/// Returns the path of Chromium, or `None` if it or an npm package is missing. Under tests/run that is a failure.
fn chromium() -> Option<PathBuf> {
    let npm = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm/node_modules");
    let is_there = ["three", "3d-tiles-renderer", "cesium"].iter().all(|package| npm.join(package).is_dir());
    let found = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].map(PathBuf::from).into_iter().find(|p| p.exists());
    if found.is_none() || !is_there {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no Chromium, or no three.js or CesiumJS in tests/npm");
        eprintln!("not tested: no Chromium, or no three.js or CesiumJS; run `npm ci` in tests/npm, or tests/run");
        return None;
    }
    found
}

/// Writes a file that asks for the heights at `places`, and returns its path.
fn request(job: &Job, places: &[[f64; 3]]) -> PathBuf {
    let places: Vec<[f64; 2]> = places.iter().map(|p| [p[0], p[1]]).collect();
    asked(job, &json!({"places": places}))
}

fn asked(job: &Job, request: &Value) -> PathBuf {
    let path = job.folder().join("request.json");
    std::fs::write(&path, request.to_string()).unwrap();
    path
}

/// Opens the output of the job in a page of tests/npm. Returns what the page shows, with the heights at `places`.
#[track_caller]
fn seen(job: &Job, chromium: &Path, page: &str, places: &[[f64; 3]]) -> Value {
    answered(job, chromium, page, &request(job, places))
}

/// Opens the output of the job in a page of tests/npm. Returns what the page answers to the request in a file.
#[track_caller]
fn answered(job: &Job, chromium: &Path, page: &str, request: &Path) -> Value {
    let screenshot = job.folder().join("screenshot.png");
    let view = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm/view.mjs");
    let output =
        Command::new("node").arg(view).arg(job.out()).arg(chromium).arg(&screenshot).arg(page).arg(request).output();
    let output = output.expect("node runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    // The picture of this page has a third of the pixels.
    let least = if page == "terrain" { 3_000 } else { 10_000 };
    assert!(std::fs::metadata(&screenshot).unwrap().len() > least, "the picture is empty");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Returns the middles of a dozen triangles of the finest mesh, in the frame of the root.
fn middles(job: &Job, tiles: &[Tile]) -> Vec<[f64; 3]> {
    let mut random = Random(4);
    let middle = |_| {
        let leaf = tiles[0].leaves[random.below(tiles[0].leaves.len() as u64) as usize];
        let mesh = triangles(job, &tiles[leaf]);
        let t = mesh[random.below(mesh.len() as u64) as usize];
        let middle = [0, 1, 2].map(|k| (t[0][k] + t[1][k] + t[2][k]) / 3.0);
        applied(&relative_transform(&tiles[0].placed, &tiles[leaf].placed), middle)
    };
    (0..12).map(middle).collect()
}

/// Asserts that the view has all triangles of the finest mesh, and the expected heights.
#[track_caller]
fn is_exact(view: &Value, report: &Value, expected: &[[f64; 3]]) {
    assert_eq!(view["triangles"], report["triangles"]);
    let heights = view["heights"].as_array().unwrap();
    assert_eq!(heights.len(), expected.len());
    for (height, place) in heights.iter().zip(expected) {
        let height = height.as_f64().unwrap_or_else(|| panic!("nothing at {place:?}"));
        assert!((height - place[2]).abs() < 0.02, "{height} at {place:?}");
    }
}

/// Returns the least and the greatest x, y and z of the triangles of `tiles`, which have one transform.
fn box_of<'a>(job: &Job, tiles: impl Iterator<Item = &'a Tile>) -> [[f64; 3]; 2] {
    let corners: Vec<[f64; 3]> = tiles.flat_map(|tile| triangles(job, tile)).flatten().collect();
    let ends = |of: fn(f64, f64) -> f64| [0, 1, 2].map(|k| corners.iter().map(|p| p[k]).reduce(of).unwrap());
    [ends(f64::min), ends(f64::max)]
}

/// Asserts that the view has the bounds of the exact tiles, and that the box of the root is that of all tiles: coarser ones have skirts.
#[track_caller]
fn is_as_large(view: &Value, job: &Job, tiles: &[Tile]) {
    let found: [[f64; 3]; 2] = serde_json::from_value(view["box"].clone()).unwrap();
    let are_near =
        |a: [[f64; 3]; 2], b: [[f64; 3]; 2]| (0..6).all(|k| (a.as_flattened()[k] - b.as_flattened()[k]).abs() < 0.02);
    let exact = box_of(job, tiles.iter().filter(|tile| is_leaf(tile)));
    assert!(are_near(found, exact), "{found:?} {exact:?}");
    let (root, all) = (extent(&tiles[0].json), box_of(job, tiles.iter()));
    assert!(are_near(root, all), "{root:?} {all:?}");
}

/// Asserts that the view has only the content of the root.
#[track_caller]
fn is_coarsest(view: &Value, job: &Job, tiles: &[Tile]) {
    assert_eq!(number(&view["triangles"]), triangles(job, &tiles[0]).len() as u64);
    assert_eq!(number(&view["meshes"]), 1);
}

#[track_caller]
fn shows(job: &Job, chromium: &Path) {
    let report = job.report();
    let tiles = tiles(job);
    keeps_the_rules(job, &tiles);
    validate(&job.out(), tiles.len());
    let places = middles(job, &tiles);
    let seen = seen(job, chromium, "view", &places);
    is_exact(&seen["fine"], &report, &places);
    is_coarsest(&seen["coarse"], job, &tiles);
    assert_eq!(seen["file"].is_null(), !job.out().join("terrain.glb").exists());
    if !seen["file"].is_null() {
        is_exact(&seen["file"], &report, &places);
    }
    is_as_large(&seen["fine"], job, &tiles);
}

#[test]
fn a_browser_shows_the_tileset_and_the_file() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills(20_000, 3));
    let packed = "max_points_per_level_tile = 2000\ncompression = \"meshopt\"";
    shows(&Job::on(&[cloud]).tiles_of(2_000).with("output", packed), &chromium);
    if let Some(job) = stadium() {
        shows(&job, &chromium);
    }
}

/// Returns a job on a real cloud with a coordinate system, in a few tiles.
fn stadium() -> Option<Job> {
    let cloud = shared()?.join("data/autzen_trim.las");
    Some(Job::on(&[cloud]).tiles_of(6_000).with("output", "max_points_per_level_tile = 6000"))
}

#[test]
fn a_browser_shows_the_tileset_on_the_globe() {
    let (Some(chromium), Some(job)) = (chromium(), stadium()) else { return };
    let report = job.report();
    let tiles = tiles(&job);
    let seen = seen_on_the_globe(&job, &report, &tiles, &chromium);
    let centre: [f64; 3] = serde_json::from_value(seen["centre"].clone()).unwrap();
    // The middle of the exact tiles is at 141.2 m. Skirts of coarser ones reach below them.
    let middle = |ends: [[f64; 3]; 2]| (ends[0][2] + ends[1][2]) / 2.0;
    let skirts = middle(extent(&tiles[0].json)) - middle(box_of(&job, tiles.iter().filter(|tile| is_leaf(tile))));
    let expected = [-123.0712, 44.0507, 141.2 + skirts];
    assert!((0..3).all(|k| (centre[k] - expected[k]).abs() < [2e-4, 2e-4, 1.0][k]), "{centre:?}");
}

#[test]
fn a_browser_shows_a_wide_area_on_the_globe() {
    let Some(chromium) = chromium() else { return };
    let (job, tiles) = wide();
    let report: Value = serde_json::from_slice(&std::fs::read(job.out().join("report.json")).unwrap()).unwrap();
    seen_on_the_globe(&job, &report, &tiles, &chromium);
}

/// Both viewers open a tileset of external tilesets, whose transforms lead from file to file.
#[test]
fn browsers_show_a_tileset_of_external_tilesets() {
    let Some(chromium) = chromium() else { return };
    let (job, tiles) = wide_in_many_tiles();
    assert!(files_below(&job.out().join("tilesets")).len() > 1);
    let report: Value = serde_json::from_slice(&std::fs::read(job.out().join("report.json")).unwrap()).unwrap();
    seen_on_the_globe(&job, &report, &tiles, &chromium);
    let places = middles(&job, &tiles);
    let seen = seen(&job, &chromium, "view", &places);
    assert_eq!(seen["fine"]["triangles"], report["triangles"]);
    is_coarsest(&seen["coarse"], &job, &tiles);
    let heights = seen["fine"]["heights"].as_array().unwrap();
    assert!(heights.len() == places.len() && heights.iter().all(Value::is_number), "{heights:?}");
}

/// The west of the area is ground that reflects little, the east is bright water. CesiumJS finds both properties, and shades by them.
#[test]
fn cesium_styles_by_class_and_intensity() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from("x,y,z,class,intensity\n");
    for [x, y, z] in hills(8_000, 3) {
        let look = if x < 10_000 { "2,6554" } else { "9,52429" };
        text += &format!("{},{},{},{look}\n", 500_000 + x / 10, 4_900_000 + y / 10, z / 10);
    }
    let cloud = folder.path().join("cloud.csv");
    std::fs::write(&cloud, text).unwrap();
    for compression in ["none", "meshopt"] {
        let output = format!(
            "attributes = [\"classification\", \"intensity\"]\ncompression = \"{compression}\"\nmax_points_per_level_tile = 1000\n\
             format = \"3dtiles\""
        );
        let job = Job::on(&[&cloud]).tiles_of(1_000).with("output", &output).with("input", "crs = \"EPSG:32610\"");
        job.report();
        job.verified();
        let request = asked(&job, &json!({"places": [], "pixels": [[150, 150], [250, 150]]}));
        let seen = answered(&job, &chromium, "cesium", &request);
        assert_eq!(seen["complaints"], json!([]), "{compression}");
        let found = &seen["attributes"];
        assert_eq!(
            (&found["schema"], &found["properties"]),
            (&json!("gdt_batch"), &json!(["classification", "intensity"]))
        );
        let shown: Vec<[i64; 2]> = serde_json::from_value(found["shown"].clone()).unwrap();
        // Linear 0.1 and 0.8 of the greatest intensity, and a tenth of the classes, as sRGB shows them.
        for (shown, wanted) in shown.as_flattened().iter().zip([89, 124, 231, 243]) {
            assert!((shown - wanted).abs() <= 2, "{compression}: {shown} for {wanted}");
        }
    }
}

/// Returns a job on hills with terrain tiles in a scheme.
fn hills_for_globes(folder: &Path, scheme: &str) -> Job {
    let cloud = clouds::write(folder, "cloud.csv", &hills_in_utm(40_000));
    let terrain = format!("terrain = {{ format = \"quantized-mesh\", scheme = \"{scheme}\" }}");
    let output = "format = \"3dtiles\"\nheight_offset = 40.0\nhull = \"whole\"";
    Job::on(&[&cloud])
        .tiles_of(3_000)
        .with("input", "crs = \"EPSG:32633\"")
        .with("output", output)
        .with("output", &terrain)
}

/// Returns twenty directions to look at a terrain from, near it and so far that the surroundings are seen too: heading and pitch in degrees, and
/// the distance in metres.
fn views(seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * random.below(1_000) as f64 / 1_000.0;
    (0..20).map(|_| [between(0.0, 360.0), between(-85.0, -35.0), 300.0 * 30f64.powf(between(0.0, 1.0))]).collect()
}

/// Opens the terrain tiles of a job in a page, asserts that all pixels of all views are covered, and returns what the page answers.
#[track_caller]
fn covered(job: &Job, chromium: &Path, page: &str, places: &[[f64; 3]], views: &[[f64; 3]]) -> Value {
    let request = asked(job, &json!({"places": places, "views": views}));
    let seen = answered(job, chromium, page, &request);
    assert_eq!(seen["complaints"], json!([]), "{page}");
    let background: Vec<u64> = serde_json::from_value(seen["background"].clone()).unwrap();
    assert!(background.len() >= views.len() && background.iter().all(|pixels| *pixels == 0), "{page}: {background:?}");
    seen
}

/// CesiumJS drapes imagery over terrain tiles of both schemes, finds the heights of the mesh in them, and shows no hole in twenty views of each, nor on the
/// other side of the globe. 3d-tiles-renderer shows none either.
#[test]
fn viewers_take_their_ground_from_terrain_tiles() {
    let Some(chromium) = chromium() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut step = 0.0;
    for (seed, scheme, projection) in [(3, "geographic", "EPSG:4326"), (4, "web-mercator", "EPSG:3857")] {
        let job = hills_for_globes(folder.path(), scheme);
        let report = job.report();
        let places = middles(&job, &tiles(&job));
        let seen = covered(&job, &chromium, "terrain", &places, &views(seed));
        assert_eq!((&seen["hasNormals"], &seen["hasWaterMask"]), (&json!(true), &json!(false)));
        assert_eq!(seen["isWebMercator"], json!(projection == "EPSG:3857"));
        let off: Vec<f64> = serde_json::from_value(seen["off"].clone()).unwrap();
        assert!(off.len() == 12 && off.iter().all(|off| off.abs() < 0.05), "{scheme}: {off:?}");
        let zooms = report["terrain"]["zooms"].as_array().unwrap();
        assert_eq!(seen["zoom"].as_u64().unwrap() + 1, zooms.len() as u64);
        found.push(serde_json::from_value(seen["heights"].clone()).unwrap());
        step += zooms.last().unwrap()["height_step"].as_f64().unwrap();

        // Farther away, a few pixels are gaps beside tiles that it has split where there are no finer ones.
        let near: Vec<[f64; 3]> = (0..8).map(|turn| [f64::from(45 * turn), -60.0, 400.0]).collect();
        let seen = covered(&job, &chromium, "quantized", &places, &near);
        assert_eq!(seen["projection"], projection);
        let off: Vec<f64> = serde_json::from_value(seen["off"].clone()).unwrap();
        assert!(off.len() == 12 && off.iter().all(|off| off.abs() < 0.05), "{scheme}: {off:?}");
    }
    // Half a step of each, and as much as the ground rises over half a step across: slopes are below 45 degrees.
    let across = 0.01;
    let apart = found[0].iter().zip(&found[1]).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    assert!(apart <= step / 2.0 + across, "{apart}, {step}");
}

/// The water mask of lakes arrives in CesiumJS, in both schemes.
#[test]
fn cesium_gets_the_water_mask_of_lakes() {
    let Some(chromium) = chromium() else { return };
    let survey = Survey::new(6_000);
    for scheme in ["geographic", "web-mercator"] {
        let terrain =
            format!("height_offset = 40.0\nterrain = {{ format = \"quantized-mesh\", scheme = \"{scheme}\" }}");
        let job = survey.job().with("output", &terrain);
        job.run().succeeded();
        // In the lake, on its island, and beside it: metres from the origin of the survey, and from the middle of the scene.
        let georeference: Value =
            serde_json::from_slice(&std::fs::read(job.out().join("georeference.json")).unwrap()).unwrap();
        let offset = [0, 1, 2].map(|axis| georeference["offset"][axis].as_f64().unwrap());
        let local = |[x, y, z]: [f64; 3]| [500_000.0 + x - offset[0], 4_000_000.0 + y - offset[1], z - offset[2]];
        let places = [[100.0, 85.0, 10.0], [130.0, 110.0, 10.0], [112.0, 105.0, 10.0], [60.0, 60.0, 15.0]].map(local);
        let seen = covered(&job, &chromium, "terrain", &places, &views(5)[..3]);
        assert_eq!((&seen["hasWaterMask"], &seen["masks"]), (&json!(true), &json!([255, 255, 0, 0])), "{scheme}");
    }
}

#[track_caller]
fn seen_on_the_globe(job: &Job, report: &Value, tiles: &[Tile], chromium: &Path) -> Value {
    let places = middles(job, tiles);
    let seen = seen(job, chromium, "cesium", &places);
    is_exact(&seen["fine"], report, &places);
    is_coarsest(&seen["coarse"], job, tiles);
    seen
}

/// This takes minutes on a software GPU, so it runs only with GDT_TEST_LARGE=1.
#[test]
fn a_browser_shows_the_large_file() {
    let (Some(chromium), Some(data)) = (chromium(), shared()) else { return };
    if std::env::var_os("GDT_TEST_LARGE").is_none() {
        eprintln!("not tested: autzen.laz in a browser; set GDT_TEST_LARGE=1");
        return;
    }
    shows(&Job::on(&[data.join("data/autzen.laz")]).with("output", "format = \"3dtiles\""), &chromium);
}

/// This needs Blender's module `bpy`: GDT_BPY names a Python that has it.
#[test]
fn blender_opens_the_file() {
    let Some(python) = std::env::var_os("GDT_BPY") else {
        eprintln!("not tested: Blender; set GDT_BPY to a Python that has the module bpy");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &hills(20_000, 3));
    for compression in ["none", "quantized", "meshopt"] {
        let look = format!("compression = \"{compression}\"");
        let job = Job::on(&[&cloud]).tiles_of(2_000).with("output", &look);
        let report = job.report();
        let tiles = tiles(&job);
        let places = middles(&job, &tiles);
        let request = request(&job, &places);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/blender.py");
        let output = Command::new(&python).arg(script).arg(job.out().join("terrain.glb")).arg(request).output();
        let output = output.expect("GDT_BPY runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
        // Blender prints lines of its own before.
        let seen: Value = serde_json::from_str(text(&output.stdout).lines().last().unwrap()).unwrap();
        is_exact(&seen, &report, &places);
        is_as_large(&seen, &job, &tiles);
    }
}
