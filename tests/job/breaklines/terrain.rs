//! A generated survey with a river, a lake with an island, and lines that cross, in steps of a centimetre; and the mesh of a job as integers.

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;
use tiles::gltf::read::read_tile;

use super::files::{Features, geojson, geopackage, shapefile};
use crate::program::Job;
use crate::random::Random;
use crate::tileset::files_below;

/// Where the survey lies: local coordinates are metres from here.
pub(super) const ORIGIN: [f64; 2] = [500_000.0, 4_000_000.0];

/// The side of the survey in centimetres.
const SIDE: u64 = 16_000;

/// The outlines of the lake and of its island, in centimetres. The island is cut out of the water.
pub(super) const LAKE: [[i64; 2]; 5] =
    [[9_000, 8_000], [13_500, 8_500], [14_000, 12_000], [11_000, 13_500], [8_500, 11_500]];
pub(super) const ISLAND: [[i64; 2]; 4] = [[10_500, 10_000], [12_000, 10_100], [11_900, 11_200], [10_600, 11_000]];

/// Points in random places on a slope. Ten are marked as ignored ground.
pub(crate) struct Survey {
    folder: TempDir,
    pub(crate) cloud: PathBuf,
    points: HashSet<[i64; 3]>,
}

impl Survey {
    pub(crate) fn new(count: usize) -> Survey {
        let (folder, mut random) = (tempfile::tempdir().unwrap(), Random(5));
        let (mut text, mut points, mut places) =
            (String::from("x,y,z,classification\n"), HashSet::new(), BTreeSet::new());
        while places.len() < count {
            let [x, y] = [0, 1].map(|_| random.below(SIDE + 1) as i64);
            if !places.insert([x, y]) {
                continue;
            }
            let z = 1_500 - x / 20 + y / 40 + random.below(30) as i64;
            points.insert([x, y, z]);
            let class = if places.len() <= 10 { 20 } else { 2 };
            let [east, north] = [(x, 0), (y, 1)].map(|(at, axis)| ORIGIN[axis] + at as f64 / 100.0);
            text += &format!("{east:.2},{north:.2},{:.2},{class}\n", z as f64 / 100.0);
        }
        let cloud = folder.path().join("cloud.csv");
        fs::write(&cloud, text).unwrap();
        Survey { folder, cloud, points }
    }

    pub(super) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the lattice integers of all points, as steps from [`ORIGIN`].
    pub(super) fn points(&self) -> &HashSet<[i64; 3]> {
        &self.points
    }

    /// Writes the river and returns its file.
    pub(super) fn river(&self) -> PathBuf {
        let course =
            vec![[0.0, 140.0, 16.0], [40.0, 120.0, 15.0], [55.0, 70.0, 13.0], [100.0, 40.0, 11.0], [160.0, 30.0, 9.0]];
        geojson(self.folder(), "river.geojson", &Features::lines(&[("river", course)]))
    }

    /// Writes all lines and returns their files.
    pub(super) fn lines(&self) -> Vec<PathBuf> {
        let ring = |ring: &[[i64; 2]]| ring.iter().map(|[x, y]| [*x as f64 / 100.0, *y as f64 / 100.0, 10.0]).collect();
        let lake = Features::areas(&[("lake", vec![ring(&LAKE), ring(&ISLAND)])]);
        let lines = Features::lines(&[("line", cross(0)), ("line", cross(1)), ("line", cross(2))]);
        vec![self.river(), geopackage(self.folder(), "lake.gpkg", &lake), shapefile(self.folder(), "lines", &lines)]
    }

    /// Returns a job with all lines.
    pub(crate) fn job(&self) -> Job {
        self.job_with(&self.lines(), "kind_field = \"kind\"")
    }

    /// Returns a job with the lines of `files`.
    pub(super) fn job_with<P: AsRef<Path>>(&self, files: &[P], rest: &str) -> Job {
        let names: Vec<&str> = files.iter().map(|file| file.as_ref().to_str().unwrap()).collect();
        self.plain_job().with("[breaklines]", &format!("files = {names:?}\n{rest}"))
    }

