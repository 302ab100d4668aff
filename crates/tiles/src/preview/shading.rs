//! Colours and slopes of pixels, many at a time.

use multiversion::multiversion;

use crate::color::{HeightRange, height_color, to_srgb};
use crate::frame::Frame;
use crate::normals::{cross, unit_normal};
use crate::preview::pixel::PreviewPixel;
use crate::tile::Tile;

/// As many pixels are shaded at a time: their numbers stay in the cache.
const BATCH: usize = 64;

/// A number for every pixel of a batch.
type Lane<T> = [T; BATCH];

/// The pixels of a tile.
pub(super) struct Shading<'a> {
    tile: &'a Tile,
    frame: &'a Frame,
    heights: HeightRange,
    batch: Batch,
    pixels: Vec<PreviewPixel>,
}

/// Pixels that are shaded together.
struct Batch {
    count: usize,
    pixels: Lane<u32>,
    /// The areas opposite the corners.
    weights: [Lane<f64>; 3],
    /// The weights of the normals.
    normal_weights: [Lane<f64>; 3],
    /// The normals of the corners, axis by axis.
    normals: [[Lane<f32>; 3]; 3],
    /// The linear colours of the corners, channel by channel.
    colors: [[Lane<u16>; 3]; 3],
    /// The east and north components of the unit normals, 32767 for 1.
    slopes: [Lane<i16>; 2],
    /// The linear colours.
    means: [Lane<u16>; 3],
}

impl<'a> Shading<'a> {
    /// Returns the shading of pixels of `tile`. A ramp over `heights` colours a tile without colours.
    pub(super) fn new(tile: &'a Tile, frame: &'a Frame, heights: HeightRange) -> Shading<'a> {
        let batch = Batch {
            count: 0,
            pixels: [0; BATCH],
            weights: [[0.0; BATCH]; 3],
            normal_weights: [[0.0; BATCH]; 3],
            normals: [[[0.0; BATCH]; 3]; 3],
            colors: [[[0; BATCH]; 3]; 3],
            slopes: [[0; BATCH]; 2],
            means: [[0; BATCH]; 3],
        };
        Shading { tile, frame, heights, batch, pixels: Vec::new() }
    }

    /// Adds the pixel of this number, in a triangle with these corners, clockwise seen from above. `weights` are the areas opposite them.
    #[inline(always)]
    pub(super) fn add(&mut self, pixel: u32, corners: [u32; 3], weights: [i64; 3]) {
        let (tile, batch) = (self.tile, &mut self.batch);
        let at = batch.count % BATCH;
        batch.pixels[at] = pixel;
        (0..3).for_each(|k| batch.weights[k][at] = weights[k] as f64);
        for (k, v) in corners.into_iter().enumerate() {
            let color = match &tile.colors {
                Some(colors) => colors[v as usize],
                None => height_color(tile.positions[v as usize][2], self.heights),
            };
            (0..3).for_each(|channel| batch.colors[channel][k][at] = color[channel]);
        }
        match &tile.normals {
            Some(normals) => {
                for (k, v) in corners.into_iter().enumerate() {
                    (0..3).for_each(|axis| batch.normals[axis][k][at] = normals[v as usize][axis]);
                    batch.normal_weights[k][at] = weights[k] as f64;
                }
            }
            None => {
                let [a, c, b] = corners.map(|v| tile.positions[v as usize]);
                let normal = unit_normal(cross(a, b, c), self.frame);
                (0..3).for_each(|axis| batch.normals[axis][0][at] = normal[axis]);
                batch.normal_weights[0][at] = 1.0;
            }
        }
        batch.count += 1;
        if batch.count == BATCH {
            self.shade();
        }
    }

    /// Returns the pixels in the order in which they were added.
    pub(super) fn finish(mut self) -> Vec<PreviewPixel> {
        self.shade();
        self.pixels
    }

    #[inline(never)]
    fn shade(&mut self) {
        let batch = &mut self.batch;
        average(batch);
        self.pixels.extend((0..batch.count).map(|i| PreviewPixel {
            pixel: batch.pixels[i],
            slope: [0, 1].map(|k| batch.slopes[k][i]),
            color: [0, 1, 2].map(|k| to_srgb(batch.means[k][i])),
            dot: 0,
        }));
        batch.count = 0;
    }
}

/// Computes the slopes and colours of a batch. Places without a pixel get some.
#[multiversion(targets("x86_64+avx2"))]
fn average(batch: &mut Batch) {
    let Batch { weights, normal_weights, normals, colors, slopes, means, .. } = batch;
    for i in 0..BATCH {
        let normal = [0, 1, 2].map(|axis| mean([0, 1, 2].map(|k| f64::from(normals[axis][k][i])), normal_weights, i));
        let length = normal.iter().map(|v| v * v).sum::<f64>().sqrt();
        (0..2).for_each(|k| slopes[k][i] = (normal[k] / length * 32767.0) as i32 as i16);
    }
    for i in 0..BATCH {
        for channel in 0..3 {
            let color = mean([0, 1, 2].map(|k| f64::from(colors[channel][k][i])), weights, i);
            means[channel][i] = (color + 0.5) as i32 as u16;
        }
    }
}

/// Returns the mean of the corners' values of pixel `i` of a batch, weighted by the areas.
#[inline(always)]
fn mean([a, b, c]: [f64; 3], weights: &[Lane<f64>; 3], i: usize) -> f64 {
    let [u, v, w] = [0, 1, 2].map(|k| weights[k][i]);
    (a * u + b * v + c * w) / (u + v + w)
}
