//! Draws the triangles of tiles as pixels of the preview.
//!
//! Exact integer edge functions decide which pixels a triangle covers, and no pixel centre has the x or y of a vertex. So every pixel
//! centre inside the hull belongs to exactly one triangle, whatever the tiles, their order or the number of threads.

use std::collections::BTreeMap;

use crate::color::HeightRange;
use crate::frame::Frame;
use crate::preview::coverage::{Centers, Coverage};
pub use crate::preview::pixel::PreviewPixel;
use crate::preview::shading::Shading;
use crate::tile::Tile;
use delaunay::geometry::Bounds;
use sys::{Result, fault, interrupt};

/// Pixels along the longer side of the preview.
pub const LONGER_SIDE: u64 = 1024;

/// Returns the pixels along the longer side of a job's preview: [`LONGER_SIDE`], unless a test sets another number.
pub fn longer_side() -> u64 {
    fault::preview_side().unwrap_or(LONGER_SIDE)
}

/// Lattice steps are halved until the longer side has at least this many subdivisions.
const LEAST_SPAN: i64 = 1 << 20;

/// Where pixels lie on the lattice.
#[derive(Clone, Debug)]
pub struct Canvas {
    frame: Frame,
    /// The west and the north edge in lattice steps.
    corner: [i64; 2],
    /// What the ramp spans that colours tiles without colours.
    heights: HeightRange,
    /// The pixels that the longer side may have.
    longer_side: u64,
    /// The width in pixels.
    width: u32,
    /// The height in pixels.
    height: u32,
    /// A lattice step has 2 to the power of this subdivisions. At least 1, so that vertices lie on even subdivisions.
    shift: u32,
    /// The side of a pixel in subdivisions, an even number.
    pitch: i64,
    /// 2^64 divided by `pitch`, rounded up. The upper 64 bits of a product with it are the whole quotient by the pitch, because a number
    /// of subdivisions and the pitch have no more than 56 bits together.
    inverse: u64,
    /// Subdivisions from a pixel's edge to its centre, an odd number.
    center: i64,
}

impl Canvas {
    /// Returns the canvas for sites within `bounds`, with `longer_side` pixels along its longer side. Tiles without colours get those of
    /// a ramp over `heights`.
    pub fn new(frame: &Frame, bounds: Bounds<3>, heights: HeightRange, longer_side: u64) -> Canvas {
        let span = [bounds.extent(0), bounds.extent(1)];
        let longer = span[0].max(span[1]).max(1);
        let shift = (1..).find(|&shift| longer << shift >= LEAST_SPAN).unwrap_or(1);
        let pitch = 2 * ((longer << shift) as u64).div_ceil(2 * longer_side) as i64;
        let [width, height] = span.map(|s| ((s << shift) + pitch - 1).div_euclid(pitch).max(1) as u32);
        Canvas {
            frame: frame.clone(),
            corner: [bounds.min[0] as i64, bounds.max[1] as i64],
            heights,
            longer_side,
            width,
            height,
            shift,
            pitch,
            inverse: (1u128 << 64).div_ceil(pitch as u128) as u64,
            center: (pitch / 2) | 1,
        }
    }

    /// Returns the width and height in pixels.
    #[inline]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Returns the pixels that the longer side may have.
    pub(super) fn longer_side(&self) -> u64 {
        self.longer_side
    }

    /// Returns the way from the lattice to the source.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Returns what the ramp of heights spans.
    pub fn heights(&self) -> HeightRange {
        self.heights
    }

    /// Returns the side of a pixel in source units.
    pub fn pixel_size(&self) -> f64 {
        self.steps(self.pitch) * self.frame.extras().resolution
    }

    /// Returns the source's x and y in the middle of the pixel in the north-western corner.
    pub fn first_pixel(&self) -> [f64; 2] {
        let (extras, corner) =
            (self.frame.extras(), self.frame.world([self.corner[0] as i32, self.corner[1] as i32, 0]));
        let inside = self.steps(self.center) * extras.resolution;
        let [east, north] = [corner[0], -corner[2]].map(|metres| metres / extras.metres_per_unit);
        [extras.offset[0] + east + inside, extras.offset[1] + north - inside]
    }

    /// Returns subdivisions as lattice steps.
    fn steps(&self, subdivisions: i64) -> f64 {
        subdivisions as f64 / (1u64 << self.shift) as f64
    }

