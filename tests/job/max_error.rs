//! Meshes with `[output] max_error`: few vertices, every point within the bound, and the same mesh however the job is done.

use crate::breaklines::Survey;
use crate::clouds::{self, Cloud};
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, Said, gdt_batch, number};
use crate::tileset::files_below;
use serde_json::Value;
use std::path::PathBuf;

/// Returns what `verify` says of the results of `job` and these inputs.
#[track_caller]
fn against(job: &Job, inputs: &[PathBuf]) -> Said {
    let mut arguments = vec!["verify", "out", "--json", "--input"];
    arguments.extend(inputs.iter().map(|file| file.to_str().unwrap()));
    gdt_batch(job.folder(), &arguments)
}

fn within(job: Job, bound: &str) -> Job {
    job.with("output", &format!("max_error = {bound}"))
}

/// Runs the job, whose points are in `inputs`, proves that they are within `bound`, and returns its report.
#[track_caller]
fn proved(job: &Job, inputs: &[PathBuf], bound: f64) -> Value {
    let (report, verdict) = (job.report(), against(job, inputs).succeeded().json());
    assert_eq!(verdict["verdict"], "proved", "{verdict}");
    let (selection, greatest) = (&report["selection"], verdict["greatest_error"].as_f64().unwrap());
    let reported = selection["greatest_error"].as_f64().unwrap();
    assert!(greatest <= bound && (greatest - reported).abs() < 1e-5, "{greatest}, reported {reported}, of {bound}");
    assert!(selection["mean_error"].as_f64().unwrap() <= greatest);
    assert_eq!(selection["vertices"], report["sites"]);
    report
}

#[test]
fn every_point_is_within_the_bound_of_few_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let file = [clouds::write(folder.path(), "hills.csv", &hills(20_000, 3))];
    let mut before = 20_000;
    for bound in ["0.5", "2", "20"] {
        let report = proved(&within(Job::on(&file).tiles_of(2_000), bound), &file, bound.parse().unwrap());
        let sites = number(&report["sites"]);
        assert!(sites > 10 && sites < before, "{bound}: {sites} of {before}");
        assert_eq!(number(&report["selection"]["points"]) + number(&report["duplicates"]), 20_000);
        before = sites;
    }
}

#[test]
fn the_mesh_is_the_same_however_the_job_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let clouds: [(&str, Cloud, &str); 3] = [
        ("hills", hills(12_000, 3), "3"),
        ("grid", clouds::with_heights((0..90).flat_map(|x| (0..90).map(move |y| [100 * x, 100 * y]))), "200"),
        ("clusters", clouds::clusters(12_000), "100"),
    ];
    for (name, cloud, bound) in clouds {
        let folder = folder.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let files = in_files(&folder, &cloud, 60_000);
        let turned: Vec<PathBuf> = files.iter().rev().cloned().collect();
        let facts = |job: Job| {
            let job = within(job, bound);
            let report = job.report();
            let of_selection = ["points", "vertices", "rounds", "greatest_error", "greatest_error_at", "mean_error"];
            (job.digest(), of_selection.map(|figure| report["selection"][figure].clone()), number(&report["parts"]))
        };
        let (digest, selection, _) = facts(Job::on(&files));
        let ways = [
            Job::on(&turned).tiles_of(300).threads(1),
            Job::on(&files).tiles_of(1_000).threads(4),
            Job::on(&files).tiles_of(700).with("triangulation", "backend = \"reference\""),
            in_parts(&turned, 3_000),
            in_parts(&files, 900).with("limits", "memory = \"128 MiB\""),
        ];
        for (way, job) in ways.into_iter().enumerate() {
            let (other, figures, parts) = facts(job);
            assert_eq!((other, figures), (digest.clone(), selection.clone()), "{name}, {way}");
            assert!(parts > 1 || way < 3, "{name}, {way}: {parts} parts");
        }
    }
}

