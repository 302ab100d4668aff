//! `[output] height_offset`: numbers, models and grids of the geoid, and the warning about heights without one.

use std::fs;
use std::path::{Path, PathBuf};

use proj4rs::Proj;
use proj4rs::transform::transform;

use crate::coordinate_systems::{code, keys, warnings, write};
use crate::globe::{Source, Truth, distance, gaps, georeference, is_exact, square, utm};
use crate::program::Job;
use crate::tileset::{applied, keeps_the_rules, numbers, tiles};

/// Writes a geoid grid of `count` times `count` nodes around longitude 15, latitude 36, in steps of `step` degrees. A height that is no
/// number means that there is none.
fn write_grid_of(path: &Path, count: i32, step: f64, height: impl Fn(f64, f64) -> f64) {
    let corner = [36.0, 15.0].map(|middle: f64| middle - f64::from(count - 1) / 2.0 * step);
    let head = [corner[0], corner[1], step, step].into_iter().flat_map(f64::to_be_bytes);
    let size = [count; 2].into_iter().flat_map(i32::to_be_bytes);
    let at = |i: i32| height(corner[1] + f64::from(i % count) * step, corner[0] + f64::from(i / count) * step) as f32;
    let heights = (0..count * count).flat_map(|i| if at(i).is_nan() { -88.8888 } else { at(i) }.to_be_bytes());
    fs::write(path, head.chain(size).chain(heights).collect::<Vec<u8>>()).unwrap();
}

