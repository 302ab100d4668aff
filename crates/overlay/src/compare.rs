//! Two meshes against each other.

use crate::join::for_each_pair;
use crate::mesh::TriangleMesh;
use crate::pair::{are_narrow, overlap};
use crate::totals::Totals;
use crate::zones::ZoneTriangles;

/// What a comparison of two meshes has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// The totals of the whole common area.
    pub all: Totals,
    /// The totals within each zone.
    pub zones: Vec<Totals>,
}

impl Comparison {
    /// Returns a comparison of nothing, with this number of zones.
    pub fn new(zones: usize) -> Comparison {
        Comparison { all: Totals::default(), zones: vec![Totals::default(); zones] }
    }

    /// Adds the comparison of other triangles with the same zones.
    pub fn merge(&mut self, other: &Comparison) {
        self.all.merge(&other.all);
        self.zones.iter_mut().zip(&other.zones).for_each(|(own, other)| own.merge(other));
    }
}

/// Adds what two meshes have in common to `found`. Volumes count only where the difference is at least `threshold` steps. `zones` are the
/// triangles of zones that each triangle of `after` meets, if there are zones.
pub fn compare(
    before: &TriangleMesh,
    after: &TriangleMesh,
    threshold: f64,
    zones: Option<&ZoneTriangles>,
    found: &mut Comparison,
) {
    let [low, high] = [before.heights(), after.heights()];
    let has_narrow_heights = are_narrow([low[0].min(high[0]), low[1].max(high[1])]);
    for_each_pair(before, after, |b, a| {
        let boxes = [before.rectangle(b), after.rectangle(a)];
        let Some(common) = overlap(&before.corners(b), &after.corners(a), boxes, has_narrow_heights) else { return };
        found.all.add(&common.polygon, common.double_area, threshold);
        for (zone, corners) in zones.into_iter().flat_map(|zones| zones.of(a)) {
            if let Some(totals) = found.zones.get_mut(zone) {
                totals.add(&common.within(corners), None, threshold);
            }
        }
    });
}
