//! A device that answers at once: its meshes are made in advance, with the twins of the shaders.

use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::voronoi::counts::PipelineCounts;
use delaunay::voronoi::device_mesh::DeviceMesh;
use delaunay::voronoi::rejection::Rejection;
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};
use delaunay::voronoi::{PipelineBuffers, from_device};
use delaunay_gpu::atlas::{Atlas, AtlasLeaf};
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::reference_kernels::atlas;
use delaunay_gpu::reference_kernels::c4_flip::AT_INFINITY;
use delaunay_gpu::returned::ReturnedAtlas;

const MAX_PIXELS: u32 = 1 << 24;

/// The device's answer for a leaf.
#[derive(Clone)]
pub(crate) struct Answer {
    pub(crate) flags: u32,
    pub(crate) records: Vec<u32>,
    pub(crate) missing: Vec<u32>,
    pub(crate) unfinished: Vec<u32>,
    pub(crate) block_starts: Vec<u32>,
    pub(crate) leaf: AtlasLeaf,
}

impl Answer {
    /// Returns what a device would make of `sites` in a texture of about `pixels_per_site`.
    pub(crate) fn new(sites: &[Site], pixels_per_site: f64) -> Answer {
        let resolution = TextureResolution::PixelsPerSite(pixels_per_site);
        let request = TextureRequest { resolution, max_side: 16_384, max_pixels: u64::from(MAX_PIXELS) };
        let mut made = Atlas::default();
        assert!(made.add(sites, &request, MAX_PIXELS), "the atlas is too small");
        let numbers = atlas::mesh(&made, &[sites, &[[AT_INFINITY, 0]]].concat(), VoronoiMethod::Exact);
        let back = ReturnedAtlas::new(&made, &numbers).and_then(|atlas| atlas.leaf(0)).expect("the leaf came back");
        Answer {
            flags: back.flags,
            records: back.records.to_vec(),
            missing: back.missing.to_vec(),
            unfinished: back.unfinished.to_vec(),
            block_starts: back.block_starts.to_vec(),
            leaf: made.leaves[0],
        }
    }

    /// Returns what the pipeline makes of the answer.
    pub(crate) fn complete(
        &self,
        sites: &[Site],
        buffers: &mut PipelineBuffers,
    ) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
        if self.flags != 0 {
            return Err(Rejection::NotAccepted("the device has flagged the leaf"));
        }
        let block_of = |site| self.leaf.block_of(site);
        let made = DeviceMesh {
            records: &self.records,
            missing: &self.missing,
            unfinished: &self.unfinished,
            block_starts: &self.block_starts,
            block_of: &block_of,
        };
        from_device(sites, &made, buffers)
    }
}
