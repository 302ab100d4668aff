//! Draws the triangles of tiles as pixels of the preview.
//!
//! Exact integer edge functions decide which pixels a triangle covers, and no pixel centre has the x or y of a vertex. So every pixel
//! centre inside the hull belongs to exactly one triangle, whatever the tiles, their order or the number of threads.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};

use crate::geometry::Bounds;
use crate::output::color::{HeightRange, height_color, to_srgb};
use crate::output::frame::Frame;
use crate::output::normals::{cross, unit_normal};
use crate::output::preview::sliver::{SLIVER_ROWS, Sliver};
use crate::output::tile::Tile;
use crate::{Result, interrupt};

/// Pixels along the longer side of the preview.
pub const LONGER_SIDE: u64 = 1024;

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

/// One pixel of a tile, in plain bytes so that a tile's pixels can be kept on disk.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct PreviewPixel {
    /// The number of the pixel, row by row from the north-west corner.
    pub pixel: u32,
    /// The east and north components of the unit normal, 32767 for 1.
    pub slope: [i16; 2],
    /// The sRGB colour.
    pub color: [u8; 3],
    /// 1 for the look of a vertex, in a pixel whose centre no triangle may cover.
    pub(super) dot: u8,
}

impl Canvas {
    /// Returns the canvas for sites within `bounds`. Tiles without colours get those of a ramp over `heights`.
    pub fn new(frame: &Frame, bounds: Bounds<3>, heights: HeightRange) -> Canvas {
        let span = [bounds.extent(0), bounds.extent(1)];
        let longer = span[0].max(span[1]).max(1);
        let shift = (1..).find(|&shift| longer << shift >= LEAST_SPAN).unwrap_or(1);
        let pitch = 2 * ((longer << shift) as u64).div_ceil(2 * LONGER_SIDE) as i64;
        let [width, height] = span.map(|s| ((s << shift) + pitch - 1).div_euclid(pitch).max(1) as u32);
        Canvas {
            frame: frame.clone(),
            corner: [bounds.min[0] as i64, bounds.max[1] as i64],
            heights,
            width,
            height,
            shift,
            pitch,
            inverse: (1u128 << 64).div_ceil(pitch as u128) as u64,
            center: (pitch / 2) | 1,
        }
    }

    /// Returns the width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
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
    /// [`Error::Interrupted`](crate::Error::Interrupted) if the process was asked to stop.
    pub fn draw(&self, tile: &Tile) -> Result<Vec<PreviewPixel>> {
        let cells: Vec<u32> = tile.positions.iter().map(|&p| self.cell(p)).collect();
        let (mut pixels, mut drawn) = (Vec::new(), 0u32);
        for &triangle in &tile.triangles {
            let corners = triangle.map(|v| cells[v as usize]);
            // Most triangles lie between two rows or columns of centres and cover none.
            let differs = (corners[0] ^ corners[1]) | (corners[0] ^ corners[2]);
            if differs & 0xffff != 0 && differs >> 16 != 0 {
                drawn += 1;
                if drawn.is_multiple_of(TRIANGLES_BETWEEN_CHECKS) {
                    interrupt::check()?;
                }
                let [columns, rows] = [0, 16].map(|shift| {
                    let at = corners.map(|cell| (cell >> shift & 0xffff) as i64);
                    [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])]
                });
                DrawnTriangle::new(self, tile, triangle).draw(columns, rows, &mut pixels);
            }
        }
        Ok(pixels)
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
        let dot = |(pixel, v)| {
            let seen = Shading::new(self, tile, [v; 3]).pixel(pixel, [1, 0, 0]);
            // Without normals it is flat, because a vertex alone has no triangle.
            let slope = if tile.normals.is_some() { seen.slope } else { [0; 2] };
            PreviewPixel { slope, dot: 1, ..seen }
        };
        vertices.into_iter().map(dot).collect()
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

    /// Returns the middle of a column or row in subdivisions, an odd number.
    fn middle(&self, index: i64) -> i64 {
        index * self.pitch + self.center
    }
}

/// A tile is narrow if it is at least so many times as long in pixels as it covers pixels.
const NARROW: i64 = 4;

/// A million slivers as long as the terrain take seconds, so after this many the process asks whether it should stop.
const TRIANGLES_BETWEEN_CHECKS: u32 = 1 << 12;

/// A triangle that may cover pixels.
struct DrawnTriangle<'a> {
    canvas: &'a Canvas,
    tile: &'a Tile,
    /// The vertices, clockwise seen from above: counterclockwise where y goes down.
    corners: [u32; 3],
    places: [[i64; 2]; 3],
}

