//! Breaklines from files of all formats: every piece is an edge of the mesh, lakes are flat, and the bytes do not depend on how the job is
//! done.

mod bad;
pub(crate) mod files;
mod heights;
mod lakes;
mod same;
mod terrain;

use crate::program::{Job, gdt_batch, number};
use files::{Features, geojson, geopackage, shapefile};
use terrain::{ISLAND, LAKE, Mesh, cross, inside};
pub(crate) use terrain::{Survey, in_lake};

/// The river comes from GeoJSON, the lake from a GeoPackage, and lines that cross from a Shapefile.
#[test]
fn every_edge_is_in_the_mesh_and_lakes_are_flat() {
    let survey = Survey::new(6_000);
    let job = survey.job().tiles_of(700);
    let report = job.report();
    let mesh = Mesh::of(&job);
    let edges = Mesh::listed(&job);
    let lines = &report["breaklines"];
    assert_eq!(edges.len() as u64, number(&lines["subsegments"]));
    assert!(edges.len() > 300, "{}", edges.len());
    for [a, b] in &edges {
        assert!(mesh.edges.contains(&[*a.min(b), *a.max(b)]), "{a:?} {b:?}");
    }
    // No vertex lies in the closed disc of an edge, but its ends.
    for [a, b] in &edges {
        let along = |p: &[i64; 3], axis: usize| (a[axis] - p[axis]) * (b[axis] - p[axis]);
        let in_disc = mesh.vertices.iter().filter(|p| along(p, 0) + along(p, 1) <= 0).count();
        assert_eq!(in_disc, 2, "{a:?} {b:?}");
    }
    let on_water = |p: &&[i64; 3]| inside(&LAKE, **p) && !inside(&ISLAND, **p);
    let water: Vec<_> = mesh.vertices.iter().filter(on_water).collect();
    // On the shore and nowhere else: corners of the outline count as inside or not.
    assert!(water.iter().all(|p| p[2] == 1_000 && mesh.ends.contains(*p)), "{water:?}");
    let island = mesh.vertices.iter().filter(|p| inside(&ISLAND, **p) && !mesh.ends.contains(*p)).count();
    assert!(island > 3, "{island}");
    // What is no end of an edge is a point of the cloud.
    let points = survey.points();
    let strangers = mesh.vertices.iter().filter(|p| !mesh.ends.contains(*p) && !points.contains(*p)).count();
    assert_eq!(strangers, 0);
    let dropped = number(&report["points"]["at_breaklines"]);
    assert!(dropped > 300);
    // Ten are ignored ground.
    assert_eq!(number(&report["points"]["kept"]) + dropped + 10, number(&report["points"]["read"]));
    assert_eq!(
        number(&report["sites"]),
        number(&report["points"]["kept"]) - number(&report["duplicates"]) + mesh.ends.len() as u64
    );
    let verdict = job.verified();
    assert_eq!(verdict["breaklines"], lines["subsegments"]);
    let against = gdt_batch(job.folder(), &["verify", "out", "--json", "--input", survey.cloud.to_str().unwrap()]);
    assert_eq!(against.succeeded().json()["verdict"], "proved");
}

/// Returns a job whose river rises, whose lake is not flat, and whose lines cross at different heights, and its survey.
pub(crate) fn with_doubtful_heights() -> (Survey, Job) {
    let survey = Survey::new(2_000);
    let rising = vec![[10.0, 10.0, 5.0], [60.0, 10.0, 4.0], [110.0, 10.0, 4.5], [160.0, 10.0, 3.0]];
    let uneven = vec![[20.0, 60.0, 9.0], [40.0, 60.0, 9.0], [40.0, 80.0, 9.3], [20.0, 80.0, 9.0]];
    // A line that nobody will see: it lies in the lake.
    let drowned = vec![[25.0, 65.0, 8.0], [35.0, 72.0, 8.0]];
    let features = Features::lines(&[("river", rising), ("line", drowned)]);
    let rivers = geojson(survey.folder(), "rises.geojson", &features);
    let lakes = geojson(survey.folder(), "uneven.geojson", &Features::areas(&[("lake", vec![uneven])]));
    let crossing = Features::lines(&[("line", cross(0)), ("line", cross(1))]);
    let lines = shapefile(survey.folder(), "crossing", &crossing);
    let job = survey.job_with(&[rivers, lakes, lines], "kind_field = \"kind\"");
    (survey, job)
}

#[test]
fn what_is_wrong_with_heights_is_said() {
    let (_survey, job) = with_doubtful_heights();
    let said = job.run().succeeded();
    for words in [
        "1 river rises downstream; the worst is feature 1 of",
        "by 0.5 at (500110, 4000010)",
        "1 lake is not flat",
        "0.3 higher at (500040, 4000080)",
        "heights disagree at 1 place where",
    ] {
        assert!(said.out.contains(words), "no {words:?} in {}", said.out);
    }
    assert!(said.out.contains("at breaklines or in lakes"), "{}", said.out);
    job.verified();
}

