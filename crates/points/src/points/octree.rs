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
    let ends = |axis: usize| {
        let width = side[axis] / (1u64 << level) as f64;
        let slack = SLACK_STEPS + SLACK_SHARE * width;
        let low = min[axis] + place[axis] as f64 * width;
        [(low - slack).floor() as i64, (low + width + slack).ceil() as i64]
    };
    let [[x_min, x_max], [y_min, y_max]] = [ends(0), ends(1)];
    RawBounds { min: [x_min, y_min], max: [x_max, y_max] }
}
