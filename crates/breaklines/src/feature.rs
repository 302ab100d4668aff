//! What breaklines are made of: lines and polygons in lattice coordinates.

use delaunay::geometry::Site;
use serde::{Deserialize, Serialize};

/// What a feature is, in the order of precedence: where features meet, the height of the lake holds, then that of the river.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FeatureKind {
    /// A polygon with one height. It is flat inside.
    Lake,
    /// A line that falls from one end to the other.
    River,
    /// Any other line.
    Line,
}

/// Which feature of which file. The caller gives the numbers, and finds them again in findings and errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FeatureId {
    /// The number of the file.
    pub file: u32,
    /// The number of the feature in its file.
    pub feature: u64,
}

/// A vertex of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Vertex {
    /// Where it is, within `geometry::REACH` of zero.
    pub place: Site,
    /// Its height, or `None` if the file has none.
    pub z: Option<i32>,
}

/// A line, several lines, or a polygon.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Feature {
    /// What it is.
    pub kind: FeatureKind,
    /// Who it is.
    pub id: FeatureId,
    /// The lines, or all rings of a lake: a point is inside if a ray from it crosses the rings an odd number of times, so the order and the
    /// direction of rings do not matter, and islands stay. Rings need not repeat their first vertex at the end.
    pub paths: Vec<Vec<Vertex>>,
}
