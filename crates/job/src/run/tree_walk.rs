//! Running steps 3 and 4 in the order of the tree: children before their parent, in parallel where there are threads.

use crate::index::{NodeIndex, TileIndex};
use crate::merge_records::Frontier;
use crate::mesh::leaf::{LeafStats, triangulate_leaf};
use crate::mesh::merge::merge_frontiers;
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::partition::tree::{Cell, NodeKind};
use crate::plan::budget::merge_memory;
use crate::plan::job_plan::Plan;
use crate::progress::activity::Activity;
use crate::progress::stage::Stage;
use crate::records::{JobStep, StepOutput};
use crate::run::freeing::Freeing;
use crate::run::postponed_merges::PostponedMerges;
use crate::run::run_context::RunContext;
use crate::run::stage_costs::triangulated_share;
use crate::run::tile_queue::TileQueue;
use crate::tiles::dependencies::FinishedTile;
use rayon::Scope;
use sys::{Error, Result};

/// Walks the tree.
pub(crate) struct TreeWalk<'a> {
    pub(crate) run: &'a RunContext<'a>,
    pub(crate) plan: &'a Plan,
    pub(crate) partition: &'a Partition,
    /// The points; `None` if all leaves are done.
    pub(crate) points: Option<PointFiles>,
    pub(crate) stage: &'a Stage,
    pub(crate) activity: &'a Activity,
    /// Takes the tiles that are finished.
    pub(crate) queue: &'a TileQueue<'a>,
    /// Takes the points that are not needed any more.
    pub(crate) freeing: &'a Freeing<'a>,
    /// Takes the nodes that do not fit the memory.
    pub(crate) unmerged: PostponedMerges,
}

impl<'a> TreeWalk<'a> {
    /// Triangulates the leaves below `node`, and merges at every merge node once everything below it is done. Returns `None` if
    /// something failed; the queue has the error.
    pub(crate) fn walk(&self, scope: &Scope<'a>, node: NodeIndex) -> Option<LeafStats> {
        match self.partition.tree.node(node).kind {
            NodeKind::Leaf(tile) => self.queue.attempt(|| self.leaf(scope, node, tile)),
            NodeKind::Inner([low, high]) => {
                let (low, high) = rayon::join(|| self.walk(scope, low), || self.walk(scope, high));
                let (mut stats, high) = (low?, high?);
                stats += high;
                if self.partition.tree.is_merge(node) {
                    self.queue.attempt(|| self.merge(scope, node))?;
                }
                Some(stats)
            }
        }
    }

    fn leaf(&self, scope: &Scope<'a>, node: NodeIndex, tile: TileIndex) -> crate::Result<LeafStats> {
        let (step, points) = (JobStep::Leaf(tile), self.partition.points(tile));
        let triangulate = || self.activity.time(points, || self.triangulate(tile));
        let stats: LeafStats = self.run.journal.step(step, triangulate)?;
        self.freeing.leaf_done(tile);
        self.run.count(self.stage, step, triangulated_share(points));
        // Any other leaf passes its hull up.
        if self.partition.tree.node(node).cell == Cell::PLANE || stats.sites == 0 {
            self.queue.push(scope, FinishedTile { tile, last_merge: node });
        }
        Ok(stats)
    }

    fn triangulate(&self, tile: TileIndex) -> crate::Result<StepOutput<LeafStats>> {
        let RunContext { store, triangulator, .. } = *self.run;
        let points = self.points.as_ref();
        let points = points.ok_or_else(|| Error::Broken(format!("the points of tile {tile} are gone")))?;
        triangulate_leaf(self.plan, self.partition, points, store, triangulator, tile)
    }

    fn merge(&self, scope: &Scope<'a>, node: NodeIndex) -> crate::Result<()> {
        let RunContext { store, journal, threads, .. } = *self.run;
        let below = self.partition.tree.merged_by(node);
        if below.iter().any(|&child| self.unmerged.sites(child).is_some()) {
            return self.leave_out(node, &below);
        }
        let memory = merge_memory(&self.plan.options, node == NodeIndex::ROOT, threads);
        let sources: Vec<_> = below.iter().map(|&child| (store, child)).collect();
        let cell = self.partition.tree.node(node).cell;
        let merge = || self.activity.time(0, || merge_frontiers(self.plan, cell, &sources, store, memory, node));
        match journal.step(JobStep::Merge(node), merge) {
            Err(crate::Error::System(Error::Memory(_))) => self.leave_out(node, &below),
            merged => {
                for tile in merged? {
                    self.queue.push(scope, FinishedTile { tile, last_merge: node });
                }
                Ok(())
            }
        }
    }

    /// Notes that `node` is not merged. It never passes up more sites than come from `below`.
    fn leave_out(&self, node: NodeIndex, below: &[NodeIndex]) -> crate::Result<()> {
        let sites = |child: &NodeIndex| match self.unmerged.sites(*child) {
            Some(sites) => Ok(sites),
            None => Frontier::count(self.run.store, *child),
        };
        self.unmerged.add(node, below.iter().map(sites).sum::<Result<u64>>()?);
        Ok(())
    }
}
