//! `[input] clip` keeps the points within polygons, decided on the lattice: the same whatever the tiles, and proved by `verify`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::breaklines::files::{Features, geopackage};
use crate::program::{Job, gdt_batch, number};
use crate::random::Random;
use crate::transformed::{las_of, way};

/// Where the survey lies, in EPSG:32633. Local coordinates are centimetres from here.
const ORIGIN: [f64; 2] = [500_000.0, 4_000_000.0];

/// The side of the survey in centimetres.
const SIDE: u64 = 16_000;

/// Rings in centimetres: the first is an outline, the others are holes.
type Polygon = Vec<Vec<[i64; 2]>>;

/// Random places on a slope, and those of all vertices of `polygons`, in centimetres.
fn places(count: usize, polygons: &[Polygon]) -> Vec<[i64; 2]> {
    let mut random = Random(11);
    let random = (0..count).map(|_| [0, 1].map(|_| random.below(SIDE + 1) as i64));
    let all: BTreeSet<[i64; 2]> = random.chain(polygons.iter().flatten().flatten().copied()).collect();
    all.into_iter().collect()
}

fn cloud(folder: &Path, places: &[[i64; 2]]) -> PathBuf {
    let row = |[x, y]: &[i64; 2]| {
        let [east, north] = [(*x, 0), (*y, 1)].map(|(at, axis)| ORIGIN[axis] + at as f64 / 100.0);
        format!("{east:.2},{north:.2},{:.2}\n", (x / 20 + y / 40) as f64 / 100.0)
    };
    let path = folder.join("cloud.csv");
    fs::write(&path, "x,y,z\n".to_string() + &places.iter().map(row).collect::<String>()).unwrap();
    path
}

/// Tells whether a place lies in a polygon, or on one of its edges.
fn is_inside(polygon: &Polygon, [x, y]: [i64; 2]) -> bool {
    let (mut is_inside, mut is_on_edge) = (false, false);
    for ring in polygon {
        for (i, a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            let turn = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            let in_box =
                (a[0].min(b[0])..=a[0].max(b[0])).contains(&x) && (a[1].min(b[1])..=a[1].max(b[1])).contains(&y);
            is_on_edge |= turn == 0 && in_box;
            is_inside ^= (a[1] > y) != (b[1] > y) && (turn > 0) == (b[1] > a[1]);
        }
    }
    is_inside || is_on_edge
}

fn count_inside(places: &[[i64; 2]], polygons: &[Polygon]) -> u64 {
    places.iter().filter(|place| polygons.iter().any(|polygon| is_inside(polygon, **place))).count() as u64
}

/// An area with bays, and another one that overlaps it.
fn two_areas() -> Vec<Polygon> {
    let star: Vec<[i64; 2]> = (0..24)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos();
            let far = if i % 2 == 0 { 5_500.0 } else { 2_500.0 };
            [8_000 + (far * cos) as i64, 8_000 + (far * sin) as i64]
        })
        .collect();
    vec![vec![star], vec![vec![[9_000, 9_000], [15_000, 9_500], [14_500, 15_000]]]]
}

/// Writes polygons as GeoJSON in degrees on WGS 84, one as a feature and the others as one of several polygons. Returns its path.
fn geojson(folder: &Path, name: &str, polygons: &[Polygon]) -> PathBuf {
    let way = way("EPSG:32633", "EPSG:4326");
    let vertex = |[x, y]: &[i64; 2]| way.apply([ORIGIN[0] + *x as f64 / 100.0, ORIGIN[1] + *y as f64 / 100.0]).unwrap();
    let ring = |ring: &Vec<[i64; 2]>| json!(ring.iter().chain(ring.first()).map(vertex).collect::<Vec<_>>());
    let polygon = |polygon: &Polygon| json!(polygon.iter().map(ring).collect::<Vec<_>>());
    let feature = |kind: &str, coordinates: Value| json!({"type": "Feature", "properties": {}, "geometry": {"type": kind, "coordinates": coordinates}});
    let rest: Vec<Value> = polygons[1..].iter().map(polygon).collect();
    let features = [feature("Polygon", polygon(&polygons[0])), feature("MultiPolygon", json!(rest))];
    let path = folder.join(name);
    fs::write(&path, json!({"type": "FeatureCollection", "features": features}).to_string()).unwrap();
    path
}