    /// Returns the pixels whose centres the triangles of `tile` cover.
    ///
    /// # Errors
    /// [`Error::Interrupted`](sys::Error::Interrupted) if the process was asked to stop.
    pub fn draw(&self, tile: &Tile) -> Result<Vec<PreviewPixel>> {
        let cells: Vec<u32> = tile.positions.iter().map(|&p| self.cell(p)).collect();
        let mut shading = Shading::new(tile, &self.frame, self.heights);
        let mut drawn = 0u32;
        for &[a, b, c] in &tile.triangles {
            let [i, j, k] = [a, b, c].map(|v| cells[v as usize]);
            // Most triangles lie between two rows or columns of centres and cover none.
            let differs = (i ^ j) | (i ^ k);
            if differs & 0xffff != 0 && differs >> 16 != 0 {
                drawn += 1;
                if drawn.is_multiple_of(TRIANGLES_BETWEEN_CHECKS) {
                    interrupt::check()?;
                }
                let [columns, rows] = [0, 16].map(|shift| {
                    let at = [i, j, k].map(|cell| (cell >> shift & 0xffff) as i64);
                    [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])]
                });
                // Counterclockwise where y goes down.
                let corners = from_least(tile, [a, c, b]);
                let places = corners.map(|v| self.place(tile.positions[v as usize]));
                let centers = Centers { first: self.center, pitch: self.pitch };
                Coverage { places, centers, columns, rows }.each(|column, row, weights| {
                    shading.add(row as u32 * self.width + column as u32, corners, weights);
                });
            }
        }
        Ok(shading.finish())
    }

    /// Returns the pixels in which vertices of `tile` lie, each with the look of one of them, if the tile is so narrow that it has hardly
    /// `drawn` a pixel.
    pub fn dots(&self, tile: &Tile, drawn: usize) -> Vec<PreviewPixel> {
        let pixels = |bounds: Bounds<3>, axis: usize| (bounds.extent(axis) << self.shift) / self.pitch;
        let longer = tile.bounds().map_or(0, |bounds| pixels(bounds, 0).max(pixels(bounds, 1)));
        if drawn as i64 * NARROW > longer {
            return Vec::new();
        }
        let mut vertices = BTreeMap::new();
        for (v, &position) in (0..).zip(&tile.positions) {
            let [column, row] = self.place(position).map(|place| place / self.pitch);
            let column = column.min(i64::from(self.width) - 1) as u32;
            let row = row.min(i64::from(self.height) - 1) as u32;
            vertices.entry(row * self.width + column).or_insert(v);
        }
        let mut shading = Shading::new(tile, &self.frame, self.heights);
        vertices.into_iter().for_each(|(pixel, v)| shading.add(pixel, [v; 3], [1, 0, 0]));
        let dot = |seen: PreviewPixel| {
            // Without normals it is flat, because a vertex alone has no triangle.
            let slope = if tile.normals.is_some() { seen.slope } else { [0; 2] };
            PreviewPixel { slope, dot: 1, ..seen }
        };
        shading.finish().into_iter().map(dot).collect()
    }

    /// Returns how far a point is right of and below the corner, in subdivisions: even numbers.
    fn place(&self, point: [i32; 3]) -> [i64; 2] {
        [(point[0] as i64 - self.corner[0]) << self.shift, (self.corner[1] - point[1] as i64) << self.shift]
    }

    /// Returns the number of columns of pixel centres left of a point in the low half, and of rows above it in the high half.
    fn cell(&self, point: [i32; 3]) -> u32 {
        let centers = |v: i64| {
            let beyond = (v + self.pitch - 1 - self.center) as u64;
            ((beyond as u128 * self.inverse as u128) >> 64) as u32
        };
        let [column, row] = self.place(point).map(centers);
        row << 16 | column
    }
}

/// Returns the corners in the same sense of rotation from the one on that is least in (x, y). Interpolation starts there, so that it does
/// not depend on the order in which a file has the corners.
#[inline(always)]
fn from_least(tile: &Tile, corners: [u32; 3]) -> [u32; 3] {
    let places = corners.map(|v| {
        let [x, y, _] = tile.positions[v as usize];
        i64::from(x) << 32 | i64::from(y.wrapping_sub(i32::MIN) as u32)
    });
    // Without branches, which would be foretold wrongly.
    let least = if places[1] < places[0] { 1 } else { 0 };
    let least = if places[2] < places[least] { 2 } else { least };
    [corners[least], corners[[1, 2, 0][least]], corners[[2, 0, 1][least]]]
}

/// A tile is narrow if it is at least so many times as long in pixels as it covers pixels.
const NARROW: i64 = 4;

/// A million slivers as long as the terrain take seconds, so after this many the process asks whether it should stop.
const TRIANGLES_BETWEEN_CHECKS: u32 = 1 << 12;
