//! Heights along lines: where they cross the edges of the mesh, and at their own vertices.
//!
//! The lines are taken in runs of neighbouring segments (`search.rs`): a run reads the tiles that it may meet, and its rows are written before
//! the next. A run that would find more than memory allows is divided. So what is in memory grows with the file of lines, not with
//! what the lines cross.

mod line_segments;
mod rows;
mod search;

use crate::places::read_places;
use line_segments::{FineLattice, Line, LineSegment, lines_of};
use rows::TableWriter;
use search::Search;
use std::path::PathBuf;
use sys::{Error, Warnings};
use terrain::{FinishedTerrain, Result};

/// Decimals beyond those of the lattice.
const MORE_DECIMALS: u32 = 3;

/// The most crossings that are held at one time, unless one segment alone has more. A crossing takes about 150 bytes.
const CROSSINGS_AT_ONCE: usize = 1 << 18;

/// What is wanted.
#[derive(Clone, Debug)]
pub struct ProfileRequest {
    /// The output directory of the terrain.
    pub terrain: PathBuf,
    /// The file of lines.
    pub lines: PathBuf,
    /// About how many bytes the file of lines may take.
    pub memory: u64,
}

/// A terrain, and lines over it.
pub struct Profile {
    terrain: FinishedTerrain,
    lines: Vec<Line>,
    segments: Vec<LineSegment>,
    lattice: FineLattice,
    /// What the user should know.
    pub warnings: Warnings,
}

/// Opens a terrain and reads the lines.
///
/// # Errors
/// Those of [`crate::diff::run`] about the terrain; [`Error::Input`] if the file of lines is bad, or has no lines; [`Error::Config`] if there
/// is no way from its CRS to that of the terrain.
pub fn open(request: &ProfileRequest) -> Result<Profile> {
    let terrain = FinishedTerrain::open(&request.terrain)?;
    let mut warnings = Warnings::default();
    let file = read_places(&request.lines, terrain.system(), request.memory, &mut warnings)?;
    let lines: Vec<Line> = file.features.iter().flat_map(lines_of).collect();
    if lines.is_empty() {
        return Err(Error::input(&request.lines, "has no lines").into());
    }
    let lattice = FineLattice::of(&terrain);
    let segments = lattice.segments(&lines, &request.lines)?;
    Ok(Profile { terrain, lines, segments, lattice, warnings })
}

impl Profile {
    /// Writes the heights along the lines as CSV: a title, and a row for each place, line by line.
    ///
    /// # Errors
    /// Those of `out`, [`Error::Input`] if a tile is not as the job wrote it, [`Error::Io`], [`Error::Interrupted`].
    pub fn write_csv(&self, out: impl FnMut(&str) -> sys::Result<()>) -> sys::Result<()> {
        let steps = [self.terrain.lattice().resolution, self.terrain.lattice().resolution_z];
        let decimals = steps.map(|step| step.normalize().scale().saturating_add(MORE_DECIMALS) as usize);
        let mut table = TableWriter::new(&self.lines, &self.lattice, decimals, out);
        let read = |number| self.terrain.read_tile(number);
        let search = Search::new(self.terrain.count(), &read, &self.segments);
        search.each(CROSSINGS_AT_ONCE, |segment, crossings| table.add(segment, crossings))?;
        table.finish()
    }
}
