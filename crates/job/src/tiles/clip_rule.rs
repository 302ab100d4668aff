//! Which triangles are left out of the terrain because they lie outside the polygons of `[input] clip`: where an area has bays or holes,
//! the triangulation of the points within reaches across. As with `max_edge`, such triangles go to `cut/`.

use lattice::LatticeArea;
use std::sync::Arc;

/// The rule that leaves triangles out.
#[derive(Debug)]
pub(crate) struct ClipRule {
    area: Arc<LatticeArea>,
    /// Whether the vertices are selected from the points, so that triangles may have points below them.
    are_selected: bool,
}

impl ClipRule {
    /// Returns the rule for an area.
    pub(crate) fn new(area: Arc<LatticeArea>, are_selected: bool) -> ClipRule {
        ClipRule { area, are_selected }
    }

    /// Tells whether the triangle with these corners is left out: its centroid lies outside. Where vertices are selected from the points, a
    /// large triangle may lie outside by its centroid and still have much of the area below it. So there all of it has to lie outside, as
    /// far as the centroids of its sixteenths tell.
    pub(crate) fn leaves_out(&self, corners: [[i32; 2]; 3]) -> bool {
        match self.are_selected {
            false => !self.area.holds_centroid(corners),
            true => !self.area.holds_some_of(corners),
        }
    }
}
