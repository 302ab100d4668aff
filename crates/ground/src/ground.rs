//! The ground of a cloud: which points lie on it.

use crate::cells::{CELLS, Cells};
use crate::density::{CoveredArea, PointCollector};
use crate::find::{GroundCells, LowestCells, find_ground};
use crate::lowest::{LowestHeights, metres_above};
use crate::metric_lattice::{MetricLattice, SquareCells};
use crate::morphology::EMPTY;
use crate::plane::{Plane, with_surroundings};
use crate::sizes::GroundSizes;
use std::ops::{Deref, Range};

/// The bytes of memory for each cell while the ground is found and stored, about.
pub const BYTES_PER_CELL: u64 = 56;

/// The ground in a cell: the height of the plane that its points lie on, the slopes of the plane along x and along y, its spread, and the height of
/// the lowest point, if that is on the ground.
pub type CellNumbers = [f32; 5];

/// Beyond the cells of a cloud.
const NOTHING: CellNumbers = [EMPTY, 0.0, 0.0, 0.0, EMPTY];
/// So many blocks are read at a time.
const BLOCKS_READ: usize = 64;

/// The ground as plain numbers, to be stored.
#[derive(Clone, Debug)]
pub struct GroundColumns<'a> {
    /// What is the same in all cells.
    pub numbers: Vec<f64>,
    /// The columns and the rows of blocks of cells.
    pub places: &'a [[i32; 2]],
    /// The cells of each block.
    pub cells: Vec<&'a [CellNumbers]>,
}

/// The ground of a cloud.
#[derive(Debug)]
pub struct Ground {
    lattice: MetricLattice,
    squares: SquareCells,
    /// The lattice height that heights in metres count from.
    base: i32,
    tolerance: f32,
    cells: Cells<CellNumbers>,
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
        let cells = with_surroundings(&ground, &spots, &surface, (width, NOTHING), |around, column, row| {
            let Plane { height, slope: [right, up], spread } = around.plane(column, row, true);
            [height, right, up, spread, around.own(column, row)]
        });
        Ok(Ground { lattice, squares, base, tolerance: sizes.tolerance.0 as f32, cells })
    }

    /// Returns all that there is to know of it.
    pub fn columns(&self) -> GroundColumns<'_> {
        let MetricLattice { horizontal, vertical, offset } = self.lattice;
        // No number of steps is beyond 2^53.
        let [x, y] = offset.map(|offset| offset as f64);
        let numbers =
            vec![horizontal, vertical, x, y, self.squares.steps.into(), self.base.into(), self.tolerance.into()];
        GroundColumns { numbers, places: self.cells.places(), cells: self.cells.values().collect() }
    }

    /// Returns the ground that [`Ground::columns`] has described with these `numbers` and `places`; `None` if it has not. `read` returns a range of
    /// the cells of all blocks: they are never all in memory besides the ground.
    ///
    /// # Errors
    /// Those of `read`.
    pub fn of_columns<E, V: Deref<Target = [CellNumbers]>>(
        numbers: Vec<f64>,
        places: Vec<[i32; 2]>,
        mut read: impl FnMut(Range<usize>) -> Result<V, E>,
    ) -> Result<Option<Ground>, E> {
        let Ok([horizontal, vertical, x, y, steps, base, tolerance]) = <[f64; 7]>::try_from(numbers) else {
            return Ok(None);
        };
        let lattice = MetricLattice { horizontal, vertical, offset: [x as i64, y as i64] };
        let (mut blocks, mut first) = (Vec::with_capacity(places.len()), 0);
        while blocks.len() < places.len() {
            let end = (first + BLOCKS_READ * CELLS).min(places.len() * CELLS);
            let cells = read(first..end)?;
            blocks.extend(cells.chunks_exact(CELLS).map(Box::from));
            if cells.len() != end - first {
                return Ok(None);
            }
            first = end;
        }
        Ok(Some(Ground {
            lattice,
            squares: lattice.cells(steps as i32),
            base: base as i32,
            tolerance: tolerance as f32,
            cells: Cells::of_blocks(NOTHING, places, blocks),
        }))
    }

    /// Tells whether a point, given as lattice integers, lies on it.
    pub fn has(&self, [x, y, z]: [i32; 3]) -> bool {
        let cell = self.squares.of([x, y]);
        let [height_of_plane, right, up, spread, lowest] = self.cells.at(cell);
        let plane = Plane { height: height_of_plane, slope: [right, up], spread };
        let height = metres_above(self.base, z, self.lattice);
        if lowest != EMPTY && height >= lowest && height - lowest <= self.tolerance {
            return true;
        }
        let width = (f64::from(self.squares.steps) * self.lattice.horizontal) as f32;
        let from_middle =
            self.squares.within([x, y]).map(|along| (along as f32 / self.squares.steps as f32 - 0.5) * width);
        (height - plane.at(from_middle)).abs() <= plane.allowed(self.tolerance, width)
    }
}