#[test]
fn what_the_memory_does_not_hold_waits_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = [clouds::write(folder.path(), "hills.csv", &hills(300_000, 3))];
    let facts = |memory: &str| {
        let job = within(Job::on(&file).with("limits", &format!("memory = \"{memory}\"")), "0.1");
        let report = job.report();
        (job.digest(), report["selection"].clone(), number(&report["bytes_temporary"]))
    };
    let (ample, scarce) = (facts("2 GiB"), facts("128 MiB"));
    assert_eq!((&ample.0, &ample.1), (&scarce.0, &scarce.1));
    assert!(scarce.2 > ample.2 + (4 << 20), "{scarce:?} {ample:?}");
}

#[test]
fn breaklines_stay_edges_and_lakes_stay_flat() {
    let survey = Survey::new(6_000);
    let job = within(survey.job().tiles_of(700), "1.5");
    let report = job.report();
    let verdict = against(&job, std::slice::from_ref(&survey.cloud)).succeeded().json();
    assert_eq!((&verdict["verdict"], &verdict["breaklines"]), (&"proved".into(), &report["breaklines"]["subsegments"]));
    assert!(number(&report["sites"]) < number(&report["selection"]["points"]) * 9 / 10);
    let whole = survey.job().report();
    assert_eq!(report["breaklines"]["subsegments"], whole["breaklines"]["subsegments"]);
}

/// A bay opens into rough ground: the triangles over the bay are left out, and no others, however the job is done.
#[test]
fn the_hull_is_trimmed_where_there_are_no_points() {
    let folder = tempfile::tempdir().unwrap();
    // 170 points to a side, ten steps apart and moved a little. A wedge from the north is empty.
    let place = |x: i64, y: i64| [10 * x + (7 * x + 3 * y) % 4, 10 * y + (5 * x + 11 * y) % 4];
    let is_land = |x: i64, y: i64| y < 40 || (x - 85).abs() > (y - 40) / 2;
    let all = (0..170).flat_map(|x| (0..170).map(move |y| (x, y)));
    let cloud: Cloud =
        all.filter(|&(x, y)| is_land(x, y)).map(|(x, y)| [place(x, y)[0], place(x, y)[1], x * y * 31 % 17]).collect();
    let file = [clouds::write(folder.path(), "bay.csv", &cloud)];
    let plain = || Job::on(&file).with("output", "compression = \"none\"");
    let whole = within(plain().with("output", "hull = \"whole\""), "5");
    let (wanted, bay) = (plain(), within(plain(), "5"));
    let [wanted, whole, trimmed] = [&wanted, &whole, &bay].map(|job| {
        job.report();
        area(job)
    });
    assert!(whole > 1.1 * wanted, "{whole} {wanted}");
    // Where the bay is narrow, its edges are not long.
    let left = (trimmed - wanted) / (whole - wanted);
    assert!(trimmed > 0.999 * wanted && left < 0.25, "{trimmed} of {wanted}, whole {whole}");
    let report = bay.report();
    assert!(number(&report["hull_triangles"]) > 0);
    for other in [plain().tiles_of(500), plain().with("triangulation", "max_points_per_part = 6000").tiles_of(700)] {
        let other = within(other, "5");
        assert_eq!(other.report()["hull_triangles"], report["hull_triangles"]);
        assert!((area(&other) - trimmed).abs() < 1e-6);
    }
}

/// Ground in strips: triangles from one to another hold points, all of them at their ends.
#[test]
fn the_hull_is_trimmed_between_strips_of_ground() {
    let Some(shared) = crate::common::shared() else { return };
    let plain = || {
        let job = Job::on(&[shared.join("data/append-bug.laz")]).with("input", "classes = [2]");
        job.with("output", "compression = \"none\"")
    };
    let shown = |job: Job| {
        job.report();
        area(&job)
    };
    let wanted = shown(plain());
    assert!(shown(plain().with("output", "hull = \"whole\"")) > 20.0 * wanted);
    for bound in ["0.05", "0.2", "1.0"] {
        let trimmed = shown(within(plain(), bound));
        assert!((0.9 * wanted..1.1 * wanted).contains(&trimmed), "{bound}: {trimmed} of {wanted}");
    }
}

/// Returns the area in the plane of the triangles that a job shows.
fn area(job: &Job) -> f64 {
    let twice = |[a, b, c]: &[[f64; 3]; 3]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
    let files = files_below(&job.out().join("tiles"));
    files.iter().map(|path| mesh_of(path).iter().map(twice).sum::<f64>()).sum::<f64>() / 2.0
}

