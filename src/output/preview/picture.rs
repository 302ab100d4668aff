//! Puts the fragments of all tiles together, shades them and writes the PNG.

use crate::output::preview::canvas::{Canvas, Texel};
use rayon::prelude::*;

/// Slope (rise over run) that the steeper part of the terrain should get for its relief to be seen.
const TARGET_SLOPE: f32 = 0.6;

/// This share of the terrain is less steep than what is brought to [`TARGET_SLOPE`].
const STEEP_SHARE: f64 = 0.7;

/// Bounds of the vertical exaggeration: below, for a canopy of trees; above, so that noise does not look like hills.
const EXAGGERATION: [f32; 2] = [0.3, 20.0];

/// Direction to the light, north-west at 45 degrees.
const LIGHT: [f32; 3] = [-0.5, 0.5, std::f32::consts::FRAC_1_SQRT_2];

/// Brightness without any direct light, and added by it on flat ground.
const AMBIENT: f32 = 0.35;
const DIRECT: f32 = 0.65;

/// Brightness of a tile's border.
const BORDER: f32 = 0.6;

/// Borders are left out where tiles have fewer pixels than this on average: there would be nothing else.
const LEAST_TILE: usize = 150;

/// In [`Picture::owner`]: no triangle there.
const NOBODY: u32 = 0;

/// The picture of a terrain; see-through where there is no triangle.
pub struct Picture {
    width: usize,
    texels: Vec<Texel>,
    /// For every pixel 1 + the number of its tile, or [`NOBODY`].
    owner: Vec<u32>,
    tiles: usize,
}

impl Picture {
    /// An empty picture; 16 bytes a pixel.
    pub fn new(canvas: &Canvas) -> Picture {
        let [width, height] = canvas.size().map(|v| v as usize);
        let empty: Texel = bytemuck::Zeroable::zeroed();
        Picture { width, texels: vec![empty; width * height], owner: vec![NOBODY; width * height], tiles: 0 }
    }

    /// Puts in what [`Canvas::draw`] gave for tile number `tile`.
    pub fn add(&mut self, tile: u32, fragment: &[Texel]) {
        self.tiles += 1;
        for texel in fragment {
            if let Some(owner) = self.owner.get_mut(texel.pixel as usize) {
                *owner = tile.saturating_add(1);
                self.texels[texel.pixel as usize] = *texel;
            }
        }
    }

    /// The picture as a PNG file.
    pub fn png(&self) -> Vec<u8> {
        let pixels = self.shaded();
        let mut bytes = Vec::new();
        let height = self.texels.len() / self.width;
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        // A tenth of the time for a fifth more bytes.
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut png| png.write_image_data(pixels.as_flattened()));
        written.expect("a picture of the size it says, into memory");
        bytes
    }

    fn shaded(&self) -> Vec<[u8; 4]> {
        let exaggeration = self.exaggeration();
        let covered = self.owner.iter().filter(|&&owner| owner != NOBODY).count();
        let borders = covered >= LEAST_TILE * self.tiles;
        let shade = |i: usize| {
            if self.owner[i] == NOBODY {
                return [0; 4];
            }
            let border = if borders && self.is_border(i) { BORDER } else { 1.0 };
            let light = brightness(self.texels[i], exaggeration) * border;
            let [r, g, b] = self.texels[i].color.map(|v| (v as f32 * light).min(255.0) as u8);
            [r, g, b, 255]
        };
        (0..self.texels.len()).into_par_iter().with_min_len(self.width).map(shade).collect()
    }

    /// Whether the next pixel to the right or below is another tile's.
    fn is_border(&self, i: usize) -> bool {
        let differs = |j: usize| self.owner.get(j).is_some_and(|&owner| owner != NOBODY && owner != self.owner[i]);
        (!(i + 1).is_multiple_of(self.width) && differs(i + 1)) || differs(i + self.width)
    }

    /// The factor that brings the slope at [`STEEP_SHARE`] of the terrain to [`TARGET_SLOPE`].
    fn exaggeration(&self) -> f32 {
        // Classes of slope by exponent and three binary digits, finer than the eye.
        let mut histogram = [0u64; 2048];
        let texels = self.texels.iter().zip(&self.owner).filter(|&(_, &owner)| owner != NOBODY);
        for (texel, _) in texels {
            let [x, y, z] = normal(*texel);
            let steepness = (x * x + y * y).sqrt() / z;
            histogram[(steepness.to_bits() >> 20) as usize & 2047] += 1;
        }
        let wanted = (histogram.iter().sum::<u64>() as f64 * STEEP_SHARE) as u64;
        let mut sum = 0;
        let class = histogram.iter().position(|count| {
            sum += count;
            sum > wanted
        });
        let steepness = f32::from_bits((class.unwrap_or(0) as u32) << 20);
        (TARGET_SLOPE / steepness).clamp(EXAGGERATION[0], EXAGGERATION[1])
    }
}

fn normal(texel: Texel) -> [f32; 3] {
    let [x, y] = texel.slope.map(|v| v as f32 / 32767.0);
    [x, y, (1.0 - x * x - y * y).max(1e-6).sqrt()]
}

/// Lambert's law on the exaggerated slope, 1 on flat ground.
fn brightness(texel: Texel, exaggeration: f32) -> f32 {
    let [x, y, z] = normal(texel);
    let [x, y] = [x * exaggeration, y * exaggeration];
    let length = (x * x + y * y + z * z).sqrt();
    let direct = (x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]) / length;
    AMBIENT + DIRECT * direct.max(0.0) / LIGHT[2]
}
