//! Parts of the plane that are searched for points.

use crate::disc::Disc;
use delaunay::geometry::Bounds;

/// A part of the plane.
pub(crate) trait Area {
    /// Returns its least and its greatest y.
    fn across(&self) -> [f64; 2];

    /// Returns its least and its greatest x between these y.
    fn along(&self, south: f64, north: f64) -> [f64; 2];

    /// Tells whether it meets a box. Of a box near it this may be told too.
    fn meets(&self, bounds: &Bounds<2>) -> bool {
        let [west, south] = bounds.min.map(f64::from);
        let [east, north] = bounds.max.map(f64::from);
        let overlap = |[low, high]: [f64; 2], from: f64, to: f64| low <= to && from <= high;
        overlap(self.across(), south, north) && overlap(self.along(south, north), west, east)
    }
}

impl Area for Bounds<2> {
    fn across(&self) -> [f64; 2] {
        [self.min[1], self.max[1]].map(f64::from)
    }

    fn along(&self, _: f64, _: f64) -> [f64; 2] {
        [self.min[0], self.max[0]].map(f64::from)
    }
}

impl Area for Disc {
    fn across(&self) -> [f64; 2] {
        [self.low(1), self.high(1)]
    }

    fn along(&self, south: f64, north: f64) -> [f64; 2] {
        self.chord(south, north)
    }
}

/// Tells whether a point lies in `bounds`.
pub(crate) fn is_in(bounds: &Bounds<2>, point: &[i32; 3]) -> bool {
    (0..2).all(|k| bounds.min[k] <= point[k] && point[k] <= bounds.max[k])
}

/// Returns the area of a box in square lattice steps, with half a step around it.
pub(crate) fn area_of(bounds: Bounds<2>) -> f64 {
    (bounds.extent(0) + 1) as f64 * (bounds.extent(1) + 1) as f64
}
