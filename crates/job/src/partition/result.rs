//! What a part has to mesh: its tree, made of the points that were read or selected, for the steps after that.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::index::{NodeIndex, TileIndex};
use crate::partition::point_file::PointBlock;
use crate::partition::tree::Tree;
use crate::records::{StepRecord, Store};
use delaunay::geometry::Bounds;
use points::PointCounts;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use sys::{Error, Result};

/// The tree of a part, and where the points of each tile are.
#[derive(Clone, Debug, Default)]
pub struct Partition {
    /// The tree over all points of the part.
    pub tree: Tree,
    /// Where the point files hold the points of each tile.
    pub blocks: Vec<Vec<PointBlock>>,
    /// The points before duplicates are dropped.
    pub kept: u64,
    /// The size of the point files in bytes.
    pub point_bytes: u64,
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

    /// Returns the records that the leaf of `tile` writes, and that only steps of the tile itself, and the merge above it in the part, read.
    pub(crate) fn records_of_leaf(&self, tile: TileIndex) -> impl Iterator<Item = StepRecord> {
        let frontier = StepRecord::Frontier(self.tree.leaf(tile));
        let records = [StepRecord::Leaf(tile), StepRecord::PartialNormals(tile), frontier];
        // Other parts merge with the frontier of this one.
        records.into_iter().filter(|record| *record != StepRecord::Frontier(NodeIndex::ROOT))
    }

    /// Writes its record.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&self, store: &Store) -> Result<()> {
        let rest = serde_json::to_vec(&(&self.tree, self.kept, self.point_bytes));
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
        let (tree, kept, point_bytes) = serde_json::from_slice(&rest).map_err(broken)?;
        let blocks = columns.column::<PointBlock>()?;
        let mut blocks = blocks.iter().copied();
        let blocks = counts.iter().map(|&count| blocks.by_ref().take(count as usize).collect()).collect();
        Ok(Partition { tree, blocks, kept, point_bytes })
    }
}
