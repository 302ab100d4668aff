//! `surface = "bare-earth"`: the ground that the program finds, the same however the job is done, and the inputs with its classes.

use crate::las_file::LasFile;
use crate::program::{Job, Said, gdt_batch, number};
use crate::random::Random;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// A point in metres, and whether it is on the ground.
type Labelled = ([f64; 3], bool);

/// Returns a slope of 120 by 120 m with houses and trees on it, and a few points far below.
fn village() -> Vec<Labelled> {
    let mut random = Random(5);
    let mut unit = move || random.below(1 << 20) as f64 / f64::from(1 << 20);
    let ground = |x: f64, y: f64| 40.0 + 0.08 * x + 3.0 * (x / 30.0).sin() + 2.0 * (y / 25.0).cos();
    let house = |x: f64, y: f64| {
        [(20.0, 20.0), (60.0, 25.0), (80.0, 80.0)]
            .into_iter()
            .any(|(west, south)| (west..west + 14.0).contains(&x) && (south..south + 20.0).contains(&y))
    };
    let tree = |x: f64, y: f64| {
        [(15.0, 60.0), (45.0, 65.0), (30.0, 95.0), (100.0, 40.0)]
            .into_iter()
            .any(|(at, up)| (x - at).powi(2) + (y - up).powi(2) < 16.0)
    };
    let mut points = Vec::new();
    for row in 0..150 {
        for column in 0..150 {
            let [x, y] = [column, row].map(|place| 0.8 * (f64::from(place) + 0.9 * unit()));
            let (z, chance) = (ground(x, y) + 0.05 * unit(), unit());
            points.push(match () {
                () if row * column % 7001 == 5000 => ([x, y, z - 9.0], false),
                () if house(x, y) => ([x, y, ground(x, y) + 6.0 + 0.3 * chance], false),
                () if tree(x, y) && chance < 0.6 => ([x, y, z + 2.0 + 8.0 * chance], false),
                () => ([x, y, z], true),
            });
        }
    }
    points
}

fn text(points: &[Labelled], metre: f64) -> String {
    let row = |([x, y, z], _): &Labelled| format!("{:.2},{:.2},{:.2}\n", x / metre, y / metre, z / metre);
    format!("x,y,z\n{}", points.iter().map(row).collect::<String>())
}

fn write(folder: &Path, name: &str, points: &[Labelled]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text(points, 1.0)).unwrap();
    path
}

fn bare_earth(files: &[PathBuf]) -> Job {
    Job::on(files).with("input", "surface = \"bare-earth\"")
}

/// Returns what `verify` says of the results of `job` and these inputs.
#[track_caller]
fn against(job: &Job, inputs: &[PathBuf]) -> Said {
    let mut arguments = vec!["verify", "out", "--json", "--input"];
    arguments.extend(inputs.iter().map(|file| file.to_str().unwrap()));
    gdt_batch(job.folder(), &arguments)
}

#[test]
fn the_ground_is_found_and_proved() {
    let folder = tempfile::tempdir().unwrap();
    let points = village();
    let file = [write(folder.path(), "village.csv", &points)];
    let job = bare_earth(&file);
    let report = job.report();
    let (found, truth) = (number(&report["ground"]), points.iter().filter(|(_, is_ground)| *is_ground).count() as u64);
    assert!(found.abs_diff(truth) * 50 < truth, "{found} of {truth}");
    assert_eq!(number(&report["sites"]) + number(&report["duplicates"]), found);
    assert!(report["surface"].as_str().unwrap().starts_with("bare earth: "), "{}", report["surface"]);
    assert_eq!(against(&job, &file).succeeded().json()["verdict"], "proved");
    // One point more on the ground is one that the mesh lacks.
    let mut more = points.clone();
    more.push(([110.123, 110.456, points[150 * 137 + 137].0[2]], true));
    let more = [write(folder.path(), "more.csv", &more)];
    let said = against(&job, &more);
    assert!(
        said.code == 4 && said.json()["failures"].to_string().contains("1 points of the inputs are not vertices"),
        "{said:?}"
    );
}

