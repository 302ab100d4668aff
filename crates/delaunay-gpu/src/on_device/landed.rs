//! What comes back of an atlas.

use crate::on_device::timestamps::StepNanoseconds;
use delaunay::voronoi::mesh_reply::SharedNumbers;

/// What has come back of an atlas.
pub struct Landed {
    /// The numbers.
    pub numbers: SharedNumbers,
    /// Whether leaves may keep the numbers of all until they are read. If not, each must copy its own at once.
    pub may_stay: bool,
    /// The times of the steps.
    pub times: StepNanoseconds,
}
