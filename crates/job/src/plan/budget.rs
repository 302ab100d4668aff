//! What a job's work takes of the memory, and how many threads that leaves room for.

use crate::options::JobOptions;
use sys::{Error, Result};

/// Bytes that one site of a leaf takes while the leaf is triangulated: points, sort keys, sites, mesh and marks.
pub const BYTES_PER_LEAF_SITE: u64 = 500;
/// The least number of bytes that a thread takes: a decoder with its chunk, a slice of points and their order.
const BYTES_PER_THREAD: u64 = 8 << 20;
/// The peak number of bytes that merging takes for each frontier site: edges, mesh, marks and the seam.
pub const BYTES_PER_MERGED_SITE: u64 = 400;

/// Returns how many threads a job of `points` points uses: as many as the user wants and the memory has room for, a leaf each.
///
/// # Errors
/// [`Error::Config`] if the memory does not hold one leaf.
pub fn workers(options: &JobOptions, points: u64) -> Result<usize> {
    let per_tile = options.triangulation.max_points_per_tile.0.min(points).max(1);
    let per_leaf = per_tile.saturating_mul(BYTES_PER_LEAF_SITE).max(BYTES_PER_THREAD);
    match working_memory(options) / per_leaf {
        0 => Err(Error::Config(format!(
            "tiles of {per_tile} points take about {} MiB a thread, more than [limits] memory = \"{}\" has room for: set memory = \
             \"{}\", or lower [triangulation] max_points_per_tile",
            per_leaf >> 20,
            options.limits.memory,
            limit_for(per_leaf)
        ))),
        leaves => Ok(options.threads().min(leaves as usize)),
    }
}

/// Returns the bytes that all steps together may use at one time. The rest is for code, stacks, decoders and what the allocator
/// keeps.
pub fn working_memory(options: &JobOptions) -> u64 {
    options.limits.memory.0 / 4 * 3
}

/// Returns the bytes that a selection may use. Blocks come and go and grow, and the allocator keeps a part of what they leave, which is most where
/// the memory is small.
pub(crate) fn selection_memory(options: &JobOptions) -> u64 {
    const KEPT: u64 = 80 << 20;
    let quarter = working_memory(options) / 4;
    3 * quarter - (quarter / 4 * 5).min(KEPT)
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

/// Returns the least `[limits] memory`, as a user writes it, of which the part for work is at least `working` bytes.
pub(crate) fn limit_for(working: u64) -> String {
    // Messages name whole steps.
    const STEP: u64 = 64 << 20;
    let limit = working.div_ceil(3).saturating_mul(4).div_ceil(STEP).saturating_mul(STEP);
    format!("{} MiB", limit >> 20)
}

/// Returns the `[limits] memory` with which these merges fit, on all the threads that the user wants: whether each is at the root, and
/// its sites.
pub fn memory_for_merges(options: &JobOptions, merges: impl Iterator<Item = (bool, u64)>) -> String {
    let threads = options.threads() as u64;
    let tile = options.triangulation.max_points_per_tile.0.saturating_mul(BYTES_PER_LEAF_SITE / 2);
    let working = merges.map(|(is_root, sites)| {
        let needed = sites.saturating_mul(BYTES_PER_MERGED_SITE);
        match is_root {
            true => needed.saturating_add(tile.saturating_mul(threads - 1)),
            false => needed.saturating_mul(threads),
        }
    });
    limit_for(working.max().unwrap_or(0))
}

/// Returns the bytes for the buffers that collect points by bucket while the inputs are read.
pub fn read_buffer_memory(options: &JobOptions) -> u64 {
    options.limits.memory.0 / 6
}

/// Returns the bytes of inputs of other machines that may be in memory before they are needed.
pub fn network_memory(options: &JobOptions) -> u64 {
    // So many take no longer for any connection.
    const ENOUGH: u64 = 256 << 20;
    (options.limits.memory.0 / 16).min(ENOUGH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Limits, MemoryLimit, Threads};

    fn options(memory: u64, threads: usize, max_points_per_tile: u64) -> JobOptions {
        let text = format!(
            r#"{{"input":{{"files":[]}},"triangulation":{{"backend":"auto","max_points_per_tile":{max_points_per_tile}}},
            "gpu":{{"voronoi":"auto","adapter":null,"texture":"auto"}},"output":{{"directory":"out"}},"limits":{{}}}}"#
        );
        let options: JobOptions = serde_json::from_str(&text).unwrap();
        JobOptions {
            updates: false,
            limits: Limits { memory: MemoryLimit(memory), threads: Threads(threads), ..Limits::default() },
            ..options
        }
    }

    fn bytes(limit: String) -> u64 {
        MemoryLimit::try_from(limit).unwrap().0
    }

    #[test]
    fn the_memory_that_a_message_names_has_room_for_every_merge() {
        for (threads, per_tile) in [(1, 50_000), (2, 50_000), (16, 50_000), (64, 1_000), (16, 300_000)] {
            let own = options(1 << 30, threads, per_tile);
            let merges = [(true, 1_300_000), (false, 200_000), (false, 900_000)];
            let limit = bytes(memory_for_merges(&own, merges.into_iter()));
            let raised = options(limit, threads, per_tile);
            let used = workers(&raised, u64::MAX).unwrap();
            for (is_root, sites) in merges {
                let room = merge_memory(&raised, is_root, used);
                assert!(room >= sites * BYTES_PER_MERGED_SITE, "{threads} threads: {room} bytes for {sites} sites");
            }
        }
    }

    #[test]
    fn the_memory_that_a_message_names_has_room_for_a_tile() {
        for per_tile in [300_000, 1_000_000, 9_876_543] {
            let small = workers(&options(128 << 20, 1, per_tile), u64::MAX).unwrap_err().to_string();
            let (_, after) = small.split_once("set memory = \"").unwrap();
            let limit = bytes(after.split_once('"').unwrap().0.to_string());
            assert_eq!(workers(&options(limit, 1, per_tile), u64::MAX).unwrap(), 1);
        }
    }
}
