//! Step G2 on an atlas: the twin of `shaders/atlas/g2_voronoi_exact.wgsl` and `shaders/atlas/g2_voronoi_jfa.wgsl`.

use crate::on_device::atlas::Atlas;
use crate::on_device::reference_kernels::atlas::{pixels_of, size_of};
use crate::on_device::reference_kernels::label::NONE;
use crate::on_device::reference_kernels::{voronoi_exact, voronoi_jfa};
use crate::options::VoronoiMethod;

/// Returns the label of every pixel; that of the frame is the colour of infinity.
pub fn voronoi(atlas: &Atlas, texture: &[u32], method: VoronoiMethod) -> Vec<u32> {
    let mut labels = vec![NONE; texture.len()];
    for leaf in &atlas.leaves {
        let own: Vec<u32> = pixels_of(leaf).map(|at| texture[at]).collect();
        let found = match method {
            VoronoiMethod::Auto | VoronoiMethod::Exact => voronoi_exact(size_of(leaf), &own),
            VoronoiMethod::Jfa => voronoi_jfa(size_of(leaf), &own),
        };
        pixels_of(leaf).zip(found).for_each(|(at, label)| labels[at] = label);
    }
    labels
}
