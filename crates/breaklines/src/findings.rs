//! What a report says about breaklines.

use crate::feature::FeatureId;
use delaunay::geometry::Site;
use serde::{Deserialize, Serialize};

/// What a report says about breaklines. Lists have the worst cases first, at most [`Findings::MOST`] of them; the counts have all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Findings {
    /// Features that were given.
    pub features: u64,
    /// Segments between two different vertices of a feature, as far as they lie in the box of the options. Of lines that are the same, one
    /// counts. Where the box cuts a lake, its border there counts too.
    pub segments: u64,
    /// Subsegments, each of which is an edge of the mesh.
    pub subsegments: u64,
    /// Sites on lines.
    pub sites: u64,
    /// Sites that lines without heights must get a height for from the points around.
    pub sites_without_height: u64,
    /// Vertices that repeat the one before them, and were left out.
    pub repeated_vertices: u64,
    /// Paths without two different vertices, and rings without three, which were left out.
    pub empty_paths: u64,
    /// Vertices that a neighbour within the floor took the place of.
    pub snapped_vertices: u64,
    /// Places where segments cross, other than at a vertex. Many may cross at one.
    pub crossings: u64,
    /// Pieces of lines and of shores that lie inside another lake, and were left out.
    pub pieces_in_lakes: u64,
    /// The features that lost most to a lake, without rivers, which are drawn through lakes as a matter of course.
    #[serde(default)]
    pub worst_in_lakes: Vec<InLake>,
    /// Pieces of lines outside the box of the options, which were cut off.
    pub pieces_outside: u64,
    /// Lakes that the box of the options cuts. They go as far as its border, which is their shore there.
    #[serde(default)]
    pub lakes_at_border: u64,
    /// Rivers that take their heights from the points around. Whether they rise is not looked at.
    #[serde(default)]
    pub rivers_without_heights: u64,
    /// Places where features meet of which one has heights and another takes them from the points around. Whether these disagree is not looked
    /// at.
    #[serde(default)]
    pub places_not_compared: u64,
    /// Places where heights disagree.
    pub disagreements: u64,
    /// The worst of them.
    pub worst_disagreements: Vec<Disagreement>,
    /// Rivers that rise somewhere on the way from their higher end to their lower one.
    pub rising_rivers: u64,
    /// The worst of them.
    pub worst_rises: Vec<Rise>,
    /// Lakes whose vertices have different heights.
    pub uneven_lakes: u64,
    /// The worst of them.
    pub worst_uneven: Vec<Uneven>,
}

impl Findings {
    /// The most cases in a list.
    pub const MOST: usize = 20;
}

/// Sorts cases, the worst first, and keeps the first ones.
pub(crate) fn worst<T: Ord + Copy, K: Ord>(cases: &mut Vec<T>, key: impl Fn(&T) -> K) {
    cases.sort_unstable_by_key(|case| (key(case), *case));
    cases.truncate(Findings::MOST);
}

/// A place where two features, or two parts of one, have different heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Disagreement {
    /// The place in lattice coordinates.
    pub place: Site,
    /// The feature whose height holds, and its height in lattice steps.
    pub kept: (FeatureId, i32),
    /// The feature whose height differs most from it, and that height.
    pub other: (FeatureId, i32),
}

/// A feature with a part inside a lake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct InLake {
    /// The feature.
    pub id: FeatureId,
    /// The lake; of several, the first.
    pub lake: FeatureId,
    /// About how many lattice steps of the feature lie inside lakes.
    pub length: u64,
    /// The middle of a piece of it inside the lake.
    pub place: Site,
}

/// A river that rises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Rise {
    /// The river.
    pub id: FeatureId,
    /// Where it has risen most above the lowest place before.
    pub place: Site,
    /// By how many steps in z.
    pub steps: u32,
}

/// A lake whose vertices have different heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Uneven {
    /// The lake.
    pub id: FeatureId,
    /// Its lowest height, which all of it gets.
    pub lowest: i32,
    /// Its highest height.
    pub highest: i32,
    /// Where the highest height is.
    pub place: Site,
}
