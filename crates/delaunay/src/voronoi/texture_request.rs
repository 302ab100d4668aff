//! How large a texture should be.

/// How large a texture should be, and how large it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRequest {
    /// How fine the texture should be, unless a limit makes it coarser.
    pub resolution: TextureResolution,
    /// The largest width and height.
    pub max_side: u32,
    /// The largest number of pixels.
    pub max_pixels: u64,
}

/// How fine a texture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TextureResolution {
    /// Pixels per site. Fewer pixels cause more repairs, more pixels a longer distance transform.
    PixelsPerSite(f64),
    /// Pixels along the longer side.
    Side(u32),
}

impl Default for TextureRequest {
    /// Returns what is fastest on the CPU.
    fn default() -> TextureRequest {
        TextureRequest { resolution: TextureResolution::PixelsPerSite(5.0), max_side: 65_535, max_pixels: u64::MAX }
    }
}

impl TextureRequest {
    /// Returns the pixels per lattice step for `sites` sites in a box of `extent` steps.
    pub fn scale(&self, extent: [f64; 2], sites: usize) -> f64 {
        let longer = extent[0].max(extent[1]);
        let wanted = match self.resolution {
            TextureResolution::PixelsPerSite(pixels) => (pixels * sites as f64 / (extent[0] * extent[1])).sqrt(),
            TextureResolution::Side(pixels) => f64::from(pixels) / longer,
        };
        let mut scale = wanted.min(1.0).min(f64::from(self.max_side) / longer);
        // A side has at least one pixel, so the area alone does not tell what fits.
        while extent.map(|side| pixels_along(side, scale) as u64).iter().product::<u64>() > self.max_pixels {
            scale *= 0.98;
        }
        scale
    }
}

/// Returns the number of pixels along a side of `steps` lattice steps.
pub(super) fn pixels_along(steps: f64, scale: f64) -> usize {
    ((steps - 1.0) * scale) as usize + 1
}
