//! What lies inside lakes, and so is left out: which features lose most.

use crate::clean::Segment;
use crate::exact::{distance2, middle};
use crate::feature::FeatureId;
use crate::findings::{InLake, worst};
use delaunay::geometry::Site;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// For every feature with a part inside a lake: about how long that part is, and the first lake and place.
#[derive(Debug, Default)]
pub(crate) struct LinesInLakes {
    features: BTreeMap<FeatureId, (u64, u32, Site)>,
}

impl LinesInLakes {
    /// Adds the piece ab of the features `ids`, which lies in a lake.
    pub(crate) fn add(&mut self, ids: impl Iterator<Item = FeatureId>, lake: u32, [a, b]: [Site; 2]) {
        let (length, place) = ((distance2(a, b) as u64).isqrt(), middle(a, b));
        // A feature may go over a piece twice.
        for id in ids.collect::<BTreeSet<_>>() {
            let (sum, first, at) = self.features.entry(id).or_insert((0, lake, place));
            *sum += length;
            (*first, *at) = (*first, *at).min((lake, place));
        }
    }

    /// Returns those that lost most. `segments` know the features of the lakes.
    pub(crate) fn worst(self, segments: &[Segment]) -> Vec<InLake> {
        if self.features.is_empty() {
            return Vec::new();
        }
        let wanted: BTreeMap<u32, FeatureId> = segments
            .iter()
            .filter(|segment| segment.lake != u32::MAX)
            .map(|segment| (segment.lake, segment.id))
            .collect();
        let found = self
            .features
            .into_iter()
            .filter_map(|(id, (length, lake, place))| Some(InLake { id, lake: *wanted.get(&lake)?, length, place }));
        let mut found: Vec<InLake> = found.collect();
        worst(&mut found, |case| Reverse(case.length));
        found
    }
}
