//! What a job's work takes of the memory, and how many threads that leaves room for.

use crate::job::options::JobOptions;
use crate::{Error, Result};

/// Bytes that one site of a leaf takes while the leaf is triangulated: points, sort keys, sites, mesh and marks.
pub const BYTES_PER_LEAF_SITE: u64 = 500;
/// The least number of bytes that a thread takes: a decoder with its chunk, a slice of points and their order.
const BYTES_PER_THREAD: u64 = 8 << 20;

/// Returns how many threads a job of `points` points uses: as many as the user wants and the memory has room for, a leaf each.
///
/// # Errors
/// [`Error::Config`] if the memory does not hold one leaf.
pub fn workers(options: &JobOptions, points: u64) -> Result<usize> {
    let per_tile = options.triangulation.max_points_per_tile.0.min(points).max(1);
    let per_leaf = per_tile.saturating_mul(BYTES_PER_LEAF_SITE).max(BYTES_PER_THREAD);
    match working_memory(options) / per_leaf {
        0 => Err(Error::Config(format!(
            "tiles of {per_tile} points take about {} MiB a thread, more than [limits] memory = \"{}\" has room for: lower \
             [triangulation] max_points_per_tile or raise memory",
            per_leaf >> 20,
            options.limits.memory
        ))),
        leaves => Ok(options.threads().min(leaves as usize)),
    }
}

/// Returns the bytes that all steps together may use at one time. The rest is for code, stacks, decoders and what the allocator
/// keeps.
pub fn working_memory(options: &JobOptions) -> u64 {
    options.limits.memory.0 / 4 * 3
}

/// Returns the bytes that the merge at one node may use.
///
/// Nodes below the root may be merged on all threads at the same time. During the merge at the root the other threads may write
/// tiles, which takes half the memory of leaves.
pub fn merge_memory(options: &JobOptions, is_root: bool, threads: usize) -> u64 {
    let memory = working_memory(options);
    if !is_root {
        return memory / threads as u64;
    }
    let tile = options.triangulation.max_points_per_tile.0.saturating_mul(BYTES_PER_LEAF_SITE / 2);
    memory.saturating_sub(tile.saturating_mul(threads as u64 - 1))
}

/// Returns the bytes for the buffers that collect points by bucket while the inputs are read.
pub fn read_buffer_memory(options: &JobOptions) -> u64 {
    options.limits.memory.0 / 6
}
