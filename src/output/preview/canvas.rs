//! A hill-shaded picture of the whole terrain, drawn tile by tile from the triangles themselves.
//!
//! Coverage is decided by exact integer edge functions, and no pixel centre lies on the x or y of a vertex: every pixel
//! centre inside the hull belongs to exactly one triangle, whatever the tiles, their order or the number of threads.

use bytemuck::{Pod, Zeroable};

use crate::output::Tile;
use crate::output::color::{elevation, to_srgb};
use crate::output::frame::Frame;
use crate::output::normals::{cross, finish};

/// Pixels along the longer side.
pub const LONGER_SIDE: u64 = 1024;

/// Lattice steps are divided until the longer side has at least this many subdivisions.
const LEAST_SPAN: i64 = 1 << 20;

/// Where pixels lie on the lattice.
#[derive(Clone, Debug)]
pub struct Canvas {
    frame: Frame,
    /// West and north edge, lattice steps.
    corner: [i64; 2],
    /// Lowest and highest lattice integer of z.
    heights: [i32; 2],
    /// Pixels.
    width: u32,
    height: u32,
    /// A lattice step has 2 to the power of this subdivisions; at least 1, so that vertices lie on even ones.
    shift: u32,
    /// Side of a pixel in subdivisions, even.
    pitch: i64,
    /// 2^64 by `pitch`, rounded up: a product by it, cut off there, is the whole quotient of any number of subdivisions, as they
    /// and the pitch have 56 bits at the most together.
    inverse: u64,
    /// Subdivisions from a pixel's edge to its centre, odd.
    center: i64,
}

/// One pixel of a tile. Plain bytes, so that a tile's pixels can be kept on disk.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct Texel {
    /// Row by row from the north-west corner.
    pub pixel: u32,
    /// East and north component of the unit normal, 32767 for 1.
    pub slope: [i16; 2],
    /// sRGB.
    pub color: [u8; 3],
    unused: u8,
}

/// The pixels of one tile.
pub type Fragment = Vec<Texel>;

impl Canvas {
    /// The canvas for sites whose least and greatest lattice integers x, y, z are `bounds`.
    pub fn new(frame: &Frame, bounds: [[i32; 3]; 2]) -> Canvas {
        let [low, high] = bounds;
        let span = [0, 1].map(|k| high[k] as i64 - low[k] as i64);
        let longer = span[0].max(span[1]).max(1);
        let shift = (1..).find(|&shift| longer << shift >= LEAST_SPAN).unwrap_or(1);
        let pitch = 2 * ((longer << shift) as u64).div_ceil(2 * LONGER_SIDE) as i64;
        let [width, height] = span.map(|s| ((s << shift) + pitch - 1).div_euclid(pitch).max(1) as u32);
        Canvas {
            frame: frame.clone(),
            corner: [low[0] as i64, high[1] as i64],
            heights: [low[2], high[2]],
            width,
            height,
            shift,
            pitch,
            inverse: (1u128 << 64).div_ceil(pitch as u128) as u64,
            center: (pitch / 2) | 1,
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The pixels whose centres the triangles of `tile` cover.
    pub fn draw(&self, tile: &Tile) -> Fragment {
        let cells: Vec<u32> = tile.positions.iter().map(|&p| self.cell(p)).collect();
        let mut fragment = Fragment::new();
        for &triangle in &tile.triangles {
            let corners = triangle.map(|v| cells[v as usize]);
            // Most triangles lie between two rows or columns of centres.
            let differs = (corners[0] ^ corners[1]) | (corners[0] ^ corners[2]);
            if differs & 0xffff != 0 && differs >> 16 != 0 {
                let [columns, rows] = [0, 16].map(|shift| {
                    let at = corners.map(|cell| (cell >> shift & 0xffff) as i64);
                    [at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2])]
                });
                Drawing::new(self, tile, triangle).draw(columns, rows, &mut fragment);
            }
        }
        fragment
    }

    /// How far right and down from the corner, in subdivisions; even.
    fn place(&self, point: [i32; 3]) -> [i64; 2] {
        [(point[0] as i64 - self.corner[0]) << self.shift, (self.corner[1] - point[1] as i64) << self.shift]
    }

    /// How many pixel centres lie left of a point (low half), and above it (high half).
    fn cell(&self, point: [i32; 3]) -> u32 {
        let centers = |v: i64| {
            let beyond = (v + self.pitch - 1 - self.center) as u64;
            ((beyond as u128 * self.inverse as u128) >> 64) as u32
        };
        let [column, row] = self.place(point).map(centers);
        row << 16 | column
    }

    /// The middle of a column or row in subdivisions; odd.
    fn middle(&self, index: i64) -> i64 {
        index * self.pitch + self.center
    }
}

/// One triangle that may cover pixels.
struct Drawing<'a> {
    canvas: &'a Canvas,
    tile: &'a Tile,
    /// Vertices, clockwise seen from above: counterclockwise where y goes down.
    corners: [u32; 3],
    places: [[i64; 2]; 3],
}

