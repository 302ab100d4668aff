//! The steps on an atlas as lists of dispatches, one file for each step.

mod g4_vertices;
mod g5_count;
mod g6_triangles;
mod give_back;

use crate::gpu::atlas::Atlas;
use crate::gpu::steps::{MAX_WORKGROUPS, WorkgroupCount};

/// Rows of corners in a block.
const ROWS: u64 = 32;
/// Bytes of a block's rows of corners.
const ROW_BYTES: u64 = 16 * ROWS;

/// Returns a grid of `count` workgroups, and how many of them a row has.
fn grid(count: u32) -> (WorkgroupCount, u32) {
    let row = count.clamp(1, MAX_WORKGROUPS);
    (WorkgroupCount::Fixed([row, count.div_ceil(row)]), row)
}

/// Returns how many bytes `numbers` for each pixel, site, record or block take.
fn bytes(count: u32, numbers: u64) -> u64 {
    4 * numbers * u64::from(count)
}

/// Returns the bytes of the tables of leaves and blocks.
fn table_bytes(atlas: &Atlas) -> u64 {
    bytes(atlas.blocks, 2) + 64 * atlas.leaves.len() as u64
}
