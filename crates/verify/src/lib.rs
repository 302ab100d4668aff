//! Reads the written tiles back, not the job's state, and proves from them alone, with exact arithmetic, that together they
//! are *the* Delaunay triangulation of their vertices.
//!
//! # What is checked
//!
//! 1. Every vertex is on the lattice, and every triangle is strictly counterclockwise.
//! 2. Over all tiles no directed edge is used twice. The edges that are not used in both directions form one closed loop.
//!    At every corner the loop turns left or goes straight on, never back, and it turns round once in total.
//! 3. For every edge used in both directions, the corner opposite on one side is not inside the circle of the triangle on
//!    the other side. Ties are decided by the rule of [`delaunay::geometry::predicates::in_circle`].
//! 4. A site in several tiles lies at the same place, bit for bit, and has the same normal and colour.
//! 5. Every vertex has a triangle; `triangles = 2 sites - hull edges - 2` (Euler); the area of the triangles is the area of the
//!    hull; and the counts of sites and triangles are those of `report.json`.
//!
//! # Why that is a proof
//!
//! *The triangles cover the hull exactly once.* Take a point on no edge. The boundary of a counterclockwise triangle winds round
//! the point once if the point is inside, else not at all. So the number of triangles over the point is the winding number of
//! the sum of all boundaries. In that sum the edges used in both directions cancel. The rest is the loop of check 2, a
//! convex polygon, which winds once round every point inside it and not round other points. So no two triangles overlap and
//! no hole is left.
//!
//! *They meet edge to edge.* If a vertex lay inside an edge, the triangles of that edge would cover the ground next to the
//! vertex on each side of the edge that is inside the hull, and so would the vertex's own triangles: twice. So this is a
//! triangulation of its vertices, and its outline is their convex hull.
//!
//! *It is Delaunay.* A triangulation in which every inner edge is locally Delaunay is Delaunay (Delaunay 1934; with the
//! sites lifted to the paraboloid: a function that is convex across every edge is convex). The tie rule is a symbolic
//! perturbation of the lifted heights, so the same holds for the perturbed heights, whose lower hull has triangular
//! facets only: there is one such triangulation, and the tiles are it.
//!
//! *The sites are counted correctly*, although there is no table of all sites. In a triangulation the triangles round a vertex
//! form a cycle, or at the hull a path, each sharing an edge with the next. If some of them are in one mesh (of a
//! tile) and some are not, then one of these shared edges has only one of its two triangles in that mesh. So a
//! vertex of several meshes is an end of an edge used on one side only in each of them. Only the ends of such edges, which
//! are few, need a common table: the number of sites is the number of other vertices plus the number of distinct ends.
//!
//! Together with the number of sites in the report this proves that no site that the job has read is missing.
//!
//! All of this needs each tile once. [`GrowingProof`] takes them as a job writes them, and comes to the same verdict when they are gone.
//!
//! # Triangles that are left out
//!
//! The triangles that `[output] hull`, `max_edge` and `[input] clip` leave out of the terrain are in `cut/`. All checks are made on the triangles in `tiles/`
//! and `cut/` together, except that normals and colours are not compared with `cut/`, which has none. If the report or
//! the list of files shows that some of `cut/` is gone, only checks 1, 4 and the first sentence of 2 are made, and check 3 between
//! the triangles that are there; the verdict says so.
//!
//! # Breaklines
//!
//! If there is a `breaklines.csv`, each of its edges must be an edge of a triangle, with the heights that the list says at both ends, and
//! the third corners of its triangles must lie outside the closed disc that has the edge as its diameter. As the mesh is Delaunay, no other
//! vertex lies in that disc either. The number of edges is compared with the report. Which points of the inputs lay in a disc or
//! in a lake, and were dropped, is not proved one by one: [`verify_against`] compares their number with the report.
//!
//! # Points within polygons
//!
//! With `[input] clip`, the report has the polygons on the lattice. [`verify_against`] decides anew, and in another way, which points of the
//! inputs lie within them (`clip.rs`): these, and no others, must be vertices. That the polygons are those of a file is not proved.
//!
//! # Selected points
//!
//! With `[output] max_error` not all points are vertices. [`verify_against`] proves that each of the others is within the bound of the triangle
//! below or above it (`surface.rs`).
//!
//! # Terrain tiles for globes
//!
//! If there is a `terrain/layer.json`, all tiles that it lists must be there and no others, each must cover its place once, and neighbours must have the
//! same vertices between them, at the same heights to the last bit (`terrain_tiles.rs`). How close they are to the mesh is not proved.
//!
//! # What the job wrote
//!
//! All of this also holds for a terrain that was changed consistently: one vertex raised, say, or all tiles moved. So every file is
//! compared with its checksum in `XXH128SUMS`. The checksum of `XXH128SUMS` is in `report.json`, which also holds one of itself, the
//! lattice, and a digest of all vertices with their heights. If somebody has forged all of these, only the inputs can show it:
//! [`verify_against`] reads them again and proves that the vertices are their points.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod border;
mod border_matching;
mod breaklines;
mod clip;
mod digest;
mod exact;
mod failures;
mod file_search;
mod findings;
mod growing_proof;
mod half_edges;
mod hull;
mod inputs;
mod keyed_records;
mod mesh_check;
mod report;
mod surface;
mod terrain_layer;
mod terrain_tiles;
mod tile_files;
mod verdict;
mod watcher;
mod written_files;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

