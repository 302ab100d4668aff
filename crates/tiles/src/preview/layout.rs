//! Where the terrain is in the preview, and the world file that says where the preview is on the map.

use crate::preview::canvas::Canvas;
use crate::preview::panel::{HEIGHT, LEAST_WIDTH};

/// The parts of the preview in pixels.
pub(super) struct Layout {
    /// The width and height of the whole.
    pub(super) size: [usize; 2],
    /// The width of the terrain.
    terrain: usize,
    /// The transparent columns left of the terrain.
    left: usize,
}

impl Layout {
    /// Returns the layout of a picture of a terrain with this width and height.
    pub(super) fn of([width, height]: [usize; 2]) -> Layout {
        let whole = width.max(LEAST_WIDTH);
        Layout { size: [whole, height + HEIGHT], terrain: width, left: (whole - width) / 2 }
    }

    /// Returns the rows of the terrain with transparent pixels on either side.
    pub(super) fn framed(&self, terrain: &[[u8; 4]]) -> Vec<[u8; 4]> {
        let mut pixels = Vec::with_capacity(self.size[0] * self.size[1]);
        for row in terrain.chunks_exact(self.terrain) {
            let end = pixels.len() + self.size[0];
            pixels.resize(pixels.len() + self.left, [0; 4]);
            pixels.extend(row);
            pixels.resize(end, [0; 4]);
        }
        pixels
    }
}

/// Returns the world file of the preview: on six lines the width of a pixel, two rotations, its height downwards, and the x and y of the
/// middle of the pixel in the north-western corner, in source units.
pub fn world_file(canvas: &Canvas) -> String {
    let (pixel, [x, y]) = (canvas.pixel_size(), canvas.first_pixel());
    let left = Layout::of(canvas.size().map(|v| v as usize)).left;
    format!("{pixel}\n0\n0\n-{pixel}\n{}\n{y}\n", x - left as f64 * pixel)
}
