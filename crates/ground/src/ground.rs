//! The ground of a cloud: which points lie on it.

use crate::cells::{Cells, SIDE, split};
use crate::density::{CoveredArea, PointCollector};
use crate::find::{GroundCells, allowed_distance, find_ground};
use crate::lowest::{LowestHeights, metres_above};
use crate::metric_lattice::{MetricLattice, SquareCells};
use crate::morphology::EMPTY;
use crate::sizes::GroundSizes;
use crate::slope::slopes;

/// The bytes of memory for each cell while the ground is found, about.
pub const BYTES_PER_CELL: u64 = 48;

/// How much farther than the tolerance a point may lie from the surface on a slope of one, in widths of a cell.
const BY_SLOPE: f32 = 1.0;

/// The ground in a cell.
#[derive(Clone, Copy, Debug)]
struct GroundCell {
    /// The height of the surface in metres, in the middle of the cell.
    height: f32,
    /// Its slope there.
    slope: f32,
    /// The height of the lowest point, if that is on the ground.
    lowest: f32,
}

/// Beyond the cells of a cloud.
const NOTHING: GroundCell = GroundCell { height: EMPTY, slope: 0.0, lowest: EMPTY };

/// The ground as plain numbers, to be stored.
#[derive(Clone, Debug)]
pub struct GroundColumns {
    /// What is the same in all cells.
    pub numbers: Vec<f64>,
    /// The columns and the rows of blocks of cells.
    pub places: Vec<[i32; 2]>,
    /// The heights of the surface in the cells of all blocks, and then those of the lowest points.
    pub heights: Vec<f32>,
}

/// The ground of a cloud.
#[derive(Debug)]
pub struct Ground {
    lattice: MetricLattice,
    squares: SquareCells,
    /// The lattice height that heights in metres count from.
    base: i32,
    tolerance: f32,
    cells: Cells<GroundCell>,
}

impl Ground {
    /// Finds the ground of `points`, which are all in memory. Calls `check` now and then, to be stopped.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn of_points<E>(
        lattice: MetricLattice,
        points: impl Iterator<Item = [i32; 3]> + Clone,
        sizes: GroundSizes,
        check: impl Fn() -> Result<(), E>,
    ) -> Result<Ground, E> {
        let mut area = CoveredArea::new(lattice);
        area.add(points.clone());
        let mut lowest = LowestHeights::new(&area);
        lowest.add(points);
        Ground::find(&lowest, sizes, check)
    }

    /// Finds the ground of the cloud with these lowest points. Calls `check` now and then, to be stopped.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn find<E>(lowest: &LowestHeights, sizes: GroundSizes, check: impl Fn() -> Result<(), E>) -> Result<Ground, E> {
        let (heights, base) = lowest.metres();
        let found = find_ground(&heights, lowest.width(), sizes, &check)?;
        Ok(Ground::of(found, lowest.lattice, lowest.squares.steps, base, sizes.tolerance.0 as f32))
    }

    fn of(
        GroundCells { surface, lowest }: GroundCells,
        lattice: MetricLattice,
        steps: i32,
        base: i32,
        tolerance: f32,
    ) -> Ground {
        let width = (f64::from(steps) * lattice.horizontal) as f32;
        let with_slopes = surface.with(&slopes(&surface, width), NOTHING, |height, slope| GroundCell {
            height,
            slope,
            lowest: EMPTY,
        });
        let cells = with_slopes.with(&lowest, NOTHING, |cell, lowest| GroundCell { lowest, ..cell });
        Ground { lattice, squares: lattice.cells(steps), base, tolerance, cells }
    }

    /// Returns all that there is to know of it.
    pub fn to_columns(&self) -> GroundColumns {
        let MetricLattice { horizontal, vertical, offset } = self.lattice;
        // No number of steps is beyond 2^53.
        let [x, y] = offset.map(|offset| offset as f64);
        let cells = || self.cells.values().flatten();
        GroundColumns {
            numbers: vec![
                horizontal,
                vertical,
                x,
                y,
                self.squares.steps.into(),
                self.base.into(),
                self.tolerance.into(),
            ],
            places: self.cells.places().to_vec(),
            heights: cells().map(|cell| cell.height).chain(cells().map(|cell| cell.lowest)).collect(),
        }
    }

    /// Returns the ground that [`Ground::to_columns`] has described; `None` if it has not.
    pub fn of_columns(GroundColumns { numbers, places, heights }: GroundColumns) -> Option<Ground> {
        let [horizontal, vertical, x, y, steps, base, tolerance] = <[f64; 7]>::try_from(numbers).ok()?;
        let lattice = MetricLattice { horizontal, vertical, offset: [x as i64, y as i64] };
        let (surface, lowest) = heights.split_at(heights.len() / 2);
        let found = GroundCells {
            surface: Cells::of_blocks(EMPTY, places.clone(), surface)?,
            lowest: Cells::of_blocks(EMPTY, places, lowest)?,
        };
        Some(Ground::of(found, lattice, steps as i32, base as i32, tolerance as f32))
    }

    /// Tells whether a point, given as lattice integers, lies on it.
    pub fn has(&self, [x, y, z]: [i32; 3]) -> bool {
        let cell = self.squares.of([x, y]);
        let (block, number) = split(cell);
        let Some(cells) = self.cells.block(block) else { return false };
        let own = cells[number];
        let height = metres_above(self.base, z, self.lattice);
        if own.lowest != EMPTY && height >= own.lowest && height - own.lowest <= self.tolerance {
            return true;
        }
        // From the middle of the cell, in widths.
        let off = self.squares.within([x, y]).map(|along| along as f32 / self.squares.steps as f32 - 0.5);
        let to = off.map(|off| if off < 0.0 { -1 } else { 1 });
        let at = |right: i32, up: i32| {
            let [column, row] = [number as i32 % SIDE + right, number as i32 / SIDE + up];
            let is_here = (0..SIDE).contains(&column) && (0..SIDE).contains(&row);
            let found = if is_here {
                cells[(row * SIDE + column) as usize]
            } else {
                self.cells.at([cell[0] + right, cell[1] + up])
            };
            if found.height == EMPTY { own } else { found }
        };
        let corners = [own, at(to[0], 0), at(0, to[1]), at(to[0], to[1])];
        let [a, b] = off.map(f32::abs);
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        let between = |of: fn(&GroundCell) -> f32| {
            let [p, q, r, s] = [0, 1, 2, 3].map(|corner| weights[corner] * of(&corners[corner]));
            p + q + r + s
        };
        let (surface, slope) = (between(|cell| cell.height), between(|cell| cell.slope));
        let width = (f64::from(self.squares.steps) * self.lattice.horizontal) as f32;
        (height - surface).abs() <= allowed_distance(self.tolerance, BY_SLOPE, width * slope)
    }
}
