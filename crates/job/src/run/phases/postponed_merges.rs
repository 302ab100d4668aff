//! Merge nodes that do not fit the memory. The walk goes on without them, so that one message can name a limit that suffices for all nodes of
//! the part.

use crate::index::NodeIndex;
use crate::options::JobOptions;
use crate::plan::budget::memory_for_merges;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use sys::{Error, Result};

/// The merge nodes that were left out, with the most sites that each may have to merge. Any thread may call its methods.
#[derive(Default)]
pub(crate) struct PostponedMerges(Mutex<BTreeMap<NodeIndex, u64>>);

impl PostponedMerges {
    /// Adds `node`.
    pub(crate) fn add(&self, node: NodeIndex, sites: u64) {
        self.nodes().insert(node, sites);
    }

    /// Returns the most sites that `node` may pass up; `None` if it was merged.
    pub(crate) fn sites(&self, node: NodeIndex) -> Option<u64> {
        self.nodes().get(&node).copied()
    }

    /// Checks that no node was left out.
    ///
    /// # Errors
    /// [`Error::Memory`] names the limit with which all of them fit.
    pub(crate) fn check(&self, options: &JobOptions) -> Result<()> {
        let nodes = self.nodes();
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

    fn nodes(&self) -> MutexGuard<'_, BTreeMap<NodeIndex, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
