//! The ground of a cloud: which points lie on it.

use crate::cells::{CELLS, Cells};
use crate::density::{CoveredArea, PointCollector};
use crate::find::{GroundCells, LowestCells, find_ground};
use crate::lowest::{LowestHeights, metres_above};
use crate::metric_lattice::{MetricLattice, SquareCells};
use crate::morphology::EMPTY;
use crate::plane::{Plane, with_surroundings};
use crate::sizes::GroundSizes;

/// The bytes of memory for each cell while the ground is found and stored, about.
pub const BYTES_PER_CELL: u64 = 64;

/// The ground in a cell.
#[derive(Clone, Copy, Debug)]
struct GroundCell {
    /// The plane that the points of the cell lie on.
    plane: Plane,
    /// The height of the lowest point, if that is on the ground.
    lowest: f32,
}

/// Beyond the cells of a cloud.
const NOTHING: GroundCell = GroundCell { plane: Plane { height: EMPTY, slope: [0.0; 2], spread: 0.0 }, lowest: EMPTY };
/// The numbers of a cell.
const COLUMNS: usize = 5;

/// The ground as plain numbers, to be stored.
#[derive(Clone, Debug)]
pub struct GroundColumns {
    /// What is the same in all cells.
    pub numbers: Vec<f64>,
    /// The columns and the rows of blocks of cells.
    pub places: Vec<[i32; 2]>,
    /// The heights of the planes in the cells of all blocks, then their slopes along x, those along y, their spreads, and the heights of the lowest
    /// points.
    pub cells: Vec<f32>,
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
    /// Finds the ground of `points`, which are all in memory; `None` if it may have more than `most` cells. Calls `check` now and then, to be
    /// stopped.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn of_points<E>(
        lattice: MetricLattice,
        points: impl Iterator<Item = [i32; 3]> + Clone,
        sizes: GroundSizes,
        most: u64,
        check: impl Fn() -> Result<(), E>,
    ) -> Result<Option<Ground>, E> {
        let mut area = CoveredArea::new(lattice);
        area.add(points.clone());
        if area.cell_count().cells() > most {
            return Ok(None);
        }
        let mut lowest = LowestHeights::new(&area);
        lowest.add(points);
        Ground::find(lowest, sizes, check).map(Some)
    }

    /// Finds the ground of the cloud with these lowest points. Calls `check` now and then, to be stopped.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn find<E>(lowest: LowestHeights, sizes: GroundSizes, check: impl Fn() -> Result<(), E>) -> Result<Ground, E> {
        let (heights, base) = lowest.metres();
        let (spots, width) = (lowest.spots(), lowest.width());
        let LowestHeights { lattice, squares, .. } = lowest;
        drop(lowest);
        let cells = LowestCells { heights: &heights, spots: &spots, width };
        let GroundCells { surface, lowest: ground } = find_ground(cells, sizes, &check)?;
        check()?;
        drop(heights);
        let width = width as f32;
        let cells = with_surroundings(&ground, &spots, &surface, (width, NOTHING), |around, column, row| GroundCell {
            plane: around.plane(column, row, true),
            lowest: around.own(column, row),
        });
        Ok(Ground { lattice, squares, base, tolerance: sizes.tolerance.0 as f32, cells })
    }

    /// Returns all that there is to know of it.
    pub fn to_columns(&self) -> GroundColumns {
        let MetricLattice { horizontal, vertical, offset } = self.lattice;
        // No number of steps is beyond 2^53.
        let [x, y] = offset.map(|offset| offset as f64);
        let columns: [fn(&GroundCell) -> f32; COLUMNS] = [
            |cell| cell.plane.height,
            |cell| cell.plane.slope[0],
            |cell| cell.plane.slope[1],
            |cell| cell.plane.spread,
            |cell| cell.lowest,
        ];
        // Its length is known, so that it does not grow in memory.
        let mut cells = Vec::with_capacity(COLUMNS * self.cells.places().len() * CELLS);
        columns.into_iter().for_each(|column| cells.extend(self.cells.values().flatten().map(column)));
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
            cells,
        }
    }

    /// Returns the ground that [`Ground::to_columns`] has described; `None` if it has not.
    pub fn of_columns(GroundColumns { numbers, places, cells }: GroundColumns) -> Option<Ground> {
        let [horizontal, vertical, x, y, steps, base, tolerance] = <[f64; 7]>::try_from(numbers).ok()?;
        let lattice = MetricLattice { horizontal, vertical, offset: [x as i64, y as i64] };
        let count = cells.len() / COLUMNS;
        let cell = |number: usize| {
            let [height, right, up, spread, lowest] = [0, 1, 2, 3, 4].map(|column| cells[column * count + number]);
            GroundCell { plane: Plane { height, slope: [right, up], spread }, lowest }
        };
        Some(Ground {
            lattice,
            squares: lattice.cells(steps as i32),
            base: base as i32,
            tolerance: tolerance as f32,
            cells: Cells::of_blocks(NOTHING, places, count, cell)?,
        })
    }

    /// Tells whether a point, given as lattice integers, lies on it.
    pub fn has(&self, [x, y, z]: [i32; 3]) -> bool {
        let cell = self.squares.of([x, y]);
        let own = self.cells.at(cell);
        let height = metres_above(self.base, z, self.lattice);
        if own.lowest != EMPTY && height >= own.lowest && height - own.lowest <= self.tolerance {
            return true;
        }
        let width = (f64::from(self.squares.steps) * self.lattice.horizontal) as f32;
        let from_middle =
            self.squares.within([x, y]).map(|along| (along as f32 / self.squares.steps as f32 - 0.5) * width);
        (height - own.plane.at(from_middle)).abs() <= own.plane.allowed(self.tolerance, width)
    }
}