fn job(cloud: &Path, clip: &Path) -> Job {
    Job::on(&[cloud])
        .with("input", &format!("crs = \"EPSG:32633\"\nresolution = 0.01\nclip = {:?}", clip.to_str().unwrap()))
        .with("output", "format = \"3dtiles\"")
}

/// Returns a small job with an area, and the folder of its inputs.
pub(crate) fn clipped() -> (tempfile::TempDir, Job) {
    let folder = tempfile::tempdir().unwrap();
    let areas = two_areas();
    let cloud = cloud(folder.path(), &places(1_000, &areas));
    let job = job(&cloud, &geojson(folder.path(), "areas.geojson", &areas));
    (folder, job)
}

/// Proves the results of a job against its inputs.
#[track_caller]
fn proved(job: &Job, inputs: &[&Path]) -> Value {
    let names = inputs.iter().map(|input| input.to_str().unwrap());
    let arguments: Vec<&str> = ["verify", "out", "--json", "--input"].into_iter().chain(names).collect();
    let verdict = gdt_batch(job.folder(), &arguments).succeeded().json();
    assert_eq!(verdict["verdict"], "proved", "{verdict}");
    verdict
}

#[test]
fn the_points_within_several_areas_are_kept_whatever_the_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let areas = two_areas();
    let places = places(6_000, &areas);
    let (cloud, clip) = (cloud(folder.path(), &places), geojson(folder.path(), "areas.geojson", &areas));
    let mut first: Option<(Value, Value)> = None;
    for (sites, threads) in [(200, 4), (700, 1), (50_000, 2)] {
        let job = job(&cloud, &clip).tiles_of(sites).threads(threads);
        let report = job.report();
        let points = &report["points"];
        assert_eq!(number(&report["sites"]), count_inside(&places, &areas));
        let left_out = number(&points["out_of_bounds"]) + number(&points["outside_clip"]);
        assert_eq!(number(&points["kept"]) + left_out, number(&points["read"]));
        assert!(number(&points["outside_clip"]) > 1_000, "{points}");
        assert_eq!(number(&report["clip"]["vertices"]), 27);
        // The bays of the area are empty.
        let cut = number(&report["cut_triangles"]);
        assert!(cut > 50, "{cut} triangles");
        let verdict = proved(&job, &[&cloud]);
        assert_eq!(number(&verdict["cut"]), cut);
        let found = (verdict["digest"].clone(), json!(cut));
        assert_eq!(*first.get_or_insert(found.clone()), found, "{sites} sites a tile");
    }
}

/// Corners are rounded to a lattice that is finer than that of points: on a grid of metres, a border between rows stays there.
#[test]
fn corners_between_the_points_of_a_grid_keep_what_lies_within() {
    let folder = tempfile::tempdir().unwrap();
    let grid: Vec<[i64; 2]> = (0..20).flat_map(|x| (0..20).map(move |y| [100 * x, 100 * y])).collect();
    let square = vec![vec![vec![[50, 50], [1_049, 50], [1_049, 1_050], [50, 1_050]]]; 2];
    let (cloud, clip) = (cloud(folder.path(), &grid), geojson(folder.path(), "area.geojson", &square));
    let job = Job::on(&[&cloud])
        .with("input", &format!("crs = \"EPSG:32633\"\nresolution = 1.0\nclip = {:?}", clip.to_str().unwrap()));
    assert_eq!(number(&job.report()["sites"]), 100);
    proved(&job, &[&cloud]);
}

