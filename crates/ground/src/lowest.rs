//! The lowest point of each cell.

use crate::cells::{Cells, split};
use crate::density::{CoveredArea, PointCollector};
use crate::morphology::EMPTY;
use crate::scale::Scale;

/// The least width of a cell in metres.
const LEAST_WIDTH: f64 = 1.0;
/// A cell is this many times as wide as points are apart, or wider.
const SPACINGS: f64 = 0.75;
/// The height of a cell without a point.
const NONE: i32 = i32::MAX;

/// The lowest points of a cloud, cell by cell.
#[derive(Clone, Debug)]
pub struct LowestHeights {
    pub(crate) scale: Scale,
    /// The width of a cell in lattice steps.
    pub(crate) steps: i32,
    cells: Cells<i32>,
}

impl LowestHeights {
    /// Returns cells without points for the cloud that covers this area.
    pub fn new(area: &CoveredArea) -> LowestHeights {
        let steps = area.scale.steps_of(LEAST_WIDTH.max(SPACINGS * area.spacing()));
        LowestHeights { scale: area.scale, steps, cells: Cells::new(NONE) }
    }

    /// Returns the number of cells that take memory.
    pub fn cells(&self) -> u64 {
        self.cells.count()
    }

    /// Returns the width of a cell in metres.
    pub(crate) fn width(&self) -> f64 {
        f64::from(self.steps) * self.scale.horizontal
    }

    /// Returns the heights in metres above the lowest of all, and that one.
    pub(crate) fn metres(&self) -> (Cells<f32>, i32) {
        let base = self.cells.values().flatten().copied().min().unwrap_or(0);
        let metres = |z: &i32| if *z == NONE { EMPTY } else { metres_above(base, *z, self.scale) };
        (self.cells.map(EMPTY, 0, |window| window.values.iter().map(metres).collect()), base)
    }
}

/// Returns the height of a point in metres above another one.
pub(crate) fn metres_above(base: i32, z: i32, scale: Scale) -> f32 {
    ((i64::from(z) - i64::from(base)) as f64 * scale.vertical) as f32
}

impl PointCollector for LowestHeights {
    fn emptied(&self) -> LowestHeights {
        LowestHeights { cells: Cells::new(NONE), ..*self }
    }

    fn add(&mut self, points: impl Iterator<Item = [i32; 3]>) {
        for [x, y, z] in points {
            let (block, number) = split([x.div_euclid(self.steps), y.div_euclid(self.steps)]);
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
