//! What step G4 in an atlas starts from, made by the twins of steps G1 to G3.

use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};
use delaunay_gpu::atlas::Atlas;
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels;
use delaunay_gpu::reference_kernels::atlas::AtlasDiagram;
use delaunay_gpu::reference_kernels::c4_flip::AT_INFINITY;

const MAX_PIXELS: u32 = 1 << 24;

/// An atlas whose leaves have their discrete Voronoi diagrams once `place` was called.
#[derive(Default)]
pub(crate) struct PlacedAtlas {
    pub(crate) atlas: Atlas,
    pub(crate) sites: Vec<Site>,
    pub(crate) labels: Vec<u32>,
    pub(crate) texture: Vec<u32>,
    /// A bit for each site that found no pixel.
    pub(crate) missing: Vec<u32>,
    /// The flags of each leaf after step G3.
    pub(crate) flags: Vec<u32>,
}

impl PlacedAtlas {
    /// Returns an atlas of these leaves, each in a texture of about `pixels_per_site`.
    pub(crate) fn new<'a>(leaves: impl IntoIterator<Item = &'a [Site]>, pixels_per_site: f64) -> PlacedAtlas {
        let mut placed = PlacedAtlas::default();
        leaves.into_iter().for_each(|sites| placed.add(sites, TextureResolution::PixelsPerSite(pixels_per_site)));
        placed.place();
        placed
    }

    /// Adds a leaf with a texture of this resolution.
    pub(crate) fn add(&mut self, sites: &[Site], resolution: TextureResolution) {
        let request = TextureRequest { resolution, max_side: 16_384, max_pixels: u64::from(MAX_PIXELS) };
        assert!(self.atlas.add(sites, &request, MAX_PIXELS), "the atlas is too small for the test");
        self.sites.extend(sites);
        self.sites.push([AT_INFINITY, 0]);
    }

    /// Does steps G1 to G3.
    pub(crate) fn place(&mut self) {
        let written = reference_kernels::atlas::write_sites(&self.atlas, &self.sites);
        self.labels = reference_kernels::atlas::voronoi(&self.atlas, &written.texture, VoronoiMethod::Exact);
        self.flags = reference_kernels::atlas::remove_islands(&self.atlas, &mut self.labels);
        (self.texture, self.missing) = (written.texture, written.missing);
    }

    pub(crate) fn diagram(&self) -> AtlasDiagram<'_> {
        let PlacedAtlas { atlas, sites, labels, texture, .. } = self;
        AtlasDiagram { atlas, labels, texture, sites }
    }

    /// Returns a recording that uploads everything.
    pub(crate) fn upload(&self) -> Recording {
        let mut recording = Recording::default();
        recording.upload_atlas(&self.atlas, &self.sites);
        // Labels outside the textures must not matter.
        let labels =
            self.labels.iter().map(|&label| if label == reference_kernels::NONE { 0 } else { label }).collect();
        for (id, numbers) in [
            (BufferId::Labels, labels),
            (BufferId::Texture, self.texture.clone()),
            (BufferId::Missing, self.missing.clone()),
            (BufferId::Flags, self.flags.clone()),
        ] {
            recording.commands.push(GpuCommand::Reserve(id, 4 * numbers.len() as u64));
            recording.commands.push(GpuCommand::Upload(id, numbers));
        }
        recording
    }
}

/// Records all steps on an atlas.
pub(crate) fn recorded(placed: &PlacedAtlas) -> Recording {
    Recording::mesh(&placed.atlas, &placed.sites, VoronoiMethod::Exact)
}