/// Writes a geoid grid from longitude 13 to 17 and latitude 34 to 38, in steps of half a degree.
fn write_grid(path: &Path, height: impl Fn(f64, f64) -> f64) {
    write_grid_of(path, 9, 0.5, height);
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

/// Returns the greatest distance between where a job puts a vertex of an exact tile and where it belongs, if `geoid` says what its height
/// counts from, by longitude and latitude.
fn off(job: &Job, geoid: impl Fn(f64, f64) -> f64) -> f64 {
    let proj = |text: &str| Proj::from_proj_string(text).unwrap();
    let (utm, degrees) = (proj("+proj=utm +zone=33 +datum=WGS84"), proj("+proj=longlat +datum=WGS84"));
    let (truth, source) = (Truth::new(), Source::of(job));
    let mut off = 0.0f64;
    for tile in tiles(job).iter().filter(|tile| is_exact(tile)) {
        for (at, place) in source.corners(job, tile) {
            let mut there = (at[0], at[1], 0.0);
            transform(&utm, &degrees, &mut there).unwrap();
            let height = geoid(there.0.to_degrees(), there.1.to_degrees());
            off =
                off.max(distance(applied(&tile.placed, place), truth.place([0.0; 3], [at[0], at[1], at[2] + height])));
        }
    }
    off
}

/// The earth is curved and the geoid slopes: every vertex is where both have it, and another geoid is the same mesh.
#[test]
fn tiles_follow_the_slope_of_the_geoid() {
    let folder = tempfile::tempdir().unwrap();
    // Linear, so that it is known between the nodes; nine metres over the area.
    let geoid = |longitude: f64, latitude: f64| 30.0 + 10.0 * (longitude - 15.0) - 20.0 * (latitude - 36.0);
    // A small area is flat and has one transform; plain tiles of a wide one are bent along the vertical, packed ones along all axes.
    for (half, compression, is_curved) in
        [(2_000.0, "meshopt", false), (20_000.0, "meshopt", true), (20_000.0, "none", true)]
    {
        let cloud = cloud(folder.path(), &square(60, half, [0.0; 2]));
        let job = |offset: &str| {
            let look = format!("format = \"3dtiles\"\ncompression = \"{compression}\"\nheight_offset = {offset}");
            let job = Job::on(&[&cloud]).tiles_of(300).with("output", &look);
            write_grid(&job.folder().join("slope.gtx"), geoid);
            let digest = job.report()["vertex_digest"].clone();
            job.verified();
            let tiles = tiles(&job);
            keeps_the_rules(&job, &tiles);
            assert_eq!(gaps(&job, &tiles).0, 0.0, "{half} m, {compression}");
            (job, digest)
        };
        let ((sloping, digest), (_flat, other)) = (job("\"slope.gtx\""), job("0.0"));
        assert!(digest.is_string() && digest == other, "{digest} {other}");
        let globe = georeference(&sloping, "globe");
        assert_eq!(globe["curved"], is_curved, "{half} m, {compression}");
        let (off, promise) = (off(&sloping, geoid), globe["distortion_m"].as_f64().unwrap());
        assert!(off <= promise + 0.015 && promise < 0.7, "{half} m, {compression}: {off} m off, promised {promise}");
    }
}

/// The box of a round area has corners where it has no points, and this grid no heights.
#[test]
fn a_grid_may_lack_the_corners_of_a_wide_area() {
    let folder = tempfile::tempdir().unwrap();
    let round: Vec<[i32; 3]> = square(90, 20_000.0, [0.0; 2])
        .into_iter()
        .filter(|[x, y, _]| f64::from(*x).hypot(f64::from(*y)) < 2_000_000.0)
        .collect();
    let cloud = cloud(folder.path(), &round);
    let away = |longitude: f64, latitude: f64| [(longitude - 15.0) * 90_000.0, (latitude - 36.1447) * 111_000.0];
    // A hill of the geoid, five metres high and 40 km wide.
    let height = |longitude: f64, latitude: f64| {
        let [east, north] = away(longitude, latitude);
        let share = east.hypot(north) / 20_000.0;
        20.0 + 5.0 * (1.0 - share * share / 2.0)
    };
    // Sideways, heights of 200 m are 0.3 m apart at the ends.
    for (compression, near) in [("meshopt", 0.15), ("quantized", 0.5)] {
        let look = format!("format = \"3dtiles\"\ncompression = \"{compression}\"\nheight_offset = \"round.gtx\"");
        let job = Job::on(&[&cloud]).tiles_of(300).with("output", &look);
        write_grid_of(&job.folder().join("round.gtx"), 101, 0.01, |longitude, latitude| {
            let [east, north] = away(longitude, latitude);
            if east.hypot(north) > 24_000.0 { f64::NAN } else { height(longitude, latitude) }
        });
        job.report();
        job.verified();
        let (off, globe) = (off(&job, height), georeference(&job, "globe"));
        let promise = globe["distortion_m"].as_f64().unwrap();
        eprintln!("{compression}: {off} m off, promised {promise} m");
        assert!(globe["curved"] == true && off < near, "{compression}: {off} m off, promised {promise}");
        assert_eq!(gaps(&job, &tiles(&job)).0, 0.0, "{compression}");
    }
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
    for (path, words) in
        [(&silent, "vertical datum and unit unknown"), (&coded("navd88.las", 5703), "heights are above EPSG:5703")]
    {
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

#[test]
fn heights_beside_feet_are_warned_of_until_their_unit_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let feet = write(folder.path(), "feet.las", &[code(2992)]);
    for settled in ["height_offset = 0.0", "height_offset = \"egm96\"", "format = \"glb\""] {
        // Only the unit of this system is of interest: the points are not where it is used.
        let job = || Job::on(&[&feet]).with("input", "outside_crs_area = \"warn\"").with("output", settled);
        let said = warnings(&job().report());
        assert!(said.contains("height unit unknown") && said.contains("(foot)"), "{settled}: {said}");
        assert!(!said.contains("height_offset"), "{settled}: {said}");
        let known = warnings(&job().with("input", "height_unit = \"foot\"").report());
        assert!(!known.contains("height unit") && !known.contains("height_offset"), "{settled}: {known}");
    }
    let oregon = folder.path().join("oregon.csv");
    let rows =
        square(6, 500.0, [0.0; 2]).into_iter().map(|[x, y, z]| format!("{},{},{z}\n", 1_000_000 + x, 900_000 + y));
    fs::write(&oregon, "x,y,z\n".to_string() + &rows.collect::<String>()).unwrap();
    let moved = || {
        let job = Job::on(&[&oregon]).with("input", "crs = \"EPSG:2992\"\nto_crs = \"EPSG:26910\"");
        job.with("output", "height_offset = 0.0")
    };
    let said = warnings(&moved().report());
    assert!(said.contains("its heights have no unit: the unit of its x and y (foot) is assumed"), "{said}");
    assert_eq!(warnings(&moved().with("input", "height_unit = \"metre\"").report()), "[]");
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
