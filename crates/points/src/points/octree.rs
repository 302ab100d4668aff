//! Where the points of a node of an octree lie.

use crate::points::raw_bounds::RawBounds;

/// The deepest level of a node: its place there fits an `i32`.
pub(crate) const MOST_LEVELS: u32 = 30;

/// Writers compute nodes in floating point, before or after they round coordinates. A node is taken for so many raw steps wider on
/// every side, and for a small part of its width.
const SLACK_STEPS: f64 = 2.0;
const SLACK_SHARE: f64 = 1.0 / 1024.0;

/// Returns what the points of a node lie within. `min` is the least x and y of the octree's cube and `side` its side along x and y, in raw
/// steps; `level` is at most [`MOST_LEVELS`], and `place` the number of the node there along x and y.
pub(crate) fn cell_of(min: [f64; 2], side: [f64; 2], level: u32, place: [u32; 2]) -> RawBounds {
    let [[x_min, x_max], [y_min, y_max]] = [0, 1].map(|axis| ends_of(min[axis], side[axis], level, place[axis]));
    RawBounds { min: [x_min, y_min], max: [x_max, y_max] }
}

/// As [`cell_of`], along one axis: the least and the greatest raw coordinate.
pub(crate) fn ends_of(min: f64, side: f64, level: u32, place: u32) -> [i64; 2] {
    let width = side / (1u64 << level) as f64;
    let slack = SLACK_STEPS + SLACK_SHARE * width;
    let low = min + f64::from(place) * width;
    [(low - slack).floor() as i64, (low + width + slack).ceil() as i64]
}