    /// Returns a job without lines.
    pub(super) fn plain_job(&self) -> Job {
        Job::on(&[&self.cloud])
            .with("input", "crs = \"EPSG:32633\"")
            .with("output", "compression = \"none\"\nformat = \"3dtiles\"")
    }
}

/// Lines that cross each other, the river and the lake's shore, and one that begins where two others cross.
pub(super) fn cross(number: usize) -> Vec<[f64; 3]> {
    match number {
        0 => vec![[20.0, 20.0, 14.0], [120.0, 150.0, 14.0]],
        1 => vec![[20.0, 150.0, 17.0], [120.0, 20.0, 12.0], [125.0, 21.0, 12.0]],
        _ => vec![[120.0, 20.0, 12.0], [130.0, 120.0, 12.0]],
    }
}

/// Tells whether a point lies inside an outline.
pub(super) fn inside(outline: &[[i64; 2]], p: [i64; 3]) -> bool {
    let mut is_inside = false;
    for (i, a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        // The place where the edge crosses the row of the point lies to the right of it.
        let turn = (b[0] - a[0]) * (p[1] - a[1]) - (p[0] - a[0]) * (b[1] - a[1]);
        is_inside ^= (a[1] > p[1]) != (b[1] > p[1]) && (turn > 0) == (b[1] > a[1]);
    }
    is_inside
}

/// Tells whether a place lies in the lake, and not on its island: centimetres from [`ORIGIN`].
pub(crate) fn in_lake([x, y]: [i64; 2]) -> bool {
    inside(&LAKE, [x, y, 0]) && !inside(&ISLAND, [x, y, 0])
}

/// The mesh in the tiles of a job, in steps from [`ORIGIN`].
pub(super) struct Mesh {
    pub(super) vertices: HashSet<[i64; 3]>,
    /// Both ends of every edge, the lesser first.
    pub(super) edges: HashSet<[[i64; 3]; 2]>,
    /// The ends of the edges along breaklines.
    pub(super) ends: HashSet<[i64; 3]>,
}

impl Mesh {
    pub(super) fn of(job: &Job) -> Mesh {
        let text = fs::read(job.out().join("georeference.json")).unwrap();
        let georeference: Value = serde_json::from_slice(&text).unwrap();
        let offset = [0, 1, 2].map(|axis| georeference["offset"][axis].as_f64().unwrap());
        let ends = Mesh::listed(job).into_iter().flatten().collect();
        let mut mesh = Mesh { vertices: HashSet::new(), edges: HashSet::new(), ends };
        for folder in ["tiles", "cut"] {
            for path in files_below(&job.out().join(folder)) {
                for part in read_tile(&path).unwrap().parts {
                    let corner = |v: u32| {
                        let [x, y, z] = part.world(v as usize);
                        let world = [x + offset[0] - ORIGIN[0], offset[1] - z - ORIGIN[1], y + offset[2]];
                        world.map(|value| (value * 100.0).round() as i64)
                    };
                    for triangle in part.triangles.iter().map(|triangle| triangle.map(corner)) {
                        mesh.vertices.extend(triangle);
                        let [a, b, c] = triangle;
                        mesh.edges.extend([[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]));
                    }
                }
            }
        }
        mesh
    }

    /// Returns the edges in `breaklines.csv`.
    pub(super) fn listed(job: &Job) -> Vec<[[i64; 3]; 2]> {
        let text = fs::read_to_string(job.out().join("breaklines.csv")).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("x1,y1,z1,x2,y2,z2,kind"));
        let ends = |line: &str| {
            let values: Vec<f64> = line.split(',').take(6).map(|value| value.parse().unwrap()).collect();
            let end = |at: usize| {
                [values[at] - ORIGIN[0], values[at + 1] - ORIGIN[1], values[at + 2]].map(|v| (v * 100.0).round() as i64)
            };
            [end(0), end(3)]
        };
        lines.map(ends).collect()
    }
}
