//! What is known of the ground when cells that openings cut off come back.

use crate::cells::Cells;

/// The neighbours of a cell.
pub(crate) const NEIGHBOUR: [[i32; 2]; 8] = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]];

/// The ground so far, as far as growing and regions need it.
pub(crate) struct Terrain<'a> {
    pub(crate) surface: &'a Cells<f32>,
    pub(crate) covered: &'a Cells<bool>,
    /// The radius of the last opening that cut a cell off.
    pub(crate) cut: &'a Cells<f32>,
    pub(crate) width: f32,
}
