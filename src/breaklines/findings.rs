//! What a report says about breaklines.

use crate::breaklines::feature::FeatureId;
use crate::geometry::Site;
use serde::{Deserialize, Serialize};

/// What a report says about breaklines. Lists have the worst cases first, at most [`Findings::MOST`] of them; the counts have all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Findings {
    /// Features that were given.
    pub features: u64,
    /// Segments between two different vertices of a feature.
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
    /// Places where segments cross, other than at a vertex.
    pub crossings: u64,
    /// Pieces of lines that lie inside a lake, and were left out.
    pub pieces_in_lakes: u64,
    /// Pieces outside the box of the options, which were left out.
    pub pieces_outside: u64,
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
