//! A device that answers at once: its meshes are made in advance, with the twins of the shaders.

use super::linked::{LinkedMesh, PixelGrid};
use gdt_batch::geometry::Site;
use gdt_batch::gpu::mesh_steps::FLIP_ROUNDS;
use gdt_batch::gpu::twins::c4_flip::{FlipState, flip_round};
use gdt_batch::mesh::half_edge::HalfEdgeMesh;
use gdt_batch::voronoi::counts::PipelineCounts;
use gdt_batch::voronoi::device_mesh::DeviceMesh;
use gdt_batch::voronoi::rejection::Rejection;
use gdt_batch::voronoi::{PipelineBuffers, from_device};
use std::collections::HashMap;

/// The device's answer for a leaf.
#[derive(Clone)]
pub(crate) struct Answer {
    pub(crate) records: Vec<u32>,
    pub(crate) missing: Vec<u32>,
    pub(crate) unfinished: Vec<u32>,
    pub(crate) block_starts: Vec<u32>,
    pub(crate) grid: PixelGrid,
}

impl Answer {
    /// Returns what a device would make of `sites` in a texture of about `pixels_per_site`.
    pub(crate) fn new(sites: &[Site], pixels_per_site: f64) -> Answer {
        let mesh = LinkedMesh::new(sites, pixels_per_site);
        let mut state = FlipState::new(mesh.records);
        (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut state, &mesh.sites, round));
        let sections = state.sections();
        let (dirty, inverted) = (sections.dirty(FLIP_ROUNDS + 1), sections.inverted());
        let unfinished = state.marks[dirty].iter().zip(&state.marks[inverted]).map(|(a, b)| a | b).collect();
        let numbers: HashMap<Site, u32> = sites.iter().copied().zip(0..).collect();
        // The vertex at infinity is no site of the input.
        let number = |vertex: u32| numbers.get(&mesh.sites[vertex as usize]).copied().unwrap_or(sites.len() as u32);
        let mut missing = vec![u32::MAX; sites.len().div_ceil(32)];
        let mut records = state.records;
        for corner in records.chunks_exact_mut(8).flat_map(|record| &mut record[..3]) {
            *corner = number(*corner);
            if let Some(word) = missing.get_mut(*corner as usize / 32) {
                *word &= !(1 << (*corner % 32));
            }
        }
        let not_placed = (0..sites.len()).filter(|v| missing[v / 32] >> (v % 32) & 1 != 0).count();
        assert_eq!(not_placed, mesh.missing);
        Answer { records, missing, unfinished, block_starts: mesh.block_starts, grid: mesh.grid }
    }

    /// Returns what the pipeline makes of the answer.
    pub(crate) fn complete(
        &self,
        sites: &[Site],
        buffers: &mut PipelineBuffers,
    ) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
        let made = DeviceMesh {
            records: &self.records,
            missing: &self.missing,
            unfinished: &self.unfinished,
            block_starts: &self.block_starts,
            block_of: &|site| self.grid.block(site),
        };
        from_device(sites, &made, buffers)
    }
}
