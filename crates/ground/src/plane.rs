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
const LEVEL: f32 = 0.05;
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

    /// Returns the height of the ground in a cell of the block.
    pub(crate) fn own(&self, column: i32, row: i32) -> f32 {
        self.ground.at(column, row)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::{Place, cell_of};
    use proptest::prelude::*;

    const WIDTH: f32 = 2.0;

    /// Returns where the lowest points of a block are, and their heights on a plane through the middle of cell (0, 0), where `is_ground`.
    fn sloping(slope: [f32; 2], seed: u64, is_ground: impl Fn(Place) -> bool + Sync) -> (Cells<f32>, Cells<[u8; 2]>) {
        let spot = |number: usize| {
            let bits = (number as u64 + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            [(bits & 255) as u8, (bits >> 8 & 255) as u8]
        };
        let height = |number: usize| {
            let cell = cell_of([0, 0], number);
            let [x, y] = from_middle(spot(number), WIDTH);
            let [x, y] = [x + cell[0] as f32 * WIDTH, y + cell[1] as f32 * WIDTH];
            if is_ground(cell) { 40.0 + slope[0] * x + slope[1] * y } else { EMPTY }
        };
        let block = || 0..(SIDE * SIDE) as usize;
        (
            Cells::of(EMPTY, vec![[0, 0]], |_| block().map(height).collect()),
            Cells::of([0; 2], vec![[0, 0]], |_| block().map(spot).collect()),
        )
    }

    fn planes_of(ground: &Cells<f32>, spots: &Cells<[u8; 2]>, with_own: bool) -> Cells<Plane> {
        let none = Plane { height: EMPTY, slope: [0.0; 2], spread: 0.0 };
        let surface = ground.each(EMPTY, |height| if height == EMPTY { 7.0 } else { height });
        with_surroundings(ground, spots, &surface, (WIDTH, none), |around, column, row| {
            around.plane(column, row, with_own)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        /// However steep it is, and wherever in their cells points lie.
        #[test]
        fn the_plane_of_a_slope_is_the_slope(slope in [-1.0f32..1.0, -1.0..1.0], seed in 0u64..1000) {
            let (ground, spots) = sloping(slope, seed, |_| true);
            let planes = planes_of(&ground, &spots, true);
            for cell in [[0, 0], [5, 9], [63, 30], [31, 63]] {
                let plane = planes.at(cell);
                let height = 40.0 + WIDTH * (slope[0] * cell[0] as f32 + slope[1] * cell[1] as f32);
                prop_assert!((plane.height - height).abs() < 0.2 && plane.spread < 0.2, "{plane:?}, {height}");
                let off = [0, 1].map(|axis| (plane.slope[axis] - slope[axis]).abs());
                prop_assert!(off.iter().all(|off| *off < 0.1), "{off:?}");
            }
        }
    }

    #[test]
    fn a_spike_does_not_lift_the_plane_without_it() {
        let (mut ground, spots) = sloping([0.5, -0.25], 3, |_| true);
        let number = (20 * SIDE + 20) as usize;
        ground.block_mut([0, 0])[number] += 3.0;
        let at = from_middle(spots.at([20, 20]), WIDTH);
        let above = |with_own| ground.at([20, 20]) - planes_of(&ground, &spots, with_own).at([20, 20]).at(at);
        assert!((above(false) - 3.0).abs() < 0.1 && above(true) < 2.5, "{}, {}", above(false), above(true));
    }

    #[test]
    fn few_cells_of_ground_have_a_plane_too() {
        for ground in [[].as_slice(), &[[20, 20]], &[[20, 20], [21, 20], [22, 20]]] {
            let (cells, spots) = sloping([0.5, 0.0], 9, |cell| ground.contains(&cell));
            for plane in planes_of(&cells, &spots, true).values().flatten() {
                assert!(plane.height.is_finite() && plane.slope.iter().all(|slope| slope.abs() < 10.0), "{plane:?}");
            }
            let far = Plane { height: 7.0, slope: [0.0; 2], spread: 0.0 };
            assert_eq!(planes_of(&cells, &spots, true).at([50, 50]), far);
        }
    }

    #[test]
    fn points_may_lie_farther_from_rough_and_steep_ground() {
        let plane = Plane { height: 0.0, slope: [0.6, 0.8], spread: 0.2 };
        assert!((plane.allowed(0.3, 2.0) - 1.4).abs() < 1e-6);
    }
}
