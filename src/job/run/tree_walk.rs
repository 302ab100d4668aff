//! Steps 3 and 4 of a job, in the order of the tree: children before parents, side by side where there are threads.

use crate::job::durable::journal::{Done, Step};
use crate::job::mesh::leaf::{self, LeafFigures};
use crate::job::mesh::merge;
use crate::job::mesh::precision_limit::Longest;
use crate::job::partition::point_file::Spill;
use crate::job::partition::read::Partition;
use crate::job::partition::tree::Kind;
use crate::job::progress::stage::{Stage, Strand};
use crate::job::progress::time_left;
use crate::job::run::tile_queue::TileWriter;
use crate::job::tiles::dependencies::Settled;
use crate::job::{BYTES_PER_LEAF_SITE, Job};
use crate::{Error, Result};
use rayon::Scope;

/// Walks the tree.
pub(crate) struct Grower<'a> {
    pub(crate) job: &'a Job<'a>,
    pub(crate) partition: &'a Partition,
    /// Where the points are, as long as there is a leaf to be done.
    pub(crate) spill: Option<Spill>,
    pub(crate) longest: Longest,
    pub(crate) stage: &'a Stage,
    pub(crate) strand: &'a Strand,
    /// Takes the tiles that need no node above.
    pub(crate) writer: &'a TileWriter<'a>,
}

impl<'a> Grower<'a> {
    /// Triangulates the leaves below `node`, and merges every merge node as soon as all below it is done. `None` if something
    /// has failed, which the writer tells.
    pub(crate) fn grow(&self, scope: &Scope<'a>, node: usize) -> Option<LeafFigures> {
        match self.partition.tree.nodes[node].kind {
            Kind::Leaf(tile) => self.writer.attempt(|| self.grow_leaf(scope, node, tile)),
            Kind::Inner([low, high]) => {
                let (low, high) = rayon::join(|| self.grow(scope, low), || self.grow(scope, high));
                let (mut figures, high) = (low?, high?);
                figures += high;
                if self.partition.tree.is_merge(node) {
                    self.writer.attempt(|| self.merge(scope, node))?;
                }
                Some(figures)
            }
        }
    }

    fn grow_leaf(&self, scope: &Scope<'a>, node: usize, tile: usize) -> Result<LeafFigures> {
        let journal = self.job.journal;
        let (step, points) = (Step::Leaf(tile), self.partition.points(tile));
        let figures: LeafFigures = journal.step(step, || self.strand.time(points, || self.leaf(tile)))?;
        self.job.count(self.stage, step, time_left::triangulated(points));
        // Any other leaf hands its hull up.
        if node == 0 || figures.sites == 0 {
            self.writer.take(scope, Settled { tile, by: node });
        }
        Ok(figures)
    }

    fn leaf(&self, tile: usize) -> Result<Done<LeafFigures>> {
        let Job { config, store, triangulator, .. } = *self.job;
        let task = leaf::Task { duplicates: config.input.duplicates, triangulator, longest: self.longest };
        let spill = self.spill.as_ref();
        let spill = spill.ok_or_else(|| Error::Broken(format!("the points of tile {tile} are gone")))?;
        leaf::run(store, self.partition, spill, tile, task)
    }

    fn merge(&self, scope: &Scope<'a>, node: usize) -> Result<()> {
        let Job { store, journal, .. } = *self.job;
        let (tree, memory) = (&self.partition.tree, self.memory_of_merge(node));
        let merge = || self.strand.time(0, || merge::run(store, tree, node, memory, self.longest));
        for tile in journal.step(Step::Node(node), merge)? {
            self.writer.take(scope, Settled { tile: tile as usize, by: node });
        }
        Ok(())
    }

    /// Nodes below the root may be merged at once on all threads. Beside the root the others may write tiles, which takes half of
    /// what leaves do.
    fn memory_of_merge(&self, node: usize) -> u64 {
        let Job { config, threads, .. } = *self.job;
        let memory = config.limits.memory.0 / 4 * 3;
        if node > 0 {
            return memory / threads as u64;
        }
        let tile = config.triangulation.max_points_per_tile.0.saturating_mul(BYTES_PER_LEAF_SITE / 2);
        memory.saturating_sub(tile.saturating_mul(threads as u64 - 1))
    }
}