/// Returns the triangles of a GLB in the plane of its tile: x, y and height.
fn mesh_of(path: &std::path::Path) -> Vec<[[f64; 3]; 3]> {
    let tile = tiles::gltf::read::read_tile(path).unwrap();
    let corner = |part: &tiles::gltf::read::TilePart, v: u32| {
        let [x, up, z] = part.world(v as usize);
        [x, -z, up]
    };
    tile.parts.iter().flat_map(|part| part.triangles.iter().map(move |t| t.map(|v| corner(part, v)))).collect()
}

/// A file that repeats points changes nothing.
#[test]
fn repeated_points_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = hills(9_000, 3);
    let [once, again] = ["once.csv", "again.csv"].map(|name| clouds::write(folder.path(), name, &cloud));
    let facts = |files: &[PathBuf]| {
        let job = within(Job::on(files), "20");
        let report = proved(&job, files, 20.0);
        (job.digest(), report["selection"].clone())
    };
    assert_eq!(facts(std::slice::from_ref(&once)), facts(&[once, again]));
}

/// Flat ground has long and obtuse triangles along its hull, and they stay.
#[test]
fn flat_ground_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let place = |x: i64, y: i64| [10 * x + (7 * x + 3 * y) % 4, 10 * y + (5 * x + 11 * y) % 4, (x + y) % 3];
    let cloud: Cloud = (0..300).flat_map(|x| (0..300).map(move |y| place(x, y))).collect();
    let file = [clouds::write(folder.path(), "flat.csv", &cloud)];
    let report = proved(&within(Job::on(&file), "10"), &file, 10.0);
    assert!(number(&report["sites"]) < 100, "{}", report["sites"]);
    assert_eq!(number(&report["cut_triangles"]), 0);
}

#[test]
fn a_point_beyond_the_bound_fails_the_proof() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = hills(5_000, 3);
    let file = [clouds::write(folder.path(), "hills.csv", &cloud)];
    let job = within(Job::on(&file), "5");
    proved(&job, &file, 5.0);
    let mut other = cloud.clone();
    // It lies beside a point of the cloud, far above it.
    let [x, y, z] = cloud[2_500];
    other.push([x + 1, y, z + 1_000_000]);
    let said = against(&job, &[clouds::write(folder.path(), "other.csv", &other)]);
    assert_eq!(said.code, 4, "{said:?}");
    let failures = said.json()["failures"].to_string();
    assert!(
        failures.contains("points of the inputs that are more than max_error = 5 from the mesh: 1, the first"),
        "{failures}"
    );
    other.pop();
    other.push([x + 100_000_000, y, z]);
    let said = against(&job, &[clouds::write(folder.path(), "other.csv", &other)]);
    assert!(
        said.json()["failures"].to_string().contains("points of the inputs outside the mesh: 1, the first"),
        "{said:?}"
    );
}

#[test]
fn what_is_no_bound_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = [clouds::write(folder.path(), "hills.csv", &hills(500, 3))];
    for wrong in ["0", "-1", "\"auto\"", "inf", "[1]"] {
        within(Job::on(&file), wrong).run().refused(2, &["max_error is \"none\" or a positive number"]);
    }
    let auto = within(Job::on(&file), "1").with("output", "max_edge = \"auto\"");
    auto.run().refused(2, &["max_edge = \"auto\"", "give max_edge a length"]);
    within(Job::on(&file), "1e-300").run().refused(2, &["max_error", "give a number such as 0.1"]);
    let none = within(Job::on(&file), "\"none\"");
    assert_eq!(none.report()["selection"], Value::Null);
    assert_eq!(none.digest(), Job::on(&file).digest());
}

#[test]
fn points_on_a_line_are_all_selected() {
    let folder = tempfile::tempdir().unwrap();
    let mut line = clouds::line(300, 0);
    line.sort_unstable();
    line.dedup_by_key(|point| [point[0], point[1]]);
    let file = [clouds::write(folder.path(), "line.csv", &line)];
    let said = within(Job::on(&file), "5").run();
    assert!(said.code == 3 && said.err.contains("one line"), "{said:?}");
}
