//! What step G4 in an atlas starts from, made by plain code: labels and texture of several leaves.

use gdt_batch::geometry::Site;
use gdt_batch::gpu::atlas::{Atlas, AtlasLeaf};
use gdt_batch::gpu::buffer_id::BufferId;
use gdt_batch::gpu::steps::{GpuCommand, Recording};
use gdt_batch::gpu::texture_size::TextureSize;
use gdt_batch::gpu::twins::{self, atlas::AtlasDiagram, c4_flip::AT_INFINITY};
use gdt_batch::voronoi::texture_request::{TextureRequest, TextureResolution};
use std::collections::HashMap;

const MAX_PIXELS: u32 = 1 << 24;

/// An atlas whose leaves have their discrete Voronoi diagrams.
#[derive(Default)]
pub(crate) struct PlacedAtlas {
    pub(crate) atlas: Atlas,
    pub(crate) sites: Vec<Site>,
    pub(crate) labels: Vec<u32>,
    pub(crate) texture: Vec<u32>,
    /// A bit for each site that found no pixel.
    pub(crate) missing: Vec<u32>,
    /// How many sites of each leaf found none.
    pub(crate) missing_of: Vec<usize>,
}

/// Gives every site a pixel. A site whose pixel is taken, or the one that took it, moves to the next pixel in the east or west, so that
/// both keep the order of their x. Otherwise it is missing. Returns the number of the site in each pixel [y, x].
fn place(leaf: &AtlasLeaf, sites: &[Site]) -> HashMap<[u32; 2], usize> {
    let mut taken = HashMap::new();
    let mut losers = Vec::new();
    for (i, &site) in sites.iter().enumerate() {
        let [x, y] = leaf.pixel(site);
        if *taken.entry([y, x]).or_insert(i) != i {
            losers.push(i);
        }
    }
    for i in losers {
        let [x, y] = leaf.pixel(sites[i]);
        let winner = taken[&[y, x]];
        let (west, east) = if sites[i] < sites[winner] { (i, winner) } else { (winner, i) };
        if x + 1 < leaf.width && !taken.contains_key(&[y, x + 1]) {
            taken.extend([([y, x], west), ([y, x + 1], east)]);
        } else if x > 0 && !taken.contains_key(&[y, x - 1]) {
            taken.extend([([y, x - 1], west), ([y, x], east)]);
        }
    }
    taken
}

impl PlacedAtlas {
    /// Adds a leaf with a texture of about `pixels_per_site`.
    pub(crate) fn add(&mut self, sites: &[Site], pixels_per_site: f64) {
        self.add_with(sites, TextureResolution::PixelsPerSite(pixels_per_site));
    }

    /// Adds a leaf with a texture of this resolution.
    pub(crate) fn add_with(&mut self, sites: &[Site], resolution: TextureResolution) {
        let request = TextureRequest { resolution, max_side: 16_384, max_pixels: u64::from(MAX_PIXELS) };
        assert!(self.atlas.add(sites, &request, MAX_PIXELS), "the atlas is too small for the test");
        let leaf = *self.atlas.leaves.last().expect("one was added");
        self.sites.extend(sites);
        self.sites.push([AT_INFINITY, 0]);
        self.missing.resize(self.sites.len().div_ceil(32), 0);
        // Labels outside the textures must not matter.
        self.labels.resize(self.atlas.pixels as usize, 0);
        self.texture.resize(self.atlas.pixels as usize, 0);

        let taken = place(&leaf, sites);
        let mut is_missing = vec![true; sites.len()];
        for (&[y, x], &i) in &taken {
            is_missing[i] = false;
            self.texture[leaf.at(x, y) as usize] = !(leaf.first_site + i as u32);
        }
        for i in (0..sites.len()).filter(|&i| is_missing[i]) {
            let at = leaf.first_site as usize + i;
            self.missing[at / 32] |= 1 << (at % 32);
        }
        self.missing_of.push(sites.len() - taken.len());

        let size = TextureSize { width: leaf.width, height: leaf.height };
        let pixels: Vec<u32> = taken.keys().map(|[y, x]| y << 16 | x).collect();
        let mut labels = twins::voronoi_exact(size, &twins::write_sites(size, &pixels));
        twins::remove_islands(size, &mut labels);
        for (row, y) in labels.chunks(leaf.width as usize).zip(0..) {
            self.labels[leaf.at(0, y) as usize..][..row.len()].copy_from_slice(row);
        }
    }

    pub(crate) fn diagram(&self) -> AtlasDiagram<'_> {
        let PlacedAtlas { atlas, sites, labels, texture, .. } = self;
        AtlasDiagram { atlas, labels, texture, sites }
    }

    /// Returns a recording that uploads everything.
    pub(crate) fn upload(&self) -> Recording {
        let mut recording = Recording::default();
        let sites: &[u32] = bytemuck::cast_slice(&self.sites);
        for (id, numbers) in [
            (BufferId::Leaves, self.atlas.leaf_table()),
            (BufferId::Blocks, self.atlas.block_table()),
            (BufferId::Labels, self.labels.clone()),
            (BufferId::Texture, self.texture.clone()),
            (BufferId::Sites, sites.to_vec()),
            (BufferId::Missing, self.missing.clone()),
            (BufferId::Flags, vec![0; self.atlas.leaves.len()]),
        ] {
            recording.commands.push(GpuCommand::Reserve(id, 4 * numbers.len() as u64));
            recording.commands.push(GpuCommand::Upload(id, numbers));
        }
        recording
    }
}
