//! The lowest point of each cell.

use crate::cells::{Cells, split};
use crate::density::{CoveredArea, PointCollector};
use crate::metric_lattice::{MetricLattice, SquareCells};
use crate::morphology::EMPTY;

/// The lowest point of a cell. Of points at one height, the one with the least place is lower.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct LowestPoint {
    z: i32,
    /// Where in the cell it is: 256ths of its width, along x and along y.
    spot: [u8; 2],
}

/// What a cell without a point has.
const NONE: LowestPoint = LowestPoint { z: i32::MAX, spot: [0; 2] };

/// The lowest points of a cloud, cell by cell.
#[derive(Clone, Debug)]
pub struct LowestHeights {
    pub(crate) lattice: MetricLattice,
    pub(crate) squares: SquareCells,
    cells: Cells<LowestPoint>,
}

impl LowestHeights {
    /// Returns cells without points for the cloud that covers this area.
    pub fn new(area: &CoveredArea) -> LowestHeights {
        LowestHeights {
            lattice: area.lattice,
            squares: area.lattice.squares_for(area.spacing()),
            cells: Cells::new(NONE),
        }
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
        let base = self.cells.values().flatten().map(|lowest| lowest.z).min().unwrap_or(0);
        let metres =
            |lowest: &LowestPoint| if *lowest == NONE { EMPTY } else { metres_above(base, lowest.z, self.lattice) };
        (self.cells.map(EMPTY, 0, |window| window.values.iter().map(metres).collect()), base)
    }

    /// Returns where in their cells they are: 256ths of the width, along x and along y.
    pub(crate) fn spots(&self) -> Cells<[u8; 2]> {
        self.cells.map([0; 2], 0, |window| window.values.iter().map(|lowest| lowest.spot).collect())
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
            if z <= lowest.z {
                *lowest = LowestPoint { z, spot: self.squares.spot([x, y]) }.min(*lowest);
            }
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
