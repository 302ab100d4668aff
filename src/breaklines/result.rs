//! Breaklines that are cut into edges.

use crate::breaklines::error::BreaklineError;
use crate::breaklines::feature::{Feature, FeatureId, FeatureKind, Vertex};
use crate::breaklines::findings::Findings;
use crate::breaklines::options::BreaklineOptions;
use crate::geometry::Site;
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
}

/// Breaklines that are cut into edges of the triangulation.
#[derive(Clone, Debug)]
pub struct Breaklines {
    sites: Vec<BreaklineSite>,
    subsegments: Vec<[u32; 2]>,
}

impl Breaklines {
    /// Cuts `features`. The result does not depend on the order of the features, nor on the order of their paths.
    ///
    /// # Errors
    /// See [`BreaklineError`].
    pub fn build(features: &[Feature], options: &BreaklineOptions) -> Result<(Breaklines, Findings), BreaklineError> {
        let _ = options;
        let mut sites: Vec<BreaklineSite> = features.iter().flat_map(sites_of).collect();
        sites.sort_unstable_by_key(|site| (site.place[1], site.place[0], site.kind, site.z, site.id));
        sites.dedup_by_key(|site| site.place);
        let mut breaklines = Breaklines { sites, subsegments: Vec::new() };
        for path in features.iter().flat_map(|feature| &feature.paths) {
            let index = |v: &Vertex| breaklines.position(v.place).unwrap_or_default() as u32;
            let pairs: Vec<[u32; 2]> = path.windows(2).map(|pair| [index(&pair[0]), index(&pair[1])]).collect();
            breaklines.subsegments.extend(pairs);
        }
        breaklines.subsegments.sort_unstable();
        breaklines.subsegments.dedup();
        let (sites, subsegments) = (breaklines.sites.len() as u64, breaklines.subsegments.len() as u64);
        let findings = Findings { features: features.len() as u64, sites, subsegments, ..Findings::default() };
        Ok((breaklines, findings))
    }

    /// Returns the sites, unique in x and y, sorted by y, then x.
    pub fn sites(&self) -> &[BreaklineSite] {
        &self.sites
    }

    /// Returns the subsegments, sorted: positions in [`Breaklines::sites`], the lesser first.
    pub fn subsegments(&self) -> &[[u32; 2]] {
        &self.subsegments
    }

    /// Returns the position in [`Breaklines::sites`] of the site at `place`.
    pub fn position(&self, place: Site) -> Option<usize> {
        self.sites.binary_search_by_key(&(place[1], place[0]), |site| (site.place[1], site.place[0])).ok()
    }

    /// Returns whether there is a subsegment between the places `a` and `b`.
    pub fn is_subsegment(&self, a: Site, b: Site) -> bool {
        let pair = self.position(a).zip(self.position(b));
        pair.is_some_and(|(a, b)| self.subsegments.binary_search(&[a.min(b) as u32, a.max(b) as u32]).is_ok())
    }

    /// Returns whether a point of the cloud at `place` is dropped: it lies in the closed disc of a subsegment or inside a lake. That holds for
    /// the sites of the breaklines too. The place must lie within `lattice::REACH` of zero.
    #[inline]
    pub fn drops(&self, place: Site) -> bool {
        let in_disc = |[a, b]: &[u32; 2]| {
            let [a, b] = [a, b].map(|&i| self.sites[i as usize].place);
            let along = |axis: usize| i64::from(a[axis] - place[axis]) * i64::from(b[axis] - place[axis]);
            along(0) + along(1) <= 0
        };
        self.subsegments.iter().any(in_disc)
    }

    /// Returns whether the triangle lies inside a lake, on its flat water. The triangle must be one of the mesh.
    pub fn is_water(&self, triangle: [Site; 3]) -> bool {
        let _ = triangle;
        false
    }

    /// Gives the sites that have no height those of `heights`, which has one for each of them, in their order.
    pub(crate) fn set_missing_heights(&mut self, heights: impl IntoIterator<Item = i32>) {
        let missing = self.sites.iter_mut().filter(|site| site.z.is_none());
        missing.zip(heights).for_each(|(site, z)| site.z = Some(z));
    }
}

fn sites_of(feature: &Feature) -> impl Iterator<Item = BreaklineSite> {
    let site = |v: &Vertex| BreaklineSite { place: v.place, z: v.z, kind: feature.kind, id: feature.id };
    feature.paths.iter().flatten().map(site)
}
