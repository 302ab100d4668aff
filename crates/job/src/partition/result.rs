//! What step 2 leaves for the steps after it.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::index::TileIndex;
use crate::partition::point_file::{PointBlock, pages_of};
use crate::partition::tree::Tree;
use crate::plan::input_identity::RenamedInputs;
use crate::plan::job_plan::SkippedInput;
use crate::records::{RecordRef, StepRecord, Store};
use delaunay::geometry::Bounds;
use points::PointCounts;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use sys::{Error, Result};

/// The tree, where the points of each tile are, and what the inputs held.
#[derive(Clone, Debug, Default)]
pub struct Partition {
    /// The tree over all points.
    pub tree: Tree,
    /// Where the point files hold the points of each tile.
    pub blocks: Vec<Vec<PointBlock>>,
    /// What was read.
    pub summary: PointSummary,
    /// The size of the point files in bytes.
    pub point_bytes: u64,
    /// The inputs that proved bad while they were read and are left out. No other figure here counts them.
    pub skipped: Vec<SkippedInput>,
}

/// What all inputs together held.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PointSummary {
    /// Numbers of records by what became of them.
    pub counts: PointCounts,
    /// The lattice box of the kept points; `None` without points.
    pub bounds: Option<Bounds<3>>,
}

impl AddAssign for PointSummary {
    fn add_assign(&mut self, other: PointSummary) {
        self.counts += other.counts;
        self.bounds = self.bounds.into_iter().chain(other.bounds).reduce(Bounds::union);
    }
}

impl Partition {
    /// Returns the number of points in `tile`.
    pub fn points(&self, tile: TileIndex) -> u64 {
        self.blocks[tile.get()].iter().map(|block| block.points as u64).sum()
    }

    /// Returns the bytes that the points of `tile` take in the point files.
    pub(crate) fn points_bytes(&self, tile: TileIndex) -> u64 {
        pages_of(&self.blocks[tile.get()]).values().flatten().map(|pages| pages.end - pages.start).sum()
    }

    /// Calls the inputs what they are called by now.
    pub(crate) fn rename_inputs(&mut self, renamed: &RenamedInputs) {
        self.skipped.iter_mut().for_each(|skipped| skipped.rename(renamed));
        let counts = &mut self.summary.counts;
        counts.examples.iter_mut().chain(&mut counts.notes).for_each(|text| renamed.rename_in(text));
    }

    /// Writes its record.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store) -> Result<RecordRef> {
        let rest = serde_json::to_vec(&(&self.tree, &self.summary, self.point_bytes, &self.skipped));
        let rest = rest.map_err(|e| Error::Broken(format!("the tree cannot be written down: {e}")))?;
        let counts: Vec<u64> = self.blocks.iter().map(|blocks| blocks.len() as u64).collect();
        let columns = ColumnWriter::default().push(&rest).push(&counts);
        columns.push(&self.blocks.concat()).write(store, StepRecord::Partition)
    }

    /// Reads its record.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Broken`] if there is none.
    pub fn load(store: &Store) -> Result<Partition> {
        let key = StepRecord::Partition;
        let mut columns = ColumnReader::open(store, key)?;
        let (rest, counts) = (columns.column::<u8>()?, columns.column::<u64>()?);
        let broken = |e: serde_json::Error| Error::Broken(format!("{}: {e}", store.path(key).display()));
        let (tree, summary, point_bytes, skipped) = serde_json::from_slice(&rest).map_err(broken)?;
        let blocks = columns.column::<PointBlock>()?;
        let mut blocks = blocks.iter().copied();
        let blocks = counts.iter().map(|&count| blocks.by_ref().take(count as usize).collect()).collect();
        Ok(Partition { tree, blocks, summary, point_bytes, skipped })
    }
}