pub use digest::{Digest, digest_of};
pub use growing_proof::GrowingProof;
pub use terrain::{Error, Result, SourceGrid, SourceGridError};
pub use verdict::{Conclusion, Verdict};
pub use watcher::Watcher;

use crate::border_matching::Borders;
use crate::breaklines::{BreaklineEdges, CheckedBreaklines};
use crate::failures::Failure;
use crate::findings::Findings;
use crate::inputs::{Inputs, Places, lattice_of};
use crate::mesh_check::check_mesh;
use crate::report::ReadReport;
use crate::surface::Surface;
use crate::terrain_tiles::TerrainTiles;
use crate::tile_files::TileFiles;
use crate::verdict::CheckedMesh;
use crate::watcher::Unwatched;
use crate::written_files::WrittenFiles;
use sys::address_space;
use terrain::refuse_unfinished;
use tiles::gltf::read::{TileFile, read_tile};

/// Checks what is in the output `directory` of a job within about `memory` bytes. The verdict lists what does not hold.
///
/// # Errors
/// [`sys::Error::Config`] if it is no output of a job, [`Error::Unfinished`] if its results are not all in place, [`sys::Error::Memory`] if
/// one tile alone needs more memory, [`sys::Error::Io`] if the system cannot read a tile.
pub fn verify(directory: &Path, memory: u64) -> Result<Verdict> {
    verify_against(directory, memory, &[])
}

/// As [`verify`]; proves also that the vertices are the points of the files `inputs`, if there are any.
///
/// # Errors
/// As [`verify`], and [`sys::Error::Io`] or [`sys::Error::Input`] if an input cannot be read.
pub fn verify_against(directory: &Path, memory: u64, inputs: &[PathBuf]) -> Result<Verdict> {
    verify_watched(directory, memory, inputs, &Unwatched)
}

