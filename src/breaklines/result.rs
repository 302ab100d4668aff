//! Breaklines that are cut into edges.

use crate::breaklines::clean::segments_of;
use crate::breaklines::drop_index::DropIndex;
use crate::breaklines::error::BreaklineError;
use crate::breaklines::feature::Feature;
use crate::breaklines::findings::Findings;
use crate::breaklines::heights::sites_with_heights;
use crate::breaklines::lakes::Fraction;
use crate::breaklines::net::{Net, net_of};
use crate::breaklines::options::BreaklineOptions;
use crate::breaklines::site::BreaklineSite;
use crate::geometry::Site;

/// Breaklines that are cut into edges of the triangulation.
#[derive(Clone, Debug)]
pub struct Breaklines {
    sites: Vec<BreaklineSite>,
    subsegments: Vec<[u32; 2]>,
    index: DropIndex,
    options: BreaklineOptions,
}

impl Breaklines {
    /// Cuts `features`. The result does not depend on the order of the features, nor on the order of their paths.
    ///
    /// # Errors
    /// See [`BreaklineError`].
    pub fn build(features: &[Feature], options: &BreaklineOptions) -> Result<(Breaklines, Findings), BreaklineError> {
        let mut findings = Findings::default();
        let (segments, lakes) = segments_of(features, options, &mut findings)?;
        let net = net_of(&segments, lakes, options, &mut findings)?;
        let sites = sites_with_heights(&net, &segments, options, &mut findings);
        let subsegments = subsegments_of(&net, &sites);
        findings.sites = sites.len() as u64;
        findings.subsegments = subsegments.len() as u64;
        findings.sites_without_height = sites.iter().filter(|site| site.z.is_none()).count() as u64;
        let places = subsegments.iter().map(|ends| ends.map(|end| sites[end as usize].place));
        let index = DropIndex::new(places, net.lakes, options.spacing);
        Ok((Breaklines { sites, subsegments, index, options: *options }, findings))
    }

    /// Returns the options that the lines were cut with.
    pub fn options(&self) -> &BreaklineOptions {
        &self.options
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
        self.index.drops(place)
    }

    /// Returns whether the triangle lies inside a lake, on its flat water. The triangle must be one of the mesh.
    pub fn is_water(&self, triangle: [Site; 3]) -> bool {
        self.index.is_water(Fraction::middle_of(&triangle))
    }

    /// Gives the sites that have no height those of `heights`, which has one for each of them, in their order.
    pub(crate) fn set_missing_heights(&mut self, heights: impl IntoIterator<Item = Option<i32>>) {
        let missing = self.sites.iter_mut().filter(|site| site.z.is_none());
        missing.zip(heights).for_each(|(site, z)| site.z = z);
    }
}

/// Returns the subsegments as positions in `sites`, sorted.
fn subsegments_of(net: &Net, sites: &[BreaklineSite]) -> Vec<[u32; 2]> {
    let position =
        |place: Site| sites.partition_point(|site| (site.place[1], site.place[0]) < (place[1], place[0])) as u32;
    let pair = |edge| {
        let [a, b] = net.edges.places(&net.sites, edge).map(position);
        [a.min(b), a.max(b)]
    };
    let mut subsegments: Vec<[u32; 2]> = net.edges.alive().map(pair).collect();
    subsegments.sort_unstable();
    subsegments
}