#[test]
fn lines_without_heights_take_them_from_an_attribute_or_the_points() {
    let survey = Survey::new(2_000);
    let flat = |z: f64| vec![vec![[60.0, 60.0, z], [90.0, 60.0, z], [90.0, 90.0, z], [60.0, 90.0, z]]];
    let lake =
        geopackage(survey.folder(), "flat.gpkg", &Features::areas(&[("lake", flat(f64::NAN))]).with_level(12.25));
    let heights = |rest: &str| {
        let job = survey.job_with(&[&lake], &format!("kind = \"lake\"\n{rest}"));
        job.report();
        job.verified();
        let mesh = Mesh::of(&job);
        let mut heights: Vec<i64> = mesh.ends.iter().map(|end| end[2]).collect();
        heights.sort_unstable();
        heights.dedup();
        heights
    };
    assert_eq!(heights("height_field = \"level\""), [1_225]);
    let from_points = heights("heights = \"points\"");
    assert!(
        from_points.len() == 1 && survey.points().iter().any(|point| point[2] == from_points[0]),
        "{from_points:?}"
    );
    survey
        .job_with(&[&lake], "kind = \"lake\"")
        .run()
        .refused(3, &["flat.gpkg: feature 1 has no heights", "height_field"]);
}

/// A lake has no points inside, so its triangles are long.
#[test]
fn max_edge_spares_flat_water() {
    let survey = Survey::new(6_000);
    let cut = |lines: bool| {
        let job = if lines { survey.job() } else { survey.plain_job() };
        let report = job.with("output", "max_edge = 9.0").report();
        [number(&report["cut_triangles"]), number(&report["hull_triangles"])]
    };
    let [with, without] = [cut(true), cut(false)];
    assert!(with[0] - with[1] <= without[0] - without[1], "{with:?} {without:?}");
}

/// Two banks with nothing between them.
#[test]
fn max_edge_spares_the_water_between_the_banks_of_a_river() {
    let survey = Survey::new(100);
    let banks = [41.0, 79.0].map(|y| ("river", vec![[0.0, y, 10.0], [120.0, y, 9.0]]));
    let lines = geojson(survey.folder(), "banks.geojson", &Features::lines(&banks));
    let cloud = survey.folder().join("banks.csv");
    let rows = (0..=40).flat_map(|x| (0..=40).map(move |y| (3 * x, 3 * y)));
    let dry =
        rows.filter(|(_, y)| !(40..80).contains(y)).map(|(x, y)| format!("{},{},12\n", 500_000 + x, 4_000_000 + y));
    std::fs::write(&cloud, format!("x,y,z\n{}", dry.collect::<String>())).unwrap();
    let cut = |job: Job| {
        let report = job.with("output", "max_edge = 9.0").report();
        number(&report["cut_triangles"]) - number(&report["hull_triangles"])
    };
    let job = || Job::on(&[&cloud]).with("input", "crs = \"EPSG:32633\"");
    assert!(cut(job()) > 40);
    assert_eq!(cut(job().with("[breaklines]", &format!("files = [{lines:?}]\nkind = \"river\""))), 0);
}

/// Class 20 marks ground that is to be ignored near breaklines, and nowhere else.
#[test]
fn ignored_ground_is_left_out_where_there_are_breaklines() {
    let survey = Survey::new(1_000);
    let river = survey.river();
    let other = |job: crate::program::Job| number(&job.report()["points"]["other_class"]);
    assert_eq!(other(survey.plain_job()), 0);
    assert_eq!(other(survey.job_with(&[&river], "kind = \"river\"")), 10);
    assert_eq!(other(survey.job_with(&[&river], "kind = \"river\"").with("input", "classes = [2, 20]")), 0);
}

#[test]
fn bounds_and_lines_that_leave_the_cloud_are_cut() {
    let survey = Survey::new(4_000);
    let long = vec![[-500.0, 55.0, 30.0], [700.0, 65.0, 10.0]];
    let far = vec![[9_000.0, 9_000.0, 1.0], [9_100.0, 9_000.0, 1.0]];
    let lines = shapefile(survey.folder(), "long", &Features::lines(&[("line", long), ("line", far)]));
    let job =
        survey.job_with(&[&lines], "kind = \"line\"").with("input", "bounds = [500040, 4000020, 500120, 4000110]");
    let report = job.report();
    assert_eq!(number(&report["breaklines"]["features_outside"]), 1);
    let mesh = Mesh::of(&job);
    assert!(mesh.ends.len() > 10);
    for p in &mesh.vertices {
        assert!((4_000..=12_000).contains(&p[0]) && (2_000..=11_000).contains(&p[1]), "{p:?}");
    }
    job.verified();
    let nothing =
        shapefile(survey.folder(), "far", &Features::lines(&[("line", vec![[5e3, 5e3, 1.0], [6e3, 5e3, 1.0]])]));
    let said = survey.job_with(&[nothing], "").run().succeeded();
    assert!(said.out.contains("there are no breaklines"), "{}", said.out);
}
