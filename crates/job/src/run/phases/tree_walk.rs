//! Running steps 3 and 4 in the order of the tree: children before their parent, in parallel where there are threads.

use crate::index::{NodeIndex, TileIndex};
use crate::merge_records::Frontier;
use crate::mesh::leaf::{LeafStats, triangulate_leaf};
use crate::mesh::merge::merge_frontiers;
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::partition::tree::{Cell, NodeKind};
use crate::plan::budget::{memory_for_merges, merge_memory};
use crate::preflight::stage_costs::triangulated_share;
use crate::progress::activity::Activity;
use crate::progress::stage::Stage;
use crate::run::folder::Folder;
use crate::run::job::Job;
use crate::run::phases::tile_queue::TileQueue;
use crate::tiles::dependencies::FinishedTile;
use rayon::Scope;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use sys::{Error, Result, fault, interrupt};

/// Walks the tree.
pub(crate) struct TreeWalk<'a> {
    pub(crate) job: &'a Job<'a>,
    pub(crate) folder: &'a Folder,
    pub(crate) partition: &'a Partition,
    pub(crate) points: PointFiles,
    pub(crate) stage: &'a Stage,
    pub(crate) activity: &'a Activity,
    /// Takes the tiles that are finished.
    pub(crate) queue: &'a TileQueue<'a>,
    /// The merge nodes that do not fit the memory, with the most sites that each may have to merge. The walk goes on without them, so that one
    /// message can name a limit that suffices for all nodes of the part.
    pub(crate) unmerged: Mutex<BTreeMap<NodeIndex, u64>>,
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
        interrupt::check()?;
        let (plan, triangulator) = (self.job.plan, self.job.triangulator);
        let (points, store) = (self.partition.points(tile), &self.folder.store);
        let triangulate = || triangulate_leaf(plan, self.partition, &self.points, store, triangulator, tile);
        let stats = self.activity.time(points, triangulate)?;
        fault::point("leaf");
        self.stage.advance(triangulated_share(points));
        // Any other leaf passes its hull up.
        if self.partition.tree.node(node).cell == Cell::PLANE || stats.sites == 0 {
            self.queue.push(scope, FinishedTile { tile, last_merge: node });
        }
        Ok(stats)
    }

    fn merge(&self, scope: &Scope<'a>, node: NodeIndex) -> crate::Result<()> {
        interrupt::check()?;
        let (plan, threads) = (self.job.plan, self.job.threads);
        let store = &self.folder.store;
        let below = self.partition.tree.merged_by(node);
        if below.iter().any(|child| self.unmerged().contains_key(child)) {
            return self.leave_out(node, &below);
        }
        let memory = merge_memory(&plan.options, node == NodeIndex::ROOT, threads);
        let sources: Vec<_> = below.iter().map(|&child| (store, child)).collect();
        let cell = self.partition.tree.node(node).cell;
        match self.activity.time(0, || merge_frontiers(plan, cell, &sources, store, memory, node)) {
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
        let sites = |child: &NodeIndex| match self.unmerged().get(child) {
            Some(sites) => Ok(*sites),
            None => Frontier::count(&self.folder.store, *child),
        };
        let sites = below.iter().map(sites).sum::<Result<u64>>()?;
        self.unmerged().insert(node, sites);
        Ok(())
    }

    fn unmerged(&self) -> MutexGuard<'_, BTreeMap<NodeIndex, u64>> {
        self.unmerged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Checks that no node was left out.
    ///
    /// # Errors
    /// [`Error::Memory`] names the limit with which all of them fit.
    pub(crate) fn check_memory(&self) -> Result<()> {
        let (nodes, options) = (self.unmerged(), &self.job.plan.options);
        let Some(most) = nodes.values().max() else { return Ok(()) };
        // If the mesh proves too fine for the lattice, that of a coarser one has somewhat more to merge.
        let more = if options.input.resolution.step().is_none() { 10 } else { 0 };
        let needs = nodes.iter().map(|(node, sites)| (*node == NodeIndex::ROOT, sites + sites / 100 * more));
        Err(Error::Memory(format!(
            "{most} sites lie on circles or triangles that no tile can decide alone, and [limits] memory = \"{}\" has no room to join \
             them on {} threads; set memory = \"{}\", which is enough for all that is left, or less together with fewer [limits] \
             threads",
            options.limits.memory,
            options.threads(),
            memory_for_merges(options, needs)
        )))
    }
}