#[test]
fn holes_are_empty_and_another_polygon_starts_the_job_over() {
    let folder = tempfile::tempdir().unwrap();
    let square = |low: i64, high: i64| vec![[low, low], [high, low], [high, high], [low, high]];
    let with_hole = |hole: i64| vec![vec![square(2_000, 14_000), square(hole, 9_000)]];
    let places = places(3_000, &with_hole(6_000));
    let cloud = cloud(folder.path(), &places);
    let write = |hole: i64| {
        let metres =
            |ring: &Vec<[i64; 2]>| ring.iter().map(|[x, y]| [*x as f64 / 100.0, *y as f64 / 100.0, 0.0]).collect();
        let rings = with_hole(hole)[0].iter().map(metres).collect();
        geopackage(folder.path(), "area.gpkg", &Features::areas(&[("area", rings)]))
    };
    // Bounds hold as well.
    let job = job(&cloud, &write(6_000)).with("input", "bounds = [500000, 4000000, 500130, 4000500]");
    let kept = |hole: i64| {
        let in_bounds: Vec<[i64; 2]> = places.iter().copied().filter(|place| place[0] <= 13_000).collect();
        count_inside(&in_bounds, &with_hole(hole))
    };
    assert_eq!(number(&job.report()["sites"]), kept(6_000));
    proved(&job, &[&cloud]);
    write(3_000);
    assert!(kept(3_000) < kept(6_000));
    assert_eq!(number(&job.report()["sites"]), kept(3_000));
    proved(&job, &[&cloud]);
    // Large triangles of selected points do not lie in the hole.
    let coarse = job.with("output", "max_error = 0.008");
    assert!(number(&coarse.report()["cut_triangles"]) > 0);
    proved(&coarse, &[&cloud]);
}

/// A header far from the area spares reading the file. One that lies does not.
#[test]
fn files_outside_of_the_area_are_left_aside_unless_their_header_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |west: f64| -> Vec<[f64; 3]> {
        let place = |i: u32| [west + f64::from(i % 20), ORIGIN[1] + f64::from(i / 20), f64::from(i % 7)];
        (0..400).map(place).collect()
    };
    let here = las_of(folder.path(), &rows(ORIGIN[0]), "here.las", &[], 0.01);
    let far = las_of(folder.path(), &rows(ORIGIN[0] + 5_000.0), "far.las", &[], 0.01);
    let wrong = las_of(folder.path(), &rows(ORIGIN[0] + 0.5), "wrong.las", &[], 0.01);
    let mut bytes = fs::read(&wrong).unwrap();
    for (at, x) in [(179, ORIGIN[0] + 9_000.0), (187, ORIGIN[0] + 8_000.0)] {
        bytes[at..at + 8].copy_from_slice(&x.to_le_bytes());
    }
    fs::write(&wrong, bytes).unwrap();
    let area = vec![vec![vec![[-100, -100], [950, -100], [950, 950], [-100, 950]]]; 2];
    let clip = geojson(folder.path(), "area.geojson", &area);
    let alone = job(&here, &clip);
    let names = [&here, &far, &wrong];
    let job = Job::on(&names).with("input", &format!("crs = \"EPSG:32633\"\nclip = {:?}", clip.to_str().unwrap()));
    let report = job.report();
    // Ten columns and ten rows of the first file, and of the third, whose last column lies on the border.
    assert_eq!((number(&report["sites"]), number(&report["points"]["not_decoded"])), (200, 400));
    assert_eq!(number(&report["points"]["read"]), 1_200);
    proved(&job, &names.map(PathBuf::as_path));
    assert_eq!(number(&alone.report()["sites"]), 100);
}

