//! Reads the written tiles back, not the job's state, and proves from them alone, with exact arithmetic, that together they
//! are *the* Delaunay triangulation of their vertices.
//!
//! # What is checked
//!
//! 1. Every vertex is on the lattice, and every triangle is counterclockwise, strictly.
//! 2. Over all tiles no directed edge is used twice. The edges that are not used in both directions form one closed loop
//!    that turns left, or not at all, at every corner, never back, and once round in total.
//! 3. For every edge used in both directions, the corner opposite on one side is not inside the circle of the triangle on
//!    the other side. Ties are decided by the rule of [`crate::geometry::predicates::in_circle`].
//! 4. A site that several tiles have lies at the same place, bit for bit, and has the same normal and colour.
//! 5. Every vertex has a triangle; `triangles = 2 sites - hull edges - 2` (Euler); the triangles' area is the hull's; and the
//!    numbers of sites and triangles are those of `report.json`.
//!
//! # Why that is a proof
//!
//! *The triangles cover the hull exactly once.* Take a point on no edge. A counterclockwise triangle's boundary winds round
//! it once if it is inside and not at all if outside, so the number of triangles over the point is the winding number of
//! the sum of all boundaries. In that sum the edges used in both directions cancel; what is left is the loop of check 2, a
//! convex polygon, which winds once round the points inside of it and not round others. So no two triangles overlap and
//! no hole is left.
//!
//! *They meet edge to edge.* If a vertex lay inside an edge, the triangles of that edge would cover the ground next to the
//! vertex on each side of the edge that has any, and so would the vertex's own triangles: twice. So this is a
//! triangulation of its vertices, and its outline is their convex hull.
//!
//! *It is Delaunay.* A triangulation in which every inner edge is locally Delaunay is Delaunay (Delaunay 1934; with the
//! sites lifted to the paraboloid: a function that is convex across every edge is convex). The tie rule is a symbolic
//! perturbation of the lifted heights, so the same holds for the perturbed heights, whose lower hull has triangular
//! facets only: there is one such triangulation, and the tiles are it.
//!
//! *The sites are counted rightly*, although no table of all of them is made. In a triangulation the triangles round a vertex
//! form a cycle, or at the hull a path, each sharing an edge with the next. If some of them are in one part (mesh of a
//! tile) and some are not, then one of these shared edges has only one of its two triangles in that part. So a
//! vertex of several parts is an end of an edge used on one side only in each of them, and only the ends of such edges
//! (few) need a common table: the number of sites is that of the other vertices plus that of the distinct ends.
//!
//! Together with the number of sites of the report, no site that the job has read is missing.
//!
//! # Triangles that are left out
//!
//! Where `[output] max_edge` leaves triangles out of the terrain, they are in `cut/`, and all of the above is checked of what
//! is written and what is left out together. Normals and colours are not compared with `cut/`, which has none. If the report
//! says that triangles were left out and `cut/` is gone, only checks 1, 4 and the first sentence of 2 are made, and 3 between
//! triangles that are there; the verdict says so.

mod digest;
mod exact;
mod hull;
mod part;
mod rim;
mod source;
mod spill;
mod verdict;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Deserialize;

pub use digest::{Digest, digest_of};
pub use source::Source;
pub use verdict::Verdict;

use crate::output::frame::Extras;
use crate::output::gltf::read::{TileFile, held_bytes, read_extras, read_tile};
use crate::{Error, Result};
use part::Findings;
use rim::Rim;
use verdict::Fault;

/// Bytes of memory that checking a tile takes for every byte that its parts have in memory, at most.
const MEMORY_FACTOR: u64 = 5;

/// Checks the tiles under `directory/tiles` within about `memory` bytes. The verdict lists what does not hold.
///
/// Fails with [`Error::Config`] where there are no tiles, and where one cannot be read for reasons of the machine, or one alone needs more memory.
pub fn verify(directory: &Path, memory: u64) -> Result<Verdict> {
    let tiles = Tiles::find(directory)?;
    let source = Source::new(&tiles.extras).map_err(|what| Error::input(&tiles.paths[0], what))?;
    let rim = Mutex::new(Rim::new(directory, memory / 4));
    let lanes = tiles.lanes(memory / 2)?;
    let next = AtomicUsize::new(0);
    let findings = (0..lanes)
        .into_par_iter()
        .map(|_| tiles.check_from(&next, &source, &rim))
        .try_reduce(Findings::default, |a, b| Ok(a.merge(b)))?;
    let rim = rim.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    let names = tiles.names();
    let (matched, vertices) = rim.finish(&source, &names)?;
    let report = read_report(directory)?;
    Ok(Verdict::new(tiles.written, findings, matched, vertices, report, &names))
}

