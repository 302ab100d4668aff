//! `[output] export`: each file has the vertices and triangles of the tiles, as small parsers of their own read them.

use crate::breaklines::Survey;
use crate::program::{Job, gdt_batch, number};
use crate::tileset::files_below;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use tiles::gltf::read::read_tile;

const ALL: &str = "export = [\"ply\", \"landxml\", \"dxf\", \"obj\"]";
const FILES: [&str; 4] = ["terrain.xml", "terrain.dxf", "terrain.obj", "terrain.ply"];

/// A triangle by the places of its corners, in hundredths of a unit, in the order of the file.
type Triangle = [[i64; 3]; 3];

/// A mesh as a file has it.
#[derive(Debug, Default)]
struct Found {
    /// `None` where a format has no list of vertices.
    vertices: Option<Vec<[i64; 3]>>,
    triangles: Vec<Triangle>,
    /// The pieces of breaklines, each with its lesser end first.
    edges: BTreeSet<[[i64; 3]; 2]>,
}

fn hundredths(number: f64) -> i64 {
    let scaled = number * 100.0;
    assert!((scaled - scaled.round()).abs() < 1e-4, "{number} is no place of the lattice");
    scaled.round() as i64
}

fn place(text: &str) -> [i64; 3] {
    let numbers: Vec<i64> = text.split_whitespace().map(|number| hundredths(number.parse().unwrap())).collect();
    numbers.try_into().unwrap()
}

impl Found {
    fn numbered(vertices: Vec<[i64; 3]>, triangles: impl Iterator<Item = [usize; 3]>) -> Found {
        let triangles = triangles.map(|triangle| triangle.map(|corner| vertices[corner])).collect();
        Found { vertices: Some(vertices), triangles, edges: BTreeSet::new() }
    }

    fn add_line(&mut self, line: &[[i64; 3]]) {
        self.edges.extend(line.windows(2).map(|ends| [ends[0].min(ends[1]), ends[0].max(ends[1])]));
    }

    fn landxml(text: &str) -> Found {
        let northing_first = |[north, east, up]: [i64; 3]| [east, north, up];
        let between = |start: &'static str, end: &'static str| {
            text.split(start).skip(1).map(move |rest| rest.split(end).next().unwrap())
        };
        let points = between("<P id=\"", "</P>").map(|point| {
            let (_, coordinates) = point.split_once("\">").unwrap();
            northing_first(place(coordinates))
        });
        let faces = between("<F>", "</F>").map(|face| {
            let corners: Vec<usize> = face.split(' ').map(|corner| corner.parse::<usize>().unwrap() - 1).collect();
            <[usize; 3]>::try_from(corners).unwrap()
        });
        let mut found = Found::numbered(points.collect(), faces);
        for line in between("<PntList3D>", "</PntList3D>") {
            let numbers: Vec<&str> = line.split(' ').collect();
            let line: Vec<[i64; 3]> = numbers.chunks(3).map(|point| northing_first(place(&point.join(" ")))).collect();
            found.add_line(&line);
        }
        found
    }

    fn dxf(text: &str) -> Found {
        let lines: Vec<&str> = text.lines().collect();
        let groups: Vec<(&str, &str)> = lines.chunks(2).map(|pair| (pair[0].trim(), pair[1])).collect();
        assert_eq!(groups.last(), Some(&("0", "EOF")));
        let (mut found, mut line, mut is_closed) = (Found::default(), Vec::new(), false);
        for entity in groups.chunk_by(|_, next| next.0 != "0") {
            let value = |code: &str| entity.iter().find(|(found, _)| *found == code).map(|(_, value)| *value);
            let corner = |n: usize| {
                let coordinate = |axis: usize| value(&(10 * axis + n).to_string()).unwrap();
                place(&[1, 2, 3].map(coordinate).join(" "))
            };
            match (entity[0].1, value("8")) {
                ("3DFACE", Some("TERRAIN")) => {
                    assert_eq!(corner(2), corner(3));
                    found.triangles.push([0, 1, 2].map(corner));
                }
                ("POLYLINE", Some("BREAKLINES")) => is_closed = value("70") == Some("9"),
                ("VERTEX", Some("BREAKLINES")) => line.push(corner(0)),
                ("SEQEND", Some("BREAKLINES")) => {
                    line.extend(is_closed.then(|| line[0]));
                    found.add_line(&line);
                    line.clear();
                }
                ("3DFACE" | "POLYLINE" | "VERTEX" | "SEQEND", layer) => panic!("an entity in layer {layer:?}"),
                _ => {}
            }
        }
        found
    }