impl<'a> Drawing<'a> {
    fn new(canvas: &'a Canvas, tile: &'a Tile, triangle: [u32; 3]) -> Drawing<'a> {
        let [a, b, c] = triangle;
        let corners = [a, c, b];
        Drawing { canvas, tile, corners, places: corners.map(|v| canvas.place(tile.positions[v as usize])) }
    }

    fn draw(&self, columns: [i64; 2], rows: [i64; 2], fragment: &mut Fragment) {
        for row in rows[0]..rows[1] {
            let (edges, [first, last]) = self.covered(columns, row);
            for column in first..last {
                let weights = edges.map(|(value, step)| value.wrapping_add((column - columns[0]).wrapping_mul(step)));
                fragment.push(self.texel(row as u32 * self.canvas.width + column as u32, weights));
            }
        }
    }

    fn texel(&self, pixel: u32, mut weights: [i64; 3]) -> Texel {
        // From the corner least in (x, y) on, so that what is interpolated does not depend on how a file turns the triangle.
        let mut corners = self.corners;
        let turn = (0..3).min_by_key(|&k| self.tile.positions[corners[k] as usize]).unwrap_or(0);
        corners.rotate_left(turn);
        weights.rotate_left(turn);
        let shading = Shading { canvas: self.canvas, tile: self.tile, corners, weights };
        Texel { pixel, slope: shading.slope(), color: shading.color(), unused: 0 }
    }

    /// For the edge opposite every corner its function at the first column and what a column adds; and the columns of
    /// `row` that are inside of all three.
    ///
    /// The function is twice the area between the edge and a point inside the triangle's bounding box, so below 2^63; on
    /// the way it may wrap.
    fn covered(&self, columns: [i64; 2], row: i64) -> ([(i64, i64); 3], [i64; 2]) {
        let point = [self.canvas.middle(columns[0]), self.canvas.middle(row)];
        let mut range = columns;
        let edges = [0, 1, 2].map(|k| {
            let (p, q) = (self.places[(k + 1) % 3], self.places[(k + 2) % 3]);
            let (du, dv) = (q[0] - p[0], q[1] - p[1]);
            let value = (du * (point[1] - p[1])).wrapping_sub(dv * (point[0] - p[0]));
            let step = -dv * self.canvas.pitch;
            // A centre on an edge belongs to the triangle on one side of it; the other side has dv turned round.
            let least = if dv > 0 { 0 } else { 1 };
            narrow(&mut range, columns[0], value, step, least);
            (value, step)
        });
        (edges, range)
    }
}

/// A point of a triangle, by the areas opposite its corners.
struct Shading<'a> {
    canvas: &'a Canvas,
    tile: &'a Tile,
    corners: [u32; 3],
    weights: [i64; 3],
}

impl Shading<'_> {
    fn slope(&self) -> [i16; 2] {
        let normal = match &self.tile.normals {
            Some(normals) => self.interpolate(|v| normals[v].map(f64::from)),
            None => {
                let [a, c, b] = self.corners.map(|v| self.tile.positions[v as usize]);
                finish(cross(a, b, c), &self.canvas.frame).map(f64::from)
            }
        };
        let length = normal.iter().map(|v| v * v).sum::<f64>().sqrt();
        [0, 1].map(|k| (normal[k] / length * 32767.0) as i16)
    }

    fn color(&self) -> [u8; 3] {
        let [low, high] = self.canvas.heights;
        let linear = self.interpolate(|v| match &self.tile.colors {
            Some(colors) => colors[v].map(f64::from),
            None => elevation(self.tile.positions[v][2], low, high).map(f64::from),
        });
        linear.map(|v| to_srgb((v + 0.5) as u16))
    }

    /// The mean of what the corners have.
    fn interpolate(&self, value: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
        let weights = self.weights.map(|w| w as f64);
        let total: f64 = weights.iter().sum();
        // One by one: `map` would become a call here, for every pixel.
        let [a, b, c] = self.corners;
        let [a, b, c] = [value(a as usize), value(b as usize), value(c as usize)];
        let mean = |k: usize| (a[k] * weights[0] + b[k] * weights[1] + c[k] * weights[2]) / total;
        [mean(0), mean(1), mean(2)]
    }
}

/// Leaves those columns of `range` where `value + step * (column - first)` is at least `least`.
fn narrow(range: &mut [i64; 2], first: i64, value: i64, step: i64, least: i64) {
    if range[1] - first == 1 {
        // Most triangles that are drawn span one column: no division.
        range[1] -= (value < least) as i64;
    } else if step > 0 && value < least {
        range[0] = range[0].max(first + (least - value + step - 1) / step);
    } else if step <= 0 && value < least {
        range[1] = range[0];
    } else if step < 0 {
        range[1] = range[1].min(first + (value - least) / -step + 1);
    }
}