/// What `report.json` says.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
struct Report {
    sites: Option<u64>,
    /// Those that are written.
    triangles: Option<u64>,
    /// Those that are left out.
    cut_triangles: Option<u64>,
}

fn read_report(directory: &Path) -> Result<Report> {
    let path = directory.join("report.json");
    if !path.exists() {
        return Ok(Report::default());
    }
    let text = std::fs::read(&path).map_err(Error::io("read", &path))?;
    serde_json::from_slice(&text).map_err(|e| Error::input(&path, format!("not a report of this program: {e}")))
}

/// The tiles to check, in the order of their names.
struct Tiles {
    paths: Vec<PathBuf>,
    /// So many of them, the first, are the terrain's; the others hold what was left out.
    written: usize,
    /// Those of the first that can be read; all others have to agree.
    extras: Extras,
    /// Bytes that the parts of the largest have in memory.
    largest: u64,
}

impl Tiles {
    fn find(directory: &Path) -> Result<Tiles> {
        let folder = folder_of_tiles(directory)?;
        let mut paths = glb_files(&folder)?;
        let written = paths.len();
        let Some(first) = paths.first() else {
            return Err(no_output(&folder, "has no .glb file"));
        };
        let readable = paths.iter().find_map(|path| read_extras(path).ok());
        let extras = readable.map_or_else(|| read_extras(first), Ok)?;
        let cut = directory.join("cut");
        if cut.is_dir() {
            paths.extend(glb_files(&cut)?);
        }
        // One that cannot be read is found again when it is its turn.
        let largest = paths.par_iter().map(|path| held_bytes(path).unwrap_or(0)).max().unwrap_or(0);
        Ok(Tiles { paths, written, extras, largest })
    }

    fn names(&self) -> Vec<String> {
        let name = |p: &PathBuf| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (tiles, cut) = self.paths.split_at(self.written);
        tiles.iter().map(name).chain(cut.iter().map(|p| format!("cut/{}", name(p)))).collect()
    }

    /// How many tiles may be in memory at once.
    fn lanes(&self, memory: u64) -> Result<usize> {
        let each = self.largest.saturating_mul(MEMORY_FACTOR).max(1);
        match (memory / each) as usize {
            0 if each > 2 * memory => Err(Error::Memory(format!(
                "the largest tile takes about {} MiB to verify: set a higher memory limit",
                each >> 20
            ))),
            lanes => Ok(lanes.clamp(1, rayon::current_num_threads())),
        }
    }

    /// Checks one tile after the other until none is left.
    fn check_from(&self, next: &AtomicUsize, source: &Source, rim: &Mutex<Rim>) -> Result<Findings> {
        let mut findings = Findings::default();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(path) = self.paths.get(number) else { return Ok(findings) };
            match read_tile(path) {
                Ok(tile) => self.check(number, &tile, source, rim, &mut findings)?,
                Err(error @ Error::Input { .. }) => {
                    findings.faults.note(Fault::Unreadable, number as u32, || error.to_string());
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn check(
        &self,
        number: usize,
        tile: &TileFile,
        source: &Source,
        rim: &Mutex<Rim>,
        findings: &mut Findings,
    ) -> Result<()> {
        let name = self.paths[number].display();
        if tile.extras != self.extras {
            let other = self.paths[0].display();
            findings.faults.note(Fault::Unreadable, number as u32, || format!("{name} is of another job than {other}"));
            return Ok(());
        }
        for part in &tile.parts {
            let mut records = part::check(part, number as u32, source, findings);
            if number >= self.written {
                findings.cut += part.triangles.len() as u64;
                records.vertices.iter_mut().for_each(|vertex| vertex.unshaded = 1);
            }
            let mut rim = rim.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            rim.add(&records)?;
        }
        Ok(())
    }
}

/// Where the tiles are in the output `directory` of a job.
fn folder_of_tiles(directory: &Path) -> Result<PathBuf> {
    let folder = directory.join("tiles");
    match directory.metadata() {
        Err(e) if e.kind() == ErrorKind::NotFound => Err(no_output(directory, "is not there")),
        Err(e) => Err(Error::io("read", directory)(e)),
        Ok(meta) if !meta.is_dir() => Err(no_output(directory, "is not a directory")),
        Ok(_) if !folder.is_dir() => Err(no_output(directory, "has no folder named tiles")),
        Ok(_) => Ok(folder),
    }
}

fn no_output(path: &Path, what: &str) -> Error {
    Error::Config(format!("{} {what}: name the output directory of a finished job", path.display()))
}

/// The GLB files in `folder` by name.
fn glb_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        if path.extension().is_some_and(|e| e == "glb") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