#[test]
fn the_ground_is_the_same_however_the_job_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let points = village();
    let halves: Vec<PathBuf> = [0, 1, 2]
        .map(|part| {
            let own: Vec<Labelled> = points.iter().copied().filter(|(at, _)| (at[0] / 45.0) as usize == part).collect();
            write(folder.path(), &format!("{part}.csv"), &own)
        })
        .into();
    let turned: Vec<PathBuf> = halves.iter().rev().cloned().collect();
    let parts = |points: u64| format!("max_points_per_part = {points}");
    for more in ["levels = false", "max_error = 0.2"] {
        let facts = |job: Job| {
            let job = job.with("output", more);
            let report = job.report();
            (job.digest(), report["ground"].clone(), report["selection"].clone(), number(&report["parts"]))
        };
        let (digest, ground, selection, one) = facts(bare_earth(&halves));
        assert_eq!(one, 1);
        let ways = [
            bare_earth(&turned).tiles_of(300).threads(1),
            bare_earth(&halves).tiles_of(1_000).threads(4),
            bare_earth(&turned).tiles_of(500).with("triangulation", &parts(6_000)),
            bare_earth(&halves)
                .tiles_of(500)
                .with("triangulation", &parts(2_000))
                .with("limits", "memory = \"128 MiB\""),
        ];
        for (way, job) in ways.into_iter().enumerate() {
            let (of_way, ground_of_way, selection_of_way, parts) = facts(job);
            assert_eq!((&of_way, &ground_of_way, &selection_of_way), (&digest, &ground, &selection), "{more}, {way}");
            assert!(parts > 1 || way < 2, "{way}: {parts} parts");
        }
        let job = bare_earth(&halves).tiles_of(500).with("triangulation", &parts(4_000)).with("output", more);
        let config = job.config();
        let submit = ["submit", config.to_str().unwrap(), "--engine", "local", "--tasks", "3"];
        gdt_batch(job.folder(), &submit).succeeded();
        let written: Value = serde_json::from_slice(&fs::read(job.out().join("report.json")).unwrap()).unwrap();
        assert_eq!((&written["ground"], &written["selection"]), (&ground, &selection), "{more}, tasks");
        assert_eq!(against(&job, &halves).succeeded().json()["verdict"], "proved", "{more}");
    }
}

/// A cloud in feet is as large as it is in metres.
#[test]
fn sizes_are_in_metres_whatever_the_unit() {
    let folder = tempfile::tempdir().unwrap();
    let points = village();
    let metres = bare_earth(&[write(folder.path(), "metres.csv", &points)]).report();
    let feet = folder.path().join("feet.csv");
    fs::write(&feet, text(&points, 0.3048)).unwrap();
    let feet = bare_earth(&[feet]).with("input", "unit = \"foot\"").report();
    let [metres, feet] = [&metres, &feet].map(|report| number(&report["ground"]));
    assert!(metres.abs_diff(feet) * 200 < metres, "{metres} {feet}");
}

/// Returns the points as a LAS file whose records have all kinds of values besides.
fn las(points: &[Labelled], minor: u8, format: u8) -> LasFile {
    let mut file = LasFile::new(minor, format, 3, points.len());
    let (length, class_at) = (file.length() as usize, if format >= 6 { 16 } else { 15 });
    for (number, (record, (place, _))) in file.records.chunks_exact_mut(length).zip(points).enumerate() {
        for (axis, value) in place.iter().enumerate() {
            record[4 * axis..4 * axis + 4].copy_from_slice(&((value * 100.0).round() as i32).to_le_bytes());
        }
        // One in a hundred is noise, one in fifty is followed by another return, and one in fifty is the sixth.
        let class = if number % 100 == 7 { 7 } else { 0 };
        record[class_at] = if format >= 6 { class } else { class | 0x20 };
        let (this, of) = match number % 50 {
            3 => (1, 2),
            5 => (6, 6),
            _ => (1, 1),
        };
        record[14] = if format >= 6 { this | of << 4 } else { this | of << 3 };
        if format >= 6 {
            record[15] &= !0x04;
        }
    }
    file
}

