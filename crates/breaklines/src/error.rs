//! Features that cannot become breaklines.

use crate::feature::FeatureId;
use delaunay::geometry::Site;

/// Why features cannot become breaklines. The caller knows the file's name and the world coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BreaklineError {
    /// A line has two heights at one place.
    #[error("feature {} has the heights {} and {} at one place", id.feature, heights[0], heights[1])]
    Wall {
        /// The feature: the first one in the order of ids that has a wall.
        id: FeatureId,
        /// The place in lattice coordinates.
        place: Site,
        /// The two heights in lattice steps, the lower first.
        heights: [i32; 2],
    },
    /// A vertex lies farther than `geometry::REACH` from zero.
    #[error("feature {} has a vertex outside the range of the lattice", id.feature)]
    OutOfReach {
        /// The feature.
        id: FeatureId,
        /// The place in lattice coordinates.
        place: Site,
    },
    /// The process was asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The lines would need more sites than the options allow.
    #[error("the breaklines need more than {most} vertices")]
    TooMany {
        /// The most sites that are allowed.
        most: usize,
    },
}

/// For [`sys::interrupt::check`], which has no other error.
impl From<sys::Error> for BreaklineError {
    fn from(_: sys::Error) -> BreaklineError {
        BreaklineError::Interrupted
    }
}
