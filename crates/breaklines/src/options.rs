//! How breaklines are cut.

use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};

/// How breaklines are cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BreaklineOptions {
    /// The wanted length of subsegments in lattice steps: about the distance between neighbouring points. At least 1.
    pub spacing: u32,
    /// Sites of lines that are not farther apart than this number of lattice steps become one site, and a line goes over a site that is in
    /// its way and as near. A line may move by twice as much, by once more for each other line that runs as near beside it, and by half a
    /// step for each time that a piece of it is halved. At least 2: with 1, two lines that meet at an acute angle were seen to become one
    /// over hundreds of steps, each going over the other's rounded sites.
    pub floor: u32,
    /// Two heights at one place disagree if they differ by more than this number of steps in z. The same holds for lakes that are not flat
    /// and rivers that rise.
    pub height_tolerance: u32,
    /// Only what lies in this box becomes a subsegment, its border included: the extent of the cloud. `None` keeps all.
    pub within: Option<Bounds<2>>,
    /// With more sites than this, [`crate::Breaklines::build`] gives up, so that memory stays bounded.
    pub most_sites: usize,
}

impl BreaklineOptions {
    /// Returns the options for subsegments of `spacing` lattice steps in the box `within`.
    ///
    /// The floor is a fiftieth of the spacing, between 2 and 5 steps. It exceeds what rounding to the lattice moves a line, and is less
    /// than the distance between lines that somebody drew on purpose. On a lattice much finer than the spacing it is a thousandth of the
    /// spacing: lines that are nearly the same would be cut into too many pieces.
    pub fn new(spacing: u32, within: Option<Bounds<2>>) -> BreaklineOptions {
        let spacing = spacing.max(1);
        let floor = (spacing / 50).clamp(2, 5).max(spacing / 1000);
        BreaklineOptions { spacing, floor, height_tolerance: 1, within, most_sites: 100_000_000 }
    }
}
