//! Sites of breaklines.

use crate::feature::{FeatureId, FeatureKind};
use delaunay::geometry::Site;
use serde::{Deserialize, Serialize};

/// A site of a breakline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BreaklineSite {
    /// Where it is.
    pub place: Site,
    /// Its height, or `None` on a line without heights.
    pub z: Option<i32>,
    /// The kind whose height it has: of several, the first in the order of precedence.
    pub kind: FeatureKind,
    /// The feature whose height it has.
    pub id: FeatureId,
    /// The number of the lake whose height it has; `None` if it is that of a line. A feature may have several lakes.
    pub lake: Option<u32>,
}
