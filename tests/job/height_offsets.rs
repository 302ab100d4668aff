//! `[output] height_offset`: numbers, models and grids of the geoid, and the warning about heights without one.

use std::fs;
use std::path::{Path, PathBuf};

use proj4rs::Proj;
use proj4rs::transform::transform;

use crate::coordinate_systems::{code, keys, warnings, write};
use crate::globe::{Truth, distance, georeference, is_exact, square, utm};
use crate::program::Job;
use crate::tileset::{applied, numbers, tiles, triangles};

/// Writes a geoid grid from longitude 13 to 17 and latitude 34 to 38, in steps of half a degree.
fn write_grid(path: &Path, height: impl Fn(f64, f64) -> f64) {
    let head = [34.0f64, 13.0, 0.5, 0.5].into_iter().flat_map(f64::to_be_bytes);
    let size = [9i32, 9].into_iter().flat_map(i32::to_be_bytes);
    let at = |i: usize| height(13.0 + (i % 9) as f64 * 0.5, 34.0 + (i / 9) as f64 * 0.5) as f32;
    let heights = (0..81).flat_map(|i| at(i).to_be_bytes());
    fs::write(path, head.chain(size).chain(heights).collect::<Vec<u8>>()).unwrap();
}

fn cloud(folder: &Path, points: &[[i32; 3]]) -> PathBuf {
    let path = folder.join("cloud.las");
    fs::write(&path, utm(points)).unwrap();
    path
}

/// Returns the origin of the scene on the globe, and what `georeference.json` says of the heights.
fn placed(job: &Job) -> ([f64; 3], f64, serde_json::Value) {
    let globe = georeference(job, "globe");
    let transform: [f64; 16] = numbers(&globe["transform"]).unwrap();
    ([transform[12], transform[13], transform[14]], globe["height_offset"].as_f64().unwrap(), globe["geoid"].clone())
}

#[test]
fn a_terrain_is_raised_by_the_number_the_model_or_the_grid() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = cloud(folder.path(), &square(40, 500.0, [0.0; 2]));
    let job = |offset: &str| {
        let job = Job::on(&[&cloud]).with("output", &format!("format = \"3dtiles\"\nheight_offset = {offset}"));
        write_grid(&job.folder().join("flat.gtx"), |_, _| 12.25);
        assert!(!warnings(&job.report()).contains("height_offset"), "{offset}");
        job
    };
    let (zero, none, _) = placed(&job("0.0"));
    assert_eq!(none, 0.0);
    for (offset, model, least, most) in [
        ("30", serde_json::Value::Null, 30.0, 30.0),
        ("-2.5", serde_json::Value::Null, -2.5, -2.5),
        // The path counts from the configuration.
        ("\"flat.gtx\"", "flat.gtx".into(), 12.25, 12.25),
        // South of Sicily.
        ("\"egm96\"", "egm96".into(), 30.0, 45.0),
    ] {
        let (place, raised, said) = placed(&job(offset));
        assert!(said == model && (least..=most).contains(&raised), "{offset}: {raised} {said}");
        let moved = distance(zero, place);
        assert!((moved - raised.abs()).abs() < 1e-3, "{offset}: {moved}, {raised}");
        let away = place.iter().map(|v| v * v).sum::<f64>() - zero.iter().map(|v| v * v).sum::<f64>();
        assert_eq!(away > 0.0, raised > 0.0, "{offset}");
    }
}

/// The earth is curved and the geoid slopes: every tile is where both have it.
#[test]
fn tiles_follow_the_slope_of_the_geoid() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = cloud(folder.path(), &square(60, 20_000.0, [0.0; 2]));
    // Linear, so that it is known between the nodes; eleven metres over the area.
    let geoid = |longitude: f64, latitude: f64| 30.0 + 10.0 * (longitude - 15.0) - 20.0 * (latitude - 36.0);
    let job = |offset: &str| {
        let job =
            Job::on(&[&cloud]).tiles_of(300).with("output", &format!("format = \"3dtiles\"\nheight_offset = {offset}"));
        write_grid(&job.folder().join("slope.gtx"), geoid);
        job.report();
        job.verified();
        job
    };
    let (sloping, flat) = (job("\"slope.gtx\""), job("0.0"));
    let promise = georeference(&sloping, "globe")["distortion_m"].as_f64().unwrap();
    let offset: [f64; 3] = numbers(&georeference(&sloping, "offset")).unwrap();
    let truth = Truth::new();
    let proj = |text: &str| Proj::from_proj_string(text).unwrap();
    let (utm, degrees) = (proj("+proj=utm +zone=33 +datum=WGS84"), proj("+proj=longlat +datum=WGS84"));
    let (mut off, mut wrong, mut low, mut high) = (0.0f64, 0.0f64, f64::MAX, f64::MIN);
    for (tile, without) in tiles(&sloping).iter().zip(tiles(&flat)).filter(|(tile, _)| is_exact(tile)) {
        for place in triangles(&sloping, tile).into_iter().flatten() {
            let mut at = (offset[0] + place[0], offset[1] + place[1], 0.0);
            transform(&utm, &degrees, &mut at).unwrap();
            let height = geoid(at.0.to_degrees(), at.1.to_degrees());
            (low, high) = (low.min(height), high.max(height));
            let found = applied(&tile.placed, place);
            off = off.max(distance(found, truth.place(offset, [place[0], place[1], place[2] + height])));
            wrong = wrong.max((distance(found, applied(&without.placed, place)) - height).abs());
        }
    }
    assert!(high - low > 8.0, "{low} {high}");
    // Besides the curve of the earth, which flat tiles do not follow, nothing is off.
    assert!(off <= promise + 0.01 && wrong < 0.02, "{off} m off, promised {promise}; {wrong} m by the geoid");
}

