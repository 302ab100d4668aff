//! Planes through the ground around a cell: where its points should lie, and how far from there they may.

use crate::cells::{Cells, SIDE, Window};
use crate::morphology::EMPTY;

/// A plane takes the ground in so many cells on each side.
const REACH: i32 = 2;
/// At this distance in widths of a cell, a point has a quarter of the weight that it has in the middle.
const QUARTER: f32 = 1.5;
/// The weight of the surface in the middle. It decides where there is no ground around.
const PRIOR: f32 = 0.02;
/// The weight of a level plane, in squares of the width. It decides where the ground around is a line.
const LEVEL: f32 = 0.004;
/// A point may lie farther from a plane by so many times the spread of the ground around it ...
const BY_SPREAD: f32 = 1.5;
/// ... and by so many times what the plane falls by in a cell.
const BY_FALL: f32 = 0.4;
/// The places of lowest points are known in so many parts of a cell.
const PARTS: f32 = 256.0;

/// The plane through the ground around a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    /// The height in the middle of the cell, in metres.
    pub(crate) height: f32,
    /// Height by length, along x and along y.
    pub(crate) slope: [f32; 2],
    /// How far the ground lies from the plane, as a root mean square in metres.
    pub(crate) spread: f32,
}

impl Plane {
    /// Returns the height at a place, which is given in metres from the middle of the cell.
    pub(crate) fn at(&self, [x, y]: [f32; 2]) -> f32 {
        self.height + self.slope[0] * x + self.slope[1] * y
    }

    /// Returns how far a point may lie from it to be ground, in metres, where cells have this `width`.
    pub(crate) fn allowed(&self, tolerance: f32, width: f32) -> f32 {
        let [x, y] = self.slope;
        tolerance + BY_SPREAD * self.spread + BY_FALL * width * (x * x + y * y).sqrt()
    }
}

/// Returns where in its cell a lowest point lies, in metres from the middle.
pub(crate) fn from_middle(spot: [u8; 2], width: f32) -> [f32; 2] {
    spot.map(|part| width * ((f32::from(part) + 0.5) / PARTS - 0.5))
}

/// The ground in a block and around it.
pub(crate) struct Surroundings<'a> {
    ground: &'a Window<f32>,
    spots: Window<[u8; 2]>,
    /// The surface in the cells of the block.
    surface: &'a [f32],
    width: f32,
}

impl Surroundings<'_> {
    /// Returns where in its cell the lowest point of a cell of the block is.
    pub(crate) fn spot(&self, column: i32, row: i32) -> [u8; 2] {
        self.spots.at(column, row)
    }

    /// Returns the plane for a cell of the block, with the ground of the cell itself or without.
    pub(crate) fn plane(&self, column: i32, row: i32, with_own: bool) -> Plane {
        let base = self.surface[(row * SIDE + column) as usize];
        let scale = 1.0 / (QUARTER * QUARTER * self.width * self.width);
        let mut sums = Sums::default();
        for up in -REACH..=REACH {
            for right in -REACH..=REACH {
                let height = self.ground.at(column + right, row + up);
                if height == EMPTY || !with_own && right == 0 && up == 0 {
                    continue;
                }
                let [x, y] = from_middle(self.spots.at(column + right, row + up), self.width);
                let [x, y] = [x + right as f32 * self.width, y + up as f32 * self.width];
                let far = 1.0 + (x * x + y * y) * scale;
                sums.add([x, y, height - base], 1.0 / (far * far));
            }
        }
        let plane = sums.plane(LEVEL * self.width * self.width);
        Plane { height: base + plane.height, ..plane }
    }
}

/// Weighted sums over points, from which their plane follows.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f32,
    first: [f32; 3],
    xx: f32,
    xy: f32,
    yy: f32,
    xz: f32,
    yz: f32,
    zz: f32,
}

impl Sums {
    fn add(&mut self, [x, y, z]: [f32; 3], weight: f32) {
        self.weight += weight;
        self.first = [self.first[0] + weight * x, self.first[1] + weight * y, self.first[2] + weight * z];
        self.xx += weight * x * x;
        self.xy += weight * x * y;
        self.yy += weight * y * y;
        self.xz += weight * x * z;
        self.yz += weight * y * z;
        self.zz += weight * z * z;
    }

    /// Returns the plane of least squares. `level` is the weight of its slope, in square metres.
    fn plane(&self, level: f32) -> Plane {
        let all = self.weight + PRIOR;
        let [x, y, z] = self.first.map(|sum| sum / all);
        let (xx, xy, yy) =
            (self.xx + level - self.first[0] * x, self.xy - self.first[0] * y, self.yy + level - self.first[1] * y);
        let (xz, yz, zz) = (self.xz - self.first[2] * x, self.yz - self.first[2] * y, self.zz - self.first[2] * z);
        // The matrix has a positive determinant: `level` is on its diagonal.
        let determinant = xx * yy - xy * xy;
        let slope = [(xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant];
        let height = z - slope[0] * x - slope[1] * y;
        let of_level = PRIOR * height * height + level * (slope[0] * slope[0] + slope[1] * slope[1]);
        let squares = (zz - slope[0] * xz - slope[1] * yz - of_level).max(0.0);
        Plane { height, slope, spread: (squares / (self.weight + 0.5)).sqrt() }
    }
}

/// Returns what `of` gives for each cell and the ground around it. `surface` has a height in every cell.
pub(crate) fn with_surroundings<U: Copy + Send + Sync>(
    ground: &Cells<f32>,
    spots: &Cells<[u8; 2]>,
    surface: &Cells<f32>,
    (width, none): (f32, U),
    of: impl Fn(&Surroundings, i32, i32) -> U + Sync,
) -> Cells<U> {
    ground.map(none, REACH, |ground| {
        let surface = surface.block(ground.place).unwrap_or_default();
        let spots = spots.window(ground.place, REACH);
        let surroundings = Surroundings { ground, spots, surface, width };
        (0..SIDE * SIDE).map(|number| of(&surroundings, number % SIDE, number / SIDE)).collect()
    })
}
