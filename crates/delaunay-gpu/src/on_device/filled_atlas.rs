//! An atlas with the sites of its leaves, as a device takes it.

use crate::on_device::atlas::Atlas;
use crate::on_device::device::MAX_SIDE;
use crate::on_device::reference_kernels::c4_flip::AT_INFINITY;
use crate::on_device::returned::ReturnedLayout;
use crate::on_device::timestamps::STAMP_BYTES;
use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};

/// The most pixels of an atlas, which are those of two million sites. All steps together move about 80 bytes a pixel, so a GPU that moves
/// 25 GB/s takes about 0.1 seconds, in several submissions. On such an atlas the dispatches themselves cost next to nothing.
pub const MAX_PIXELS: u32 = 1 << 25;

/// How large an atlas may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasLimits {
    /// The most pixels, with those of the frame.
    pub pixels: u32,
    /// The most bytes of what comes back, which is the largest buffer that depends on the number of sites.
    pub bytes: u64,
}

impl AtlasLimits {
    /// Returns the limits of a device: shaders bind each of its buffers as a whole.
    pub fn of(device: &wgpu::Limits) -> AtlasLimits {
        let binding = device.max_buffer_size.min(device.max_storage_buffer_binding_size);
        // The timestamps come back behind the numbers.
        let bytes = binding.saturating_sub(8 + STAMP_BYTES);
        AtlasLimits { pixels: (bytes / 4).min(u64::from(MAX_PIXELS)) as u32, bytes }
    }
}

/// An atlas, and the sites of its vertices: after those of each leaf comes one at infinity.
#[derive(Clone, Debug, Default)]
pub struct FilledAtlas {
    /// Where the leaves lie.
    pub atlas: Atlas,
    /// The sites.
    pub sites: Vec<Site>,
}

impl FilledAtlas {
    /// Adds a leaf with a texture of this resolution; returns whether there is room for it. A leaf alone gets a coarser texture if it must.
    pub fn add(&mut self, sites: &[Site], resolution: TextureResolution, limits: AtlasLimits) -> bool {
        // The frame takes some room too.
        let tries = if self.atlas.leaves.is_empty() { 3 } else { 1 };
        (0..tries).any(|halvings| {
            let max_pixels = u64::from(limits.pixels >> halvings);
            self.try_to_add(sites, &TextureRequest { resolution, max_side: MAX_SIDE, max_pixels }, limits)
        })
    }

    fn try_to_add(&mut self, sites: &[Site], request: &TextureRequest, limits: AtlasLimits) -> bool {
        if !self.atlas.add(sites, request, limits.pixels) {
            return false;
        }
        if self.bytes_back() > limits.bytes {
            self.atlas.remove_last();
            return false;
        }
        self.sites.extend_from_slice(sites);
        self.sites.push([AT_INFINITY, 0]);
        true
    }

    /// Removes all leaves.
    pub(super) fn clear(&mut self) {
        self.atlas = Atlas::default();
        self.sites.clear();
    }

    /// Returns how many bytes come back from the device.
    pub fn bytes_back(&self) -> u64 {
        4 * ReturnedLayout::of(&self.atlas).numbers() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DENSE: TextureResolution = TextureResolution::PixelsPerSite(16.0);

    fn leaf(count: i32) -> Vec<Site> {
        (0..count).map(|i| [i % 100 * 1000, i / 100 * 1000 + i % 7]).collect()
    }

    #[test]
    fn leaves_are_added_until_pixels_or_bytes_run_out() {
        for limits in [AtlasLimits { pixels: 1 << 17, bytes: 1 << 30 }, AtlasLimits { pixels: 1 << 24, bytes: 300_000 }]
        {
            let mut filled = FilledAtlas::default();
            let mut leaves = 0;
            while filled.add(&leaf(1000), DENSE, limits) {
                leaves += 1;
            }
            assert!((2..10).contains(&leaves), "{leaves}");
            assert_eq!((filled.atlas.leaves.len(), filled.sites.len()), (leaves, leaves * 1001));
            assert!(filled.atlas.pixels <= limits.pixels && filled.bytes_back() <= limits.bytes);
            assert_eq!(filled.sites[1000][0], AT_INFINITY);
        }
    }

    #[test]
    fn every_buffer_of_an_atlas_can_be_bound() {
        let limits = |binding| wgpu::Limits { max_storage_buffer_binding_size: binding, ..wgpu::Limits::default() };
        let AtlasLimits { pixels, bytes } = AtlasLimits::of(&limits(1 << 20));
        assert!(bytes + STAMP_BYTES < 1 << 20 && 4 * u64::from(pixels) <= bytes && pixels > 1 << 17);
        assert_eq!(AtlasLimits::of(&limits(1 << 28)).pixels, MAX_PIXELS);
    }

    #[test]
    fn a_leaf_alone_gets_a_coarser_texture() {
        let limits = AtlasLimits { pixels: 1 << 14, bytes: 1 << 30 };
        let mut filled = FilledAtlas::default();
        assert!(filled.add(&leaf(1000), TextureResolution::Side(1000), limits));
        assert!(!filled.add(&leaf(1000), TextureResolution::Side(1000), limits));
        assert!(filled.atlas.pixels <= 1 << 14);
        assert!(!FilledAtlas::default().add(&leaf(1000), DENSE, AtlasLimits { pixels: 1 << 24, bytes: 60_000 }));
    }
}
