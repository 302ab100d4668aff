//! Two terrains that have been compared, and what suits them.

use crate::common_lattice::CommonLattice;
use crate::tile_meshes::{MeshCache, TileFacts};
use crate::written::ramp::{ChangeCounts, round_up, spacing};
use overlay::{FixedSum, Rectangle};
use sys::{Error, Result};
use terrain::FinishedTerrain;

/// Two terrains that have been compared.
pub(crate) struct Compared<'a> {
    pub(crate) terrains: [&'a FinishedTerrain; 2],
    pub(crate) lattice: &'a CommonLattice,
    /// Of all tiles of each terrain.
    pub(crate) facts: [&'a [TileFacts]; 2],
    /// The area of each in square steps.
    pub(crate) areas: [FixedSum; 2],
    /// Tiles of the earlier terrain.
    pub(crate) cache: &'a MeshCache<'a>,
    /// How many tiles may be in memory at the same time.
    pub(crate) lanes: usize,
    /// About how many bytes of memory may be used.
    pub(crate) memory: u64,
    /// Smaller changes count as none, in units of heights.
    pub(crate) threshold: f64,
    /// The greatest rise or fall, in steps.
    pub(crate) greatest: f64,
}

impl Compared<'_> {
    /// Returns the smallest rectangle around both terrains' common area, in steps of the common lattice, which may be empty.
    pub(super) fn common_box(&self) -> Rectangle {
        let around = |facts: &[TileFacts]| facts.iter().fold(Rectangle::EMPTY, |all, tile| all.joined(tile.bounds));
        around(self.facts[0]).common(around(self.facts[1]))
    }

    /// Returns the side of a cell in units of x and y that suits the finer terrain.
    pub(super) fn usual_resolution(&self) -> f64 {
        let of = |k: usize| spacing(self.areas[k], self.facts[k].iter().map(|tile| tile.triangles).sum());
        let steps = [0, 1].into_iter().filter_map(of).fold(f64::INFINITY, f64::min);
        round_up(if steps.is_finite() { steps } else { 1.0 } * self.lattice.step_lengths()[0])
    }

    /// Returns the range of colours in units of heights: nearly all changes are below it, and none is far below.
    pub(super) fn usual_range(&self, changes: Option<&ChangeCounts>) -> f64 {
        let step = self.lattice.step_lengths()[1];
        let greatest = (self.greatest * step).max(step);
        let usual = changes.and_then(|changes| changes.usual_limit(self.threshold as f32));
        round_up(usual.map_or(greatest, |usual| f64::from(usual).min(greatest)).max(self.threshold).max(step))
    }
}

/// Refuses a number of cells that no file holds.
pub(crate) fn refuse_too_many(resolution: f64, [width, height]: [f64; 2]) -> Result<()> {
    const MOST: f64 = (1u64 << 38) as f64;
    const MOST_ALONG: f64 = (i32::MAX - 2) as f64;
    let [columns, rows] = [width, height].map(|side| (side / resolution).ceil() + 1.0);
    if columns <= MOST_ALONG && rows <= MOST_ALONG && columns * rows <= MOST {
        return Ok(());
    }
    let factor = (columns * rows / MOST).sqrt().max(columns.max(rows) / MOST_ALONG);
    Err(Error::Config(format!(
        "--resolution {resolution} makes {columns:.0} x {rows:.0} cells, more than a file holds: give {} or more",
        round_up(resolution * factor)
    )))
}
