//! Heights for lines without heights, from the points around.

use crate::box_tree::BoxTree;
use crate::exact::{distance2, grown, meet};
use crate::feature::FeatureKind;
use crate::result::Breaklines;
use delaunay::geometry::{Bounds, Site};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The nearest point that was found for a site: the square of its distance, and its height. The nearer one is less.
pub type NearestPoint = (u64, i32);

/// Finds for every site without a height the nearest point of the cloud, as far as twice the spacing. Of points at the same distance the
/// lowest counts, so neither the order of points nor the cut into chunks matters: threads collect for themselves, and join.
#[derive(Clone, Debug)]
pub struct NearestHeights {
    /// All collections for the same breaklines share it.
    wanted: Arc<Wanted>,
    nearest: Vec<Option<NearestPoint>>,
}

/// The sites that need a height.
#[derive(Debug)]
struct Wanted {
    places: Vec<Site>,
    /// The squares around the places in which points count.
    squares: BoxTree<u32>,
    bounds: Option<Bounds<2>>,
}

impl NearestHeights {
    /// Returns a collection for the sites of `breaklines` that have no height.
    pub fn new(breaklines: &Breaklines) -> NearestHeights {
        let places: Vec<Site> =
            breaklines.sites().iter().filter(|site| site.z.is_none()).map(|site| site.place).collect();
        let reach = breaklines.options().spacing.saturating_mul(2).min(1 << 30);
        let squares: Vec<_> = places.iter().map(|&place| grown(Bounds::of_point(place), reach)).zip(0..).collect();
        let bounds = squares.iter().map(|(square, _)| *square).reduce(Bounds::union);
        let nearest = vec![None; places.len()];
        NearestHeights { nearest, wanted: Arc::new(Wanted { squares: BoxTree::new(squares), bounds, places }) }
    }

    /// Returns whether no site needs a height.
    pub fn is_empty(&self) -> bool {
        self.wanted.places.is_empty()
    }

    /// Takes a point of the cloud into account. Points that breaklines drop count too.
    #[inline]
    pub fn offer(&mut self, place: Site, z: i32) {
        let point = Bounds::of_point(place);
        let NearestHeights { wanted, nearest } = self;
        let Wanted { places, squares, bounds } = &**wanted;
        if bounds.is_some_and(|bounds| meet(&bounds, &point)) {
            squares.meeting(&point, |site| {
                let found = (distance2(places[site as usize], place) as u64, z);
                let known = &mut nearest[site as usize];
                *known = Some(known.map_or(found, |before| before.min(found)));
            });
        }
    }

    /// Returns what was found, in the order of the sites that have no height. It can be stored and given to [`NearestHeights::join`].
    pub fn found(&self) -> &[Option<NearestPoint>] {
        &self.nearest
    }

    /// Takes into account what another collection for the same breaklines has found.
    pub fn join(&mut self, found: &[Option<NearestPoint>]) {
        for (mine, theirs) in self.nearest.iter_mut().zip(found) {
            *mine = mine.iter().chain(theirs).min().copied();
        }
    }

    /// Gives the sites of `breaklines` without a height that of the nearest point. A lake gets one height: half of its sites have a nearest
    /// point that is not above it. Sites of lines without a point near get the height of the next site on their line that has one, the
    /// lower of two. Returns whether each site has a height then: lines far from all points have none.
    pub fn settle(&self, breaklines: &mut Breaklines) -> bool {
        let missing: Vec<usize> =
            (0..breaklines.sites().len()).filter(|&i| breaklines.sites()[i].z.is_none()).collect();
        let mut heights: Vec<Option<i32>> = breaklines.sites().iter().map(|site| site.z).collect();
        missing.iter().zip(&self.nearest).for_each(|(&i, found)| heights[i] = found.map(|(_, z)| z));
        level_lakes(breaklines, &missing, &mut heights);
        spread(breaklines, &mut heights);
        breaklines.set_missing_heights(missing.iter().map(|&i| heights[i]));
        missing.iter().all(|&i| heights[i].is_some())
    }
}

/// Gives all sites of a lake the same height.
fn level_lakes(breaklines: &Breaklines, missing: &[usize], heights: &mut [Option<i32>]) {
    // By lake and not by feature: one feature may be many ponds.
    let mut lakes: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for &i in missing {
        let Some(lake) = breaklines.sites()[i].lake else { continue };
        lakes.entry(lake).or_default().push(i);
    }
    for sites in lakes.values() {
        let mut found: Vec<i32> = sites.iter().filter_map(|&i| heights[i]).collect();
        found.sort_unstable();
        let level = found.len().checked_sub(1).map(|last| found[last / 2]);
        sites.iter().for_each(|&i| heights[i] = level);
    }
}

/// Gives sites of lines the height of the nearest site along subsegments that has one.
fn spread(breaklines: &Breaklines, heights: &mut [Option<i32>]) {
    let mut neighbours: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &[a, b] in breaklines.subsegments() {
        for [from, to] in [[a, b], [b, a]].map(|pair| pair.map(|i| i as usize)) {
            if heights[to].is_none() && breaklines.sites()[to].kind != FeatureKind::Lake {
                neighbours.entry(from).or_default().push(to);
            }
        }
    }
    let mut known: Vec<usize> = neighbours.keys().copied().filter(|&i| heights[i].is_some()).collect();
    while !known.is_empty() {
        let ends = known.iter().flat_map(|i| neighbours.get(i).into_iter().flatten().map(|&to| (to, heights[*i])));
        let mut next: Vec<(usize, Option<i32>)> = ends.filter(|&(to, _)| heights[to].is_none()).collect();
        next.sort_unstable();
        next.dedup_by_key(|(site, _)| *site);
        next.iter().for_each(|&(site, z)| heights[site] = z);
        known = next.into_iter().map(|(site, _)| site).collect();
    }
}