impl<'a> DrawnTriangle<'a> {
    #[inline(always)]
    fn new(canvas: &'a Canvas, tile: &'a Tile, [a, b, c]: [u32; 3]) -> DrawnTriangle<'a> {
        let corners = from_least(tile, [a, c, b]);
        DrawnTriangle { canvas, tile, corners, places: corners.map(|v| canvas.place(tile.positions[v as usize])) }
    }

    #[inline(always)]
    fn draw(&self, columns: [i64; 2], rows: [i64; 2], pixels: &mut Vec<PreviewPixel>) {
        let sliver =
            (rows[1] - rows[0] >= SLIVER_ROWS).then(|| Sliver::new(self.places, self.canvas.center, self.canvas.pitch));
        let edges = self.edges([self.canvas.middle(columns[0]), self.canvas.middle(rows[0])]);
        // Many triangles cover no pixel. Where points are few, one covers thousands.
        let mut shading = None;
        for row in rows[0]..rows[1] {
            if sliver.as_ref().is_some_and(|sliver| sliver.misses(row)) {
                continue;
            }
            let edges = edges.map(|edge| edge.below(row - rows[0]));
            let [first, last] = covered(&edges, columns[1] - columns[0]);
            for column in first..last {
                let weights = edges.map(|edge| edge.right(column));
                // A branch for each corner would often be foretold wrongly.
                if (0..3).fold(true, |is_inside, k| is_inside & (weights[k] >= edges[k].least)) {
                    let shading = shading.get_or_insert_with(|| Shading::new(self.canvas, self.tile, self.corners));
                    let pixel = row as u32 * self.canvas.width + (columns[0] + column) as u32;
                    pixels.push(shading.pixel(pixel, weights));
                }
            }
        }
    }

    /// Returns the edges opposite the corners, with the values of their functions at `point`.
    #[inline(always)]
    fn edges(&self, point: [i64; 2]) -> [Edge; 3] {
        [0, 1, 2].map(|k| {
            let (p, q) = (self.places[(k + 1) % 3], self.places[(k + 2) % 3]);
            let (du, dv) = (q[0] - p[0], q[1] - p[1]);
            let value = du.wrapping_mul(point[1] - p[1]).wrapping_sub(dv.wrapping_mul(point[0] - p[0]));
            // A centre on an edge belongs to one of its two triangles: dv has another sign in each.
            let least = i64::from(dv <= 0);
            Edge { value, column: -dv * self.canvas.pitch, row: du * self.canvas.pitch, least }
        })
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

/// The function of an edge: twice the area between the edge and a point. Inside the triangle's bounding box it is below 2^63.
/// Intermediate values may wrap.
#[derive(Clone, Copy)]
struct Edge {
    value: i64,
    /// What it grows by from column to column.
    column: i64,
    /// What it grows by from row to row.
    row: i64,
    /// Its least value at a pixel centre that the triangle covers.
    least: i64,
}

impl Edge {
    #[inline(always)]
    fn below(self, rows: i64) -> Edge {
        Edge { value: self.value.wrapping_add(self.row.wrapping_mul(rows)), ..self }
    }

    #[inline(always)]
    fn right(&self, columns: i64) -> i64 {
        self.value.wrapping_add(self.column.wrapping_mul(columns))
    }
}

/// Up to this many columns are tried one by one, which takes no division.
const FEW_COLUMNS: i64 = 4;

/// Returns the columns, from 0 to `columns`, that may be inside all three edges: all of few, of many only those that are.
#[inline(always)]
fn covered(edges: &[Edge; 3], columns: i64) -> [i64; 2] {
    let mut range = [0, columns];
    if columns > FEW_COLUMNS {
        edges.iter().for_each(|edge| narrow(&mut range, edge));
    }
    range
}

/// Narrows `range` to the columns where the edge has at least its least value.
fn narrow(range: &mut [i64; 2], edge: &Edge) {
    let Edge { value, column: step, least, .. } = *edge;
    if step > 0 && value < least {
        range[0] = range[0].max((least - value + step - 1) / step);
    } else if step <= 0 && value < least {
        range[1] = range[0];
    } else if step < 0 {
        range[1] = range[1].min((value - least) / -step + 1);
    }
}

/// What the pixels of a triangle are computed from.
struct Shading {
    normals: Normals,
    /// The linear colours of the corners.
    colors: [[f64; 3]; 3],
}

enum Normals {
    Corners([[f64; 3]; 3]),
    Triangle([f64; 3]),
}

impl Shading {
    /// Returns the shading of a triangle with its corners in the order of [`from_least`].
    #[inline(always)]
    fn new(canvas: &Canvas, tile: &Tile, corners: [u32; 3]) -> Shading {
        let corners = corners.map(|v| v as usize);
        let normals = match &tile.normals {
            Some(normals) => Normals::Corners(corners.map(|v| normals[v].map(f64::from))),
            None => {
                let [a, c, b] = corners.map(|v| tile.positions[v]);
                Normals::Triangle(unit_normal(cross(a, b, c), &canvas.frame).map(f64::from))
            }
        };
        let colors = corners.map(|v| match &tile.colors {
            Some(colors) => colors[v].map(f64::from),
            None => height_color(tile.positions[v][2], canvas.heights).map(f64::from),
        });
        Shading { normals, colors }
    }

    /// Returns the pixel of this number. `weights` are the areas opposite the corners.
    #[inline(always)]
    fn pixel(&self, pixel: u32, weights: [i64; 3]) -> PreviewPixel {
        let weights = weights.map(|w| w as f64);
        let normal = match &self.normals {
            Normals::Corners(normals) => mean(normals, weights),
            Normals::Triangle(normal) => *normal,
        };
        let length = normal.iter().map(|v| v * v).sum::<f64>().sqrt();
        let slope = [0, 1].map(|k| (normal[k] / length * 32767.0) as i16);
        let color = mean(&self.colors, weights).map(|v| to_srgb((v + 0.5) as u16));
        PreviewPixel { pixel, slope, color, dot: 0 }
    }
}

/// Returns the mean of the corners' values, weighted by the areas.
#[inline(always)]
fn mean([a, b, c]: &[[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    let total: f64 = weights.iter().sum();
    [0, 1, 2].map(|k| (a[k] * weights[0] + b[k] * weights[1] + c[k] * weights[2]) / total)
}
