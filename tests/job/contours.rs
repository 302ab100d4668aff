//! `[output.contours]`: the lines are those of the triangles, whatever the tiles, threads and parts.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use rusqlite::Connection;
use serde_json::Value;
use tiles::gltf::read::read_tile;

use crate::clouds;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, number};
use crate::tileset::files_below;

struct Line {
    height: f64,
    is_index: bool,
    is_closed: bool,
    points: Vec<[f64; 3]>,
}

fn lines(path: &Path) -> Vec<Line> {
    let database = Connection::open(path).unwrap();
    let sound: String = database.query_row("PRAGMA integrity_check", [], |row| row.get(0)).unwrap();
    assert_eq!(sound, "ok");
    let mut all = database.prepare("SELECT height, is_index, is_closed, geom FROM contours ORDER BY fid").unwrap();
    let line = |row: &rusqlite::Row| {
        let geometry: Vec<u8> = row.get(3)?;
        let numbers: Vec<f64> =
            geometry[49..].chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
        let points = numbers.chunks_exact(3).map(|point| [point[0], point[1], point[2]]).collect();
        Ok(Line { height: row.get(0)?, is_index: row.get(1)?, is_closed: row.get(2)?, points })
    };
    all.query_map([], line).unwrap().map(Result::unwrap).collect()
}

/// Returns the edges of all triangles, in the source's whole coordinates.
fn edges(job: &Job) -> HashSet<[[i64; 3]; 2]> {
    let text = fs::read(job.out().join("georeference.json")).unwrap();
    let georeference: Value = serde_json::from_slice(&text).unwrap();
    let offset = [0, 1, 2].map(|axis| georeference["offset"][axis].as_f64().unwrap());
    let mut edges = HashSet::new();
    for path in files_below(&job.out().join("tiles")) {
        for part in read_tile(&path).unwrap().parts {
            let corner = |v: u32| {
                let [x, up, z] = part.world(v as usize);
                [x + offset[0], offset[1] - z, offset[2] + up].map(|coordinate| coordinate.round() as i64)
            };
            for corners in part.triangles.iter().map(|triangle| triangle.map(corner)) {
                edges.extend([[0, 1], [1, 2], [2, 0]].map(|[a, b]| {
                    let [a, b] = [corners[a], corners[b]];
                    if a[2] < b[2] { [a, b] } else { [b, a] }
                }));
            }
        }
    }
    edges
}

fn rounded([x, y]: [f64; 2], height: f64) -> [i64; 3] {
    [x, y, height].map(|number| (number * 1e4).floor() as i64)
}

/// A line of a drawing: its layer, its elevation, whether it is a ring, and its points; numbers as texts.
type Polyline = (String, String, bool, Vec<[String; 2]>);

/// Returns a line as a drawing should have it.
fn polyline(line: &Line) -> Polyline {
    let layer = if line.is_index { "CONTOURS_INDEX" } else { "CONTOURS" };
    let points = &line.points[..line.points.len() - usize::from(line.is_closed)];
    let points = points.iter().map(|[x, y, _]| [x, y].map(f64::to_string)).collect();
    (layer.into(), line.height.to_string(), line.is_closed, points)
}

/// Returns the polylines of a drawing.
fn polylines(drawing: &[u8]) -> Vec<Polyline> {
    let text = std::str::from_utf8(drawing).unwrap();
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let groups: Vec<(&str, &str)> = lines.chunks(2).map(|group| (group[0], group[1])).collect();
    let mut found: Vec<Polyline> = Vec::new();
    let starts: Vec<usize> = (0..groups.len()).filter(|at| groups[*at].0 == "0").collect();
    for (at, end) in starts.iter().zip(starts.iter().skip(1)) {
        let of = |code: &str| groups[*at..*end].iter().find(|group| group.0 == code).unwrap().1.to_string();
        match groups[*at].1 {
            "POLYLINE" => found.push((of("8"), of("30"), of("70") == "1", Vec::new())),
            "VERTEX" => found.last_mut().unwrap().3.push([of("10"), of("20")]),
            _ => {}
        }
    }
    found
}

