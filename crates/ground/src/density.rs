//! How far apart the points of a cloud are.

use crate::metric_lattice::{MetricLattice, SquareCells};
use std::collections::HashSet;

/// The side of the least squares by which the area of a cloud is measured, in metres.
const LEAST_SIDE: f64 = 8.0;
/// Squares are made twice as wide until those with points have so many on average: where most have one, they show no density.
const ENOUGH: f64 = 2.0;
/// Squares are made no wider than this many times the least ones.
const WIDEST: i32 = 1 << 20;

/// What takes the points of a cloud, in any order and from several threads.
pub trait PointCollector: Sized + Send {
    /// Returns the same without points.
    #[must_use]
    fn emptied(&self) -> Self;

    /// Adds points, as lattice integers x, y, z.
    fn add(&mut self, points: impl Iterator<Item = [i32; 3]>);

    /// Adds the points of `other`.
    fn join(&mut self, other: &Self);
}

/// The area that a cloud covers, and its points.
#[derive(Clone, Debug)]
pub struct CoveredArea {
    pub(crate) lattice: MetricLattice,
    pub(crate) cells: SquareCells,
    pub(crate) squares: HashSet<[i32; 2]>,
    points: u64,
}

impl CoveredArea {
    /// Returns that of a cloud without points.
    pub fn new(lattice: MetricLattice) -> CoveredArea {
        let cells = lattice.cells(lattice.steps_of(LEAST_SIDE));
        CoveredArea { lattice, cells, squares: HashSet::new(), points: 0 }
    }

    /// Returns how many squares hold points. Each is in memory, and the ground has no fewer cells.
    pub fn squares(&self) -> u64 {
        self.squares.len() as u64
    }

    /// Tells whether squares have several points on average, so that they show how far these are apart.
    pub fn shows_density(&self) -> bool {
        self.points as f64 >= ENOUGH * self.squares.len() as f64
    }

    /// Returns how far apart points are, in metres.
    pub fn spacing(&self) -> f64 {
        let (mut wider, mut count) = (1, self.squares.len());
        let mut wide: Vec<[i32; 2]> = Vec::new();
        while (self.points as f64) < ENOUGH * count as f64 && wider < WIDEST {
            wider *= 2;
            wide.clear();
            wide.extend(self.squares.iter().map(|square| square.map(|at| at.div_euclid(wider))));
            wide.sort_unstable();
            wide.dedup();
            count = wide.len();
        }
        let side = f64::from(self.cells.steps) * f64::from(wider) * self.lattice.horizontal;
        (count as f64 * side * side / self.points.max(1) as f64).sqrt()
    }
}

impl PointCollector for CoveredArea {
    fn emptied(&self) -> CoveredArea {
        CoveredArea { squares: HashSet::new(), points: 0, ..*self }
    }

    fn add(&mut self, points: impl Iterator<Item = [i32; 3]>) {
        let mut last = None;
        for [x, y, _] in points {
            let square = self.cells.of([x, y]);
            self.points += 1;
            // Neighbours come one after the other.
            if last != Some(square) {
                self.squares.insert(square);
                last = Some(square);
            }
        }
    }

    fn join(&mut self, other: &CoveredArea) {
        self.squares.extend(&other.squares);
        self.points += other.points;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_lattice_are_as_far_apart_as_they_are() {
        for spacing in [50, 100, 700, 6_000, 1_000_000] {
            let mut area = CoveredArea::new(MetricLattice { horizontal: 0.01, vertical: 0.01, offset: [0; 2] });
            area.add((0..200 * 200).map(|n| [n % 200 * spacing, n / 200 * spacing, 0]));
            let found = area.spacing() / (0.01 * f64::from(spacing));
            assert!((0.8..1.25).contains(&found), "{spacing}: {found}");
        }
    }
}