#[test]
fn inputs_are_written_with_their_classes() {
    let folder = tempfile::tempdir().unwrap();
    let points = village();
    for (minor, format, compressed) in [(2, 1, false), (4, 6, true), (4, 7, false)] {
        let file = las(&points, minor, format);
        let name = if compressed { "a b.laz" } else { "a b.las" };
        let path = folder.path().join(name);
        fs::write(&path, if compressed { file.laz(&[5_000], false) } else { file.las() }).unwrap();
        let text = write(folder.path(), "c.csv", &points[..500]);
        let job = bare_earth(std::slice::from_ref(&path)).with("output", "classified = true");
        let report = job.report();
        let copy = job.out().join("classified/a b.laz");
        let read = |path: &Path| {
            let mut reader = las::Reader::from_path(path).unwrap();
            let points: Vec<las::Point> = reader.read_all().unwrap().points().collect::<Result<_, _>>().unwrap();
            points
        };
        let (before, after) = (read(&path), read(&copy));
        assert_eq!(before.len(), after.len());
        // All but where the points are, and that they are compressed.
        let [was, is] = [&path, &copy].map(|path| fs::read(path).unwrap());
        for part in [0..96, 105..227] {
            assert_eq!(was[part.clone()], is[part], "{format}");
        }
        let mut ground = 0;
        for (number, (before, after)) in before.iter().zip(&after).enumerate() {
            let class = u8::from(after.classification);
            let expected: &[u8] = match () {
                () if number % 100 == 7 => &[7],
                () if number % 50 == 3 => &[1],
                () => &[1, 2],
            };
            assert!(expected.contains(&class), "{format}, {number}: {class}");
            ground += u64::from(class == 2);
            let same = las::Point { classification: before.classification, ..after.clone() };
            // Times may be NaN.
            assert_eq!(format!("{before:?}"), format!("{same:?}"), "{format}, {number}");
        }
        assert_eq!(ground, number(&report["ground"]), "{format}");
        let sums = fs::read_to_string(job.out().join("XXH128SUMS")).unwrap();
        assert!(sums.contains("classified/a b.laz"), "{sums}");
        gdt_batch(job.folder(), &["verify", "out"]).succeeded();
        // Without it, the copies go; a text has no classes to set.
        let config = job.config();
        let without = fs::read_to_string(&config).unwrap().replace("classified = true", "classified = false");
        fs::write(&config, without).unwrap();
        gdt_batch(job.folder(), &[config.to_str().unwrap()]).succeeded();
        assert!(!copy.exists() && !job.out().join("classified").exists());
        let both = bare_earth(&[path, text]).with("output", "classified = true").with("input", "crs = \"none\"");
        let warnings = both.report()["warnings"].to_string();
        assert!(warnings.contains("c.csv is not in classified/: only LAS and LAZ files are copied"), "{warnings}");
    }
}

/// Points that `[input]` leaves out keep their class, whatever return they are; files of others in the folder stay.
#[test]
fn points_beyond_the_bounds_keep_their_class() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = las(&village(), 4, 6);
    let length = file.length() as usize;
    file.records.chunks_exact_mut(length).for_each(|record| record[16] = 5);
    let path = folder.path().join("a.las");
    fs::write(&path, file.las()).unwrap();
    let job = bare_earth(std::slice::from_ref(&path)).with("output", "classified = true");
    let job = job.with("input", "bounds = [500000, 4000000, 500060, 4000120]");
    fs::create_dir_all(job.out().join("classified")).unwrap();
    fs::write(job.out().join("classified/b.laz"), "of others").unwrap();
    job.report();
    let mut reader = las::Reader::from_path(job.out().join("classified/a.laz")).unwrap();
    for point in reader.read_all().unwrap().points().map(Result::unwrap) {
        let class = u8::from(point.classification);
        assert_eq!(class == 5, point.x > 500_060.0, "{point:?}");
    }
    assert!(job.out().join("classified/b.laz").exists());
}

#[test]
fn what_does_not_fit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = [write(folder.path(), "village.csv", &village()[..2_000])];
    Job::on(&file)
        .with("output", "classified = true")
        .run()
        .refused(2, &["[output] classified", "surface = \"bare-earth\""]);
    let sizes = |line: &str| bare_earth(&file).with("input.bare_earth", line);
    sizes("slope = 0").run().refused(2, &["slope is a height by a length from 0.01 to 10"]);
    sizes("largest_building = 20\nslope = 0.3\ntolerance = 0.2").run().succeeded();
    let other = Job::on(&file).with("input.bare_earth", "slope = 0.2");
    other.run().refused(2, &["bare_earth", "surface = \"bare-earth\""]);
}

/// Each point far from all others has a block of cells to itself: that is known before the points are read.
#[test]
fn points_far_from_all_others_do_not_break_the_memory_limit() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(8);
    let mut points = village();
    points.extend((0..1_000).map(|_| {
        let [x, y] = [(); 2].map(|()| f64::from(u32::try_from(random.below(1 << 20)).unwrap()) / 10.0);
        ([x, y, 40.0], true)
    }));
    let file = [write(folder.path(), "scattered.csv", &points)];
    let limited = |memory: &str| bare_earth(&file).with("limits", &format!("memory = \"{memory}\""));
    let words = [
        "bare-earth",
        "cells of ground",
        "more than [limits] memory = \"128 MiB\"",
        "points that lie far from all others",
    ];
    for arguments in [["check"].as_slice(), &[]] {
        let said = limited("128 MiB").run_with(arguments);
        said.refused(2, &words);
        let (_, named) = said.err.rsplit_once("memory = \"").unwrap();
        let (named, _) = named.split_once('"').unwrap();
        limited(named).run_with(&["check"]).succeeded();
    }
}