#[test]
fn lines_have_the_same_bytes_in_any_tiling_and_lie_on_the_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &clouds::clusters(4_000), 100_000);
    let options = "interval = 12.5\nbase = 5\nindex = 4\ndxf = true";
    let run = |job: Job| {
        let job = job.with("output", "max_edge = 9000.0").with("output.contours", options);
        let report = job.report();
        let files = ["contours.gpkg", "contours.dxf"].map(|name| fs::read(job.out().join(name)).unwrap());
        (files, report, job)
    };
    let (bytes, report, job) = run(Job::on(&files).tiles_of(300).threads(1));
    for other in [Job::on(&files).tiles_of(2_000).threads(2), in_parts(&files, 1_000)] {
        let (others, _, other) = run(other);
        assert!(others == bytes, "other bytes");
        other.verified();
        assert!(!other.out().join("job").exists());
    }
    let found = lines(&job.out().join("contours.gpkg"));
    let points: usize = found.iter().map(|line| line.points.len()).sum();
    let of_report = |key: &str| number(&report["contours"][key]);
    assert_eq!((of_report("lines"), of_report("points")), (found.len() as u64, points as u64));
    assert_eq!(of_report("bytes"), bytes.iter().map(Vec::len).sum::<usize>() as u64);
    assert_eq!(polylines(&bytes[1]), found.iter().map(polyline).collect::<Vec<_>>());
    assert!(found.len() > 100 && found.iter().any(|line| line.is_closed) && found.iter().any(|line| !line.is_closed));
    // Crossings of edges, rounded down; a place that is nearly a whole multiple may be found as the next one.
    let mut crossings = HashSet::new();
    for [low, high] in edges(&job) {
        let [low, high] = [low, high].map(|end| end.map(|coordinate| coordinate as f64));
        let mut level = ((low[2] - 5.0) / 12.5).floor() * 12.5 + 5.0;
        while level <= high[2] {
            if low[2] < level {
                // At a vertex, 1/64 lattice step of one below it.
                let rise = if level == high[2] { level - 1.0 / 64.0 } else { level } - low[2];
                let place = [0, 1].map(|axis| low[axis] + rise / (high[2] - low[2]) * (high[axis] - low[axis]));
                for [dx, dy] in [[-1e-6, -1e-6], [-1e-6, 1e-6], [1e-6, -1e-6], [1e-6, 1e-6]] {
                    crossings.insert(rounded([place[0] + dx, place[1] + dy], level));
                }
            }
            level += 12.5;
        }
    }
    for line in &found {
        assert_eq!(line.points.first() == line.points.last(), line.is_closed);
        assert_eq!(line.is_index, (line.height - 5.0) % 50.0 == 0.0, "{}", line.height);
        for [x, y, z] in &line.points {
            assert_eq!(*z, line.height);
            assert!(crossings.contains(&rounded([*x, *y], *z)), "({x}, {y}) at {z} is on no edge");
        }
    }
}

#[test]
fn wrong_levels_are_refused_before_the_job_begins() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(500, 2_000, 5));
    for (options, words) in [
        ("interval = 1e-6", ["interval = 1e-6 makes about", "give a greater interval, such as "]),
        ("levels = [1, 1.001]", ["too close to each other, 1 and 1.001", "whole multiples of 1"]),
        ("interval = -2", ["line 5", "positive"]),
        ("levels = [1]\nbase = 2", ["line 5", "apply to interval alone"]),
        ("index = 5", ["line 5", "interval = 1.0"]),
    ] {
        let job = Job::on(&[&cloud]).with("output.contours", options);
        job.run_with(&["check"]).refused(2, &words);
        job.run().refused(2, &words);
        assert!(!job.out().exists());
    }
    let above = Job::on(&[&cloud]).with("output.contours", "levels = [1e6]");
    assert!(above.report()["warnings"].to_string().contains("contours.gpkg has no line"));
}