#[test]
fn files_that_are_no_area_and_areas_without_points_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let square = vec![vec![vec![[0, 0], [9_000, 0], [9_000, 9_000], [0, 9_000]]]; 2];
    let cloud = cloud(folder.path(), &places(500, &square));
    let refused = |text: &str, code: i32, words: &[&str]| {
        let clip = folder.path().join("area.geojson");
        fs::write(&clip, text).unwrap();
        let words = [&["area.geojson"], words].concat();
        job(&cloud, &clip).run().refused(code, &words);
    };
    let ring = |ring: &str| format!(r#"{{"type": "Polygon", "coordinates": [{ring}]}}"#);
    refused(r#"{"type": "LineString", "coordinates": [[15, 36], [15.1, 36]]}"#, 3, &["has no polygon"]);
    refused(&ring("[[15, 36], [15.1, 36], [15, 36.1]]"), 3, &["feature 1 has a ring that is not closed", "(15, 36.1)"]);
    refused(&ring("[[15, 36], [15.1, NaN], [15, 36]]"), 3, &["NaN"]);
    refused(
        &ring("[[500000, 4000000], [500010, 4000000], [500000, 4000010], [500000, 4000000]]"),
        3,
        &["has no CRS", "-a_srs"],
    );
    let nowhere = r#"{"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::1"}}"#;
    let there = "[[15, 36], [15.1, 36], [15, 36.1], [15, 36]]";
    let unknown = format!(r#"{{"type": "Polygon", "crs": {nowhere}, "coordinates": [{there}]}}"#);
    refused(&unknown, 2, &["is in EPSG:1", "Transform the polygons first", "-a_srs"]);
    refused("no JSON", 3, &["is not a Shapefile, GeoPackage or GeoJSON", "polygons.gpkg"]);
    // No point of the survey is near: both boxes are told.
    let far = vec![vec![vec![[50_000, 0], [60_000, 0], [60_000, 9_000]]]; 2];
    let clip = geojson(folder.path(), "far.geojson", &far);
    let told = [
        "far.geojson) lie in [500",
        "500600.00, 4000090.00] in WGS 84 / UTM zone 33N",
        "the inputs lie in [500000.",
        "outside the bounds",
    ];
    let job = job(&cloud, &clip);
    job.run().refused(3, &told);
    job.run_with(&["check"]).refused(3, &told);
    let missing = Job::on(&[&cloud]).with("input", "crs = \"EPSG:32633\"\nclip = \"no.gpkg\"");
    missing.run().refused(2, &["[input] clip: there is no file", "no.gpkg"]);
}

#[test]
fn local_coordinates_take_a_clip_without_a_crs() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.csv");
    let rows: String =
        places(500, &[]).iter().map(|[x, y]| format!("{}.{},{}.{},1\n", x / 100, x % 9, y / 100, y % 9)).collect();
    fs::write(&cloud, format!("x,y,z\n{rows}")).unwrap();
    let clip = folder.path().join("area.geojson");
    let job = Job::on(&[&cloud]).with("input", &format!("crs = \"none\"\nclip = {:?}", clip.display().to_string()));
    // The first could be degrees.
    for (far, code, words) in [(80, 2, "the points are in a plane without a CRS"), (150, 3, "has no CRS")] {
        let area = |member: &str| {
            let ring = format!("[[10, 10], [{far}, 10], [{far}, {far}], [10, 10]]");
            fs::write(&clip, format!(r#"{{{member}"type": "Polygon", "coordinates": [{ring}]}}"#)).unwrap();
        };
        area("");
        job.run().refused(code, &[words, "write the member \"crs\": null into it"]);
        area(r#""crs": null, "#);
        let points = &job.report()["points"];
        assert!(number(&points["out_of_bounds"]) + number(&points["outside_clip"]) > 100, "{points}");
    }
}

#[test]
fn a_report_says_how_much_of_the_area_is_covered_and_the_next_job_what_it_replaces() {
    let folder = tempfile::tempdir().unwrap();
    let grid = folder.path().join("grid.csv");
    let rows = (0..11).flat_map(|x| (0..11).map(move |y| format!("{},{},{}\n", x * 10, y * 10, (x * y) % 5)));
    fs::write(&grid, format!("x,y,z\n{}", rows.collect::<String>())).unwrap();
    let on_grid = Job::on(&[&grid]).with("input", "bounds = [0, 0, 250, 100]").with("output", "hull = \"whole\"");
    let shown = on_grid.run().succeeded();
    assert!(shown.out.contains("covers    40 % of the bounds") && !shown.err.contains("replaces"), "{shown:?}");
    let again = on_grid.with("output", "normals = false").run().succeeded();
    assert!(again.err.contains("has a terrain with other options (200 triangles): this job replaces it"), "{again:?}");
    let (_cloud, clipped) = clipped();
    assert!(clipped.report()["covered_share"].is_null(), "its areas overlap");
    let apart = vec![two_areas().swap_remove(0), vec![vec![[14_000, 500], [15_500, 600], [15_000, 1_500]]]];
    let cloud = cloud(folder.path(), &places(2_000, &apart));
    let share =
        job(&cloud, &geojson(folder.path(), "apart.geojson", &apart)).report()["covered_share"].as_f64().unwrap();
    assert!(share > 0.5 && share < 1.0, "{share}");
}