#[test]
fn a_grid_that_does_not_suit_is_refused_before_the_job_begins() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = cloud(folder.path(), &square(20, 500.0, [0.0; 2]));
    // This place is far from the grid.
    let far = write(folder.path(), "far.las", &[code(26915)]);
    let with = |cloud: &PathBuf, name: &str| {
        let job = Job::on(&[cloud]).with("output", &format!("height_offset = \"{name}\""));
        write_grid(&job.folder().join("grid.gtx"), |_, _| 12.0);
        fs::write(job.folder().join("short.gtx"), [0; 20]).unwrap();
        fs::write(job.folder().join("text.tif"), "geoid").unwrap();
        job
    };
    for (cloud, name, words) in [
        (&cloud, "none.gtx", &["none.gtx", "correct its name"][..]),
        (&cloud, "short.gtx", &["short.gtx", "20 bytes"]),
        (&cloud, "text.tif", &["text.tif"]),
        (&far, "grid.gtx", &["grid.gtx has no height at longitude -9", "13.000 to 17.000", "egm96"]),
    ] {
        let job = with(cloud, name);
        job.run().refused(2, &[words, &["[output] height_offset"]].concat());
        job.run_with(&["check"]).refused(2, words);
        assert!(!job.out().exists(), "{name}");
    }
    for wrong in ["\"egm2008\"", "\"grid.asc\"", "true", "nan"] {
        let job = Job::on(&[&cloud]).with("output", &format!("height_offset = {wrong}"));
        job.run().refused(2, &["line", "height_offset is a number of metres", "egm96", ".gtx"]);
    }
    with(&cloud, "grid.gtx").report();
}

#[test]
fn heights_that_may_count_from_the_sea_are_warned_of_once_they_are_on_the_globe() {
    let folder = tempfile::tempdir().unwrap();
    let coded = |name: &str, heights: u16| {
        write(folder.path(), name, &[keys(&[[1024, 0, 1, 1], [3072, 0, 1, 26915], [4096, 0, 1, heights]])])
    };
    let silent = write(folder.path(), "silent.las", &[code(26915)]);
    for (path, words) in [(&silent, "no input says from what"), (&coded("navd88.las", 5703), "count from EPSG:5703")] {
        let job = Job::on(&[path]);
        let said = warnings(&job.report());
        assert!(said.contains(words) && said.contains("height_offset") && said.contains("egm96"), "{said}");
        let shown = Job::on(&[path]).run().succeeded();
        assert!(shown.out.contains(words) || shown.err.contains(words), "it is on the screen too: {shown:?}");
        for settled in ["height_offset = 0.0", "height_offset = \"egm96\"", "format = \"glb\""] {
            assert_eq!(warnings(&Job::on(&[path]).with("output", settled).report()), "[]", "{settled}");
        }
    }
    // The ellipsoid of WGS 84, and a plane that is nowhere.
    assert_eq!(warnings(&Job::on(&[&coded("ellipsoid.las", 5030)]).report()), "[]");
    let nowhere = write(folder.path(), "nowhere.las", &[]);
    assert!(!warnings(&Job::on(&[&nowhere]).report()).contains("height_offset"));
}

/// A grid counts by what it holds, wherever it lies.
#[test]
fn another_grid_makes_another_job_and_another_place_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = cloud(folder.path(), &square(10, 500.0, [0.0; 2]));
    let identity = |name: &str, height: f64| {
        let job = Job::on(&[&cloud]).with("output", &format!("height_offset = \"{name}\""));
        write_grid(&job.folder().join(name), |_, _| height);
        job.report()["options_fingerprint"].to_string()
    };
    let first = identity("a.gtx", 12.0);
    assert_eq!(first, identity("b.gtx", 12.0));
    assert_ne!(first, identity("a.gtx", 13.0));
}