    fn obj(text: &str, offset: &Value) -> Found {
        let offset = [0, 1, 2].map(|axis| 100 * offset[axis].as_i64().unwrap());
        let lines = |start: &'static str| text.lines().filter_map(move |line| line.strip_prefix(start));
        let vertices = lines("v ").map(place).map(|local| [0, 1, 2].map(|axis| local[axis] + offset[axis]));
        let faces = lines("f ").map(|face| {
            let corners: Vec<usize> = face.split(' ').map(|corner| corner.parse::<usize>().unwrap() - 1).collect();
            <[usize; 3]>::try_from(corners).unwrap()
        });
        Found::numbered(vertices.collect(), faces)
    }

    fn ply(bytes: &[u8]) -> Found {
        let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let count = |element: &str| -> usize {
            let line = head.lines().find_map(|line| line.strip_prefix(element));
            line.unwrap().trim().parse().unwrap()
        };
        let has_colors =
            head.contains("property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n");
        let size = if has_colors { 27 } else { 24 };
        let (vertices, faces) = bytes[end..].split_at(size * count("element vertex"));
        assert_eq!(faces.len(), 13 * count("element face"));
        let vertices = vertices
            .chunks(size)
            .map(|vertex| [0, 8, 16].map(|at| hundredths(f64::from_le_bytes(vertex[at..at + 8].try_into().unwrap()))));
        let faces = faces.chunks(13).map(|face| {
            assert_eq!(face[0], 3);
            [1, 5, 9].map(|at| i32::from_le_bytes(face[at..at + 4].try_into().unwrap()) as usize)
        });
        Found::numbered(vertices.collect(), faces)
    }

    fn tiles(job: &Job) -> Found {
        let text = fs::read(job.out().join("georeference.json")).unwrap();
        let georeference: Value = serde_json::from_slice(&text).unwrap();
        let offset = [0, 1, 2].map(|axis| georeference["offset"][axis].as_f64().unwrap());
        let mut found = Found::default();
        for path in files_below(&job.out().join("tiles")) {
            for part in read_tile(&path).unwrap().parts {
                // A tile is rounded to less than half a step of the lattice.
                let corner = |v: u32| {
                    let [x, up, z] = part.world(v as usize);
                    [offset[0] + x, offset[1] - z, offset[2] + up].map(|number| (number * 100.0).round() as i64)
                };
                found.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(corner)));
            }
        }
        found
    }

    /// Returns the triangles, each with its corners in one order.
    fn set(&self) -> BTreeSet<Triangle> {
        let sorted = |triangle: &Triangle| {
            let mut triangle = *triangle;
            triangle.sort_unstable();
            triangle
        };
        let set: BTreeSet<Triangle> = self.triangles.iter().map(sorted).collect();
        assert_eq!(set.len(), self.triangles.len(), "a triangle twice");
        set
    }
}

fn is_counterclockwise([a, b, c]: &Triangle) -> bool {
    let side = |to: &[i64; 3], axis: usize| to[axis] - a[axis];
    side(b, 0) * side(c, 1) - side(b, 1) * side(c, 0) > 0
}

fn of_format(job: &Job, report: &Value, file: &str) -> Found {
    let bytes = fs::read(job.out().join(file)).unwrap();
    let listed = report["exports"].as_array().unwrap().iter().find(|export| export["file"] == file).unwrap();
    assert_eq!(number(&listed["bytes"]), bytes.len() as u64, "{file}");
    let text = || String::from_utf8(bytes.clone()).unwrap();
    let found = match file {
        "terrain.xml" => Found::landxml(&text()),
        "terrain.dxf" => Found::dxf(&text()),
        "terrain.obj" => Found::obj(&text(), &listed["offset"]),
        _ => Found::ply(&bytes),
    };
    assert_eq!(number(&listed["triangles"]), found.triangles.len() as u64);
    if let Some(vertices) = &found.vertices {
        assert_eq!(number(&listed["vertices"]), vertices.len() as u64);
    }
    found
}

