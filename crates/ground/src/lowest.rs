//! The lowest point of each cell.

use crate::cells::{Cells, split};
use crate::density::{CoveredArea, PointCollector};
use crate::metric_lattice::{MetricLattice, SquareCells};
use crate::morphology::EMPTY;

/// The least width of a cell in metres.
const LEAST_WIDTH: f64 = 1.0;
/// A cell is this many times as wide as points are apart, or wider.
const SPACINGS: f64 = 0.75;
/// The height of a cell without a point.
const NONE: i32 = i32::MAX;

/// The lowest points of a cloud, cell by cell.
#[derive(Clone, Debug)]
pub struct LowestHeights {
    pub(crate) lattice: MetricLattice,
    pub(crate) squares: SquareCells,
    cells: Cells<i32>,
}

impl LowestHeights {
    /// Returns cells without points for the cloud that covers this area.
    pub fn new(area: &CoveredArea) -> LowestHeights {
        let steps = area.lattice.steps_of(LEAST_WIDTH.max(SPACINGS * area.spacing()));
        LowestHeights { lattice: area.lattice, squares: area.lattice.cells(steps), cells: Cells::new(NONE) }
    }

    /// Returns the number of cells that take memory.
    pub fn cells(&self) -> u64 {
        self.cells.count()
    }

    /// Returns the width of a cell in metres.
    pub(crate) fn width(&self) -> f64 {
        f64::from(self.squares.steps) * self.lattice.horizontal
    }

    /// Returns the heights in metres above the lowest of all, and that one.
    pub(crate) fn metres(&self) -> (Cells<f32>, i32) {
        let base = self.cells.values().flatten().copied().min().unwrap_or(0);
        let metres = |z: &i32| if *z == NONE { EMPTY } else { metres_above(base, *z, self.lattice) };
        (self.cells.map(EMPTY, 0, |window| window.values.iter().map(metres).collect()), base)
    }
}

/// Returns the height of a point in metres above another one.
pub(crate) fn metres_above(base: i32, z: i32, lattice: MetricLattice) -> f32 {
    ((i64::from(z) - i64::from(base)) as f64 * lattice.vertical) as f32
}

impl PointCollector for LowestHeights {
    fn emptied(&self) -> LowestHeights {
        LowestHeights { cells: Cells::new(NONE), ..*self }
    }

    fn add(&mut self, points: impl Iterator<Item = [i32; 3]>) {
        for [x, y, z] in points {
            let (block, number) = split(self.squares.of([x, y]));
            let lowest = &mut self.cells.block_mut(block)[number];
            *lowest = z.min(*lowest);
        }
    }

    fn join(&mut self, other: &LowestHeights) {
        for (&place, values) in other.cells.places().iter().zip(other.cells.values()) {
            self.cells
                .block_mut(place)
                .iter_mut()
                .zip(values)
                .for_each(|(lowest, other)| *lowest = (*lowest).min(*other));
        }
    }
}