/// As [`verify_against`]; tells `watcher` how far it is.
///
/// # Errors
/// As [`verify_against`].
pub fn verify_watched(directory: &Path, memory: u64, inputs: &[PathBuf], watcher: &dyn Watcher) -> Result<Verdict> {
    let memory = address_space::at_start().map_or(memory, |left| memory.min(left.bytes));
    refuse_unfinished(directory)?;
    let found = TileFiles::find(directory);
    if let Err(error @ sys::Error::Io { .. }) = found {
        return Err(error.into());
    }
    let report = ReadReport::read(directory);
    let written = WrittenFiles::check(directory, report.facts.file_list, &HashMap::new(), watcher);
    let unusable = |what: String| Ok(Verdict::without_mesh(what, &report, &written));
    let files = match found {
        Ok(files) => files,
        // Where a job was finished, they were there.
        Err(sys::Error::Config(_)) if directory.is_dir() && (report.is_of_a_job() || written.has_list) => {
            return unusable("the tiles are gone: tiles/ is not there, or has no .glb file".into());
        }
        Err(error @ sys::Error::Config(_)) => return Err(error.into()),
        Err(error) => return unusable(error.to_string()),
    };
    let grid = match SourceGrid::new(&files.extras) {
        Ok(grid) => grid,
        Err(error) => return unusable(format!("{}: {error}", files.paths[0].display())),
    };
    let inputs = match inputs {
        [] => None,
        inputs => Some(Inputs::open(inputs, &report.facts, &files.extras, memory, watcher)?),
    };
    let lattice = || lattice_of(&report.facts, &files.extras);
    let lines = BreaklineEdges::read(directory, lattice, memory / 4)?;
    let has_surface = inputs.is_some() && report.facts.selection.is_some();
    let run = Verification {
        lines: lines.as_ref(),
        borders: Mutex::new(Borders::new(directory, memory / 4)),
        places: inputs.is_some().then(|| Places::new(directory, if has_surface { memory / 8 } else { memory / 4 })),
        surface: has_surface.then(|| Surface::new(directory, memory / 8)),
        files: &files,
        grid: &grid,
        next: AtomicUsize::new(0),
        watcher,
    };
    watcher.begin("check tiles", files.paths.len() as u64, "tiles");
    let lanes = files.lanes(memory / 2)?;
    let findings =
        (0..lanes).into_par_iter().map(|_| run.check_files()).try_reduce(Findings::default, |a, b| Ok(a.merge(b)))?;
    let borders = run.borders.into_inner().unwrap_or_else(PoisonError::into_inner);
    let matches = borders.match_all(&grid, &files)?;
    let checked_lines = lines.as_ref().map(|lines| CheckedBreaklines::of(lines, &grid));
    let proof =
        inputs.zip(run.places).map(|(inputs, places)| inputs.compare(places, run.surface, lines.as_ref(), &grid));
    let proof = proof.transpose()?;
    let terrain = TerrainTiles::check(directory, memory)?;
    let mesh = CheckedMesh { files: &files, findings, matches, lines: checked_lines, terrain };
    Ok(Verdict::new(mesh, &report, &written, proof))
}

/// What the threads share that check files.
struct Verification<'a> {
    files: &'a TileFiles,
    grid: &'a SourceGrid,
    /// The edges along breaklines; `None` if the job had none.
    lines: Option<&'a BreaklineEdges>,
    borders: Mutex<Borders>,
    /// The vertices of all tiles, if they are to be compared with the inputs.
    places: Option<Places>,
    /// The triangles, if points that are no vertices are to be compared with them.
    surface: Option<Surface>,
    /// The number of the next file to check.
    next: AtomicUsize,
    watcher: &'a dyn Watcher,
}

impl Verification<'_> {
    /// Checks one file after the other until none is left.
    fn check_files(&self) -> sys::Result<Findings> {
        let mut findings = Findings::default();
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(path) = self.files.paths.get(number) else { return Ok(findings) };
            match read_tile(path) {
                Ok(tile) => self.check_file(number, &tile, &mut findings)?,
                Err(error @ sys::Error::Input { .. }) => {
                    findings.failures.note(Failure::UnusableTile, number as u32, || error.to_string());
                }
                Err(error) => return Err(error),
            }
            self.watcher.advance(1);
        }
    }

    fn check_file(&self, number: usize, tile: &TileFile, findings: &mut Findings) -> sys::Result<()> {
        if tile.extras != self.files.extras {
            let [this, first] = [number, 0].map(|number| self.files.paths[number].display());
            let example = || format!("{this} comes from another job than {first}");
            findings.failures.note(Failure::UnusableTile, number as u32, example);
            return Ok(());
        }
        for mesh in &tile.parts {
            let (mut border, vertices) = check_mesh(mesh, number as u32, self.grid, findings);
            if let Some(lines) = self.lines.filter(|_| !vertices.is_empty()) {
                lines.check(&vertices, &mesh.triangles, number as u32, self.grid, findings);
            }
            if let Some(places) = &self.places {
                places.add_vertices(&vertices)?;
            }
            if let Some(surface) = self.surface.as_ref().filter(|_| !vertices.is_empty()) {
                surface.add_triangles(&vertices, &mesh.triangles)?;
            }
            if number >= self.files.terrain {
                findings.cut_triangles += mesh.triangles.len() as u64;
                border.sites.iter_mut().for_each(|site| site.unshaded = 1);
            }
            self.borders.lock().unwrap_or_else(PoisonError::into_inner).add(&border)?;
        }
        Ok(())
    }
}