/// Asserts that all files have the mesh of the tiles, and those with breaklines the edges of `breaklines.csv`.
#[track_caller]
fn has_the_mesh_of_its_tiles(job: &Job, report: &Value) {
    let expected = Found::tiles(job);
    let set = expected.set();
    let vertices: BTreeSet<[i64; 3]> = set.iter().flatten().copied().collect();
    assert_eq!(number(&report["triangles"]), set.len() as u64);
    let listed = fs::read_to_string(job.out().join("breaklines.csv")).unwrap();
    let edges: BTreeSet<[[i64; 3]; 2]> = listed
        .lines()
        .skip(1)
        .map(|line| {
            let numbers: Vec<&str> = line.split(',').collect();
            let [a, b] = [&numbers[..3], &numbers[3..6]].map(|end| place(&end.join(" ")));
            [a.min(b), a.max(b)]
        })
        .collect();
    assert!(edges.len() > 20);
    for file in FILES {
        let found = of_format(job, report, file);
        assert!(found.set() == set, "{file}: other triangles");
        assert!(found.triangles.iter().all(is_counterclockwise), "{file}: a triangle is clockwise");
        if let Some(own) = &found.vertices {
            assert_eq!(own.iter().collect::<BTreeSet<_>>().len(), own.len(), "{file}: a vertex twice");
            assert!(own.iter().copied().collect::<BTreeSet<_>>() == vertices, "{file}: other vertices");
        }
        let has_lines = file.ends_with("xml") || file.ends_with("dxf");
        assert!(found.edges == if has_lines { edges.clone() } else { BTreeSet::new() }, "{file}: other breaklines");
    }
}

fn bytes(job: &Job) -> Vec<Vec<u8>> {
    FILES.iter().map(|file| fs::read(job.out().join(file)).unwrap()).collect()
}

#[test]
fn every_format_has_the_mesh_of_the_tiles() {
    let survey = Survey::new(4_000);
    let one_tile = survey.job().with("output", ALL);
    has_the_mesh_of_its_tiles(&one_tile, &one_tile.report());
    // Many tiles in several parts.
    let job = || {
        let job = survey.job().tiles_of(150).with("triangulation", "max_points_per_part = 1500");
        job.with("output", &format!("{ALL}\nmax_edge = \"auto\""))
    };
    let many = job().threads(1);
    let report = many.report();
    assert!(number(&report["parts"]) > 1 && number(&report["tiles"]) > 20);
    has_the_mesh_of_its_tiles(&many, &report);
    let listed = fs::read_to_string(many.out().join("XXH128SUMS")).unwrap();
    assert!(FILES.iter().all(|file| listed.contains(file)), "{listed}");
    many.verified();
    let other = job().threads(3);
    other.report();
    assert!(bytes(&other) == bytes(&many), "threads change no byte");
    // Stopped while tiles are numbered, and while files are written.
    for place in ["signal-write_exports:2", "signal-chunks:3"] {
        let mut stopped = job().variable("GDT_FAULT", place);
        stopped.run().refused(1, &["interrupted"]);
        stopped.calm();
        assert!(number(&stopped.report()["resumed"]) > 4);
        assert!(bytes(&stopped) == bytes(&many), "{place}");
    }
    // Another choice keeps the tiles, and removes what is not wanted.
    let mut fewer = job().variable("GDT_FAULT", "signal-chunks:1");
    fewer.run().refused(1, &["interrupted"]);
    fewer.calm();
    let text = fs::read_to_string(fewer.config()).unwrap();
    fs::write(fewer.config(), text.replace(ALL, "export = [\"obj\"]")).unwrap();
    let said = gdt_batch(fewer.folder(), &["job.toml"]).succeeded();
    assert!(said.err.contains("[output] export; the tiles stay"), "{}", said.err);
    assert_eq!(FILES.map(|file| fewer.out().join(file).exists()), [false, false, true, false]);
}
