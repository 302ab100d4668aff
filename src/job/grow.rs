//! Steps 3 and 4 of a job, in the order of the tree: children before parents, side by side where there are threads.

use super::Job;
use super::journal::{Done, Step};
use super::leaf::{self, LeafFigures};
use super::merge;
use super::partition::Partition;
use super::progress::Stage;
use super::span::Longest;
use super::spill::Spill;
use super::tree::Kind;
use crate::{Error, Result};

/// Walks the tree.
pub(super) struct Grower<'a> {
    pub(super) job: &'a Job<'a>,
    pub(super) partition: &'a Partition,
    /// Where the points are, as long as there is a leaf to be done.
    pub(super) spill: Option<Spill>,
    pub(super) longest: Longest,
    pub(super) stage: &'a Stage,
}

impl Grower<'_> {
    /// Triangulates the leaves below `node`, and merges every merge node as soon as all below it is done.
    pub(super) fn grow(&self, node: usize) -> Result<LeafFigures> {
        let Job { config, store, journal, .. } = *self.job;
        match self.partition.tree.nodes[node].kind {
            Kind::Leaf(tile) => {
                let figures = journal.step(Step::Leaf(tile), || self.leaf(tile))?;
                self.job.count(self.stage, Step::Leaf(tile), figures.sites + figures.duplicates);
                Ok(figures)
            }
            Kind::Inner([low, high]) => {
                let (low, high) = rayon::join(|| self.grow(low), || self.grow(high));
                let (mut figures, high) = (low?, high?);
                figures += high;
                if self.partition.tree.is_merge(node) {
                    // Nodes below the root may be merged at once on all threads.
                    let share = if node == 0 { 1 } else { rayon::current_num_threads() as u64 };
                    let memory = config.limits.memory.0 / 4 * 3 / share;
                    let merge = || merge::run(store, &self.partition.tree, node, memory, self.longest);
                    journal.step(Step::Node(node), merge)?;
                }
                Ok(figures)
            }
        }
    }

    fn leaf(&self, tile: usize) -> Result<Done<LeafFigures>> {
        let Job { config, store, triangulator, .. } = *self.job;
        let task = leaf::Task { duplicates: config.input.duplicates, triangulator, longest: self.longest };
        let spill = self.spill.as_ref();
        let spill = spill.ok_or_else(|| Error::Broken(format!("the points of tile {tile} are gone")))?;
        leaf::run(store, self.partition, spill, tile, task)
    }
}
