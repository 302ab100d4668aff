//! The steps of the paper on an atlas, as lists of dispatches. No dispatch is indirect. Each declares the bytes that
//! it moves at the least.

mod g1_write_sites;
mod g2_voronoi;
mod g3_islands;
mod g4_vertices;
mod g5_count;
mod g6_triangles;
mod give_back;

pub use g3_islands::ATLAS_ISLAND_ROUNDS;
pub(super) use g3_islands::ISLANDS_PER_BLOCK;

use crate::on_device::atlas::Atlas;
use crate::on_device::buffer_id::BufferId::{Blocks, Flags, Leaves, Sites};
use crate::on_device::recording::{GpuCommand, MAX_WORKGROUPS, Recording};
use crate::options::VoronoiMethod;
use delaunay::geometry::Site;

/// Bytes of an entry of the table of blocks.
const BLOCK_BYTES: u64 = 8;
/// Bytes of a number for every column or every row of a block.
const WORDS_BYTES: u64 = 4 * 32;
/// Rows of corners in a block.
const ROWS: u64 = 32;
/// Bytes of a block's rows of corners.
const ROW_BYTES: u64 = 16 * ROWS;

impl Recording {
    /// Records all steps on an atlas, from its sites to what the CPU reads. After the sites of each leaf, `sites` has one at infinity.
    pub fn mesh(atlas: &Atlas, sites: &[Site], voronoi: VoronoiMethod) -> Recording {
        let mut recording = Recording::default();
        recording.upload_atlas(atlas, sites);
        recording.write_atlas_sites(atlas);
        recording.atlas_voronoi(atlas, voronoi);
        recording.remove_atlas_islands(atlas);
        recording.atlas_mesh(atlas);
        recording
    }

    /// Records the steps from G4 on.
    pub fn atlas_mesh(&mut self, atlas: &Atlas) {
        self.atlas_vertices(atlas);
        self.atlas_count(atlas);
        self.atlas_triangles(atlas);
        self.flip(atlas.records);
        self.give_back(atlas);
    }

    /// Uploads an atlas. After the sites of each leaf, `sites` has one at infinity. No leaf is flagged.
    pub fn upload_atlas(&mut self, atlas: &Atlas, sites: &[Site]) {
        let tables = [(Leaves, atlas.leaf_table()), (Blocks, atlas.block_table())];
        for (id, numbers) in tables.into_iter().chain([(Sites, bytemuck::cast_slice(sites).to_vec())]) {
            self.reserve(id, numbers.len() as u64);
            self.commands.push(GpuCommand::Upload(id, numbers));
        }
        self.reserve(Flags, atlas.leaves.len() as u64);
        self.commands.push(GpuCommand::Clear(Flags, 4 * atlas.leaves.len() as u64));
    }
}

/// Returns the dispatch of this many workgroups, and how many of them a row has.
fn grid(workgroups: u32) -> ([u32; 2], u32) {
    let across = workgroups.min(MAX_WORKGROUPS);
    ([across, workgroups.div_ceil(across.max(1))], across)
}

/// Returns the bytes of a number for every pixel.
fn pixel_bytes(atlas: &Atlas) -> u64 {
    4 * u64::from(atlas.pixels)
}

/// Returns how many bytes `numbers` for each pixel, site, record or block take.
fn bytes(count: u32, numbers: u64) -> u64 {
    4 * numbers * u64::from(count)
}

/// Returns the bytes of the tables of leaves and blocks.
fn table_bytes(atlas: &Atlas) -> u64 {
    bytes(atlas.blocks, 2) + 64 * atlas.leaves.len() as u64
}
