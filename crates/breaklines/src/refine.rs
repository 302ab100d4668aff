//! Splits edges until no site lies in the closed disc of any edge but its own ends.
//!
//! # Why it ends
//! An edge is only ever replaced by two edges over a lattice point in its closed disc, other than its ends. Both are shorter, since a point
//! in the closed disc sees the ends at a right angle or more. Squared lengths are whole numbers, so this cannot go on for ever. It ends
//! soon because of the floor: new sites keep that distance from all others, and an edge shorter than twice the floor goes over the site in
//! its disc, which makes no new one.
//!
//! # Why it finds crossings too
//! Where two edges cross, their four ends are the corners of a convex quadrilateral. One of its angles is a right angle or more, so that
//! end lies in the closed disc of the other edge.
//!
//! # Why it is the same for any order of the features
//! Each round looks at the edges and sites of the round before, and handles edges in the order of their numbers, which were given by
//! place at first and by rounds later.

use crate::box_tree::GrowingTree;
use crate::edge_table::EdgeTable;
use crate::error::BreaklineError;
use crate::exact::{at_radius, disc_box, distance2, foot, in_disc, is_near, middle};
use crate::site_table::SiteTable;
use delaunay::geometry::{Bounds, Site};
use rayon::prelude::*;
use sys::interrupt;

/// Splits the edges of `edges` until no site lies in the closed disc of any but its own ends. Only ends of edges count as sites. `most` is
/// the greatest number of sites.
///
/// # Errors
/// [`BreaklineError::TooMany`] and [`BreaklineError::Interrupted`].
pub(crate) fn refine(sites: &mut SiteTable, edges: &mut EdgeTable, most: usize) -> Result<(), BreaklineError> {
    let mut refinement =
        Refinement { sites, edges, used: Vec::new(), points: GrowingTree::default(), discs: GrowingTree::default() };
    let mut fresh: Vec<u32> = refinement.edges.alive().collect();
    while !fresh.is_empty() {
        interrupt::check()?;
        fresh = refinement.round(fresh);
        if refinement.sites.len() > most {
            return Err(BreaklineError::TooMany { most });
        }
    }
    Ok(())
}

/// A site in the closed disc of an edge. Of several the least is handled first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Witness {
    relation: Relation,
    /// The square of a distance: to the shared end, or to the middle of the edge, doubled.
    measure: i64,
    place: Site,
    site: u32,
}

/// How a site in the disc of an edge relates to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Relation {
    /// It is so near that the edge goes over it.
    Near,
    /// An edge leads from it to the first end of this edge.
    BesideFirst,
    /// An edge leads from it to the last end of this edge.
    BesideLast,
    /// None of these.
    Apart,
}

struct Refinement<'a> {
    sites: &'a mut SiteTable,
    edges: &'a mut EdgeTable,
    /// Whether a site is an end of an edge.
    used: Vec<bool>,
    /// The same, by place.
    points: GrowingTree<u32>,
    /// The edges, by disc.
    discs: GrowingTree<u32>,
}

impl Refinement<'_> {
    /// Compares the new edges with all sites, and the new sites with all edges, and splits each edge that is found once. Returns the edges
    /// that are new then.
    fn round(&mut self, fresh: Vec<u32>) -> Vec<u32> {
        let mut new_sites: Vec<u32> = fresh.iter().flat_map(|&edge| self.edges.edges[edge as usize].ends).collect();
        self.used.resize(self.sites.len(), false);
        new_sites.retain(|&site| !std::mem::replace(&mut self.used[site as usize], true));
        let points = new_sites.iter().map(|&site| (Bounds::of_point(self.sites.place(site)), site)).collect();
        self.points.add(points, |_| true);
        let mut found: Vec<(u32, Witness)> =
            new_sites.par_iter().flat_map_iter(|&site| self.edges_around(site)).collect();
        found.par_extend(fresh.par_iter().filter_map(|&edge| Some((edge, self.site_inside(edge)?))));
        let discs = fresh.iter().map(|&edge| (self.disc_box(edge), edge)).collect();
        let alive = |edge: u32| self.edges.edges[edge as usize].alive;
        self.discs.add(discs, alive);
        found.par_sort_unstable();
        found.dedup_by_key(|(edge, _)| *edge);
        let new: Vec<u32> = found.into_iter().flat_map(|(edge, witness)| self.split(edge, witness)).flatten().collect();
        new.into_iter().filter(|&edge| self.edges.edges[edge as usize].alive).collect()
    }

    fn disc_box(&self, edge: u32) -> Bounds<2> {
        let [a, b] = self.edges.places(self.sites, edge);
        disc_box(a, b)
    }

    /// Returns the edges whose discs hold the site.
    fn edges_around(&self, site: u32) -> Vec<(u32, Witness)> {
        let mut found = Vec::new();
        self.discs.meeting(&Bounds::of_point(self.sites.place(site)), |edge| {
            if self.edges.edges[edge as usize].alive {
                found.extend(self.witness(edge, site).map(|witness| (edge, witness)));
            }
        });
        found
    }

    /// Returns the least site in the disc of the edge.
    fn site_inside(&self, edge: u32) -> Option<Witness> {
        let mut least: Option<Witness> = None;
        self.points.meeting(&self.disc_box(edge), |site| {
            least = least.into_iter().chain(self.witness(edge, site)).min();
        });
        least
    }

    /// Returns the site as a witness if it lies in the closed disc of the edge and is not one of its ends.
    fn witness(&self, edge: u32, site: u32) -> Option<Witness> {
        let ends = self.edges.edges[edge as usize].ends;
        let ([a, b], place) = (self.edges.places(self.sites, edge), self.sites.place(site));
        if ends.contains(&site) || !in_disc(a, b, place) {
            return None;
        }
        let floor = self.sites.floor();
        let is_beside = |end: u32| self.edges.between(end, site).is_some();
        let to_middle = [0, 1].map(|axis| 2 * i64::from(place[axis]) - i64::from(a[axis]) - i64::from(b[axis]));
        let (relation, measure) = if is_near(a, b, place, floor) || is_short(a, b, floor) {
            (Relation::Near, to_middle[0] * to_middle[0] + to_middle[1] * to_middle[1])
        } else if is_beside(ends[0]) {
            (Relation::BesideFirst, distance2(a, place))
        } else if is_beside(ends[1]) {
            (Relation::BesideLast, distance2(b, place))
        } else {
            (Relation::Apart, to_middle[0] * to_middle[0] + to_middle[1] * to_middle[1])
        };
        Some(Witness { relation, measure, place, site })
    }

    /// Replaces the edge by two edges. Returns those that are new.
    fn split(&mut self, edge: u32, witness: Witness) -> [Option<u32>; 2] {
        let [a, b] = self.edges.places(self.sites, edge);
        let target = match witness.relation {
            Relation::Near => None,
            // At the same distance from the shared end: then neither lies in the disc of the other, and no third line is split anew.
            Relation::BesideFirst => Some(at_radius(a, b, witness.measure)),
            Relation::BesideLast => Some(at_radius(b, a, witness.measure)),
            Relation::Apart => Some(foot(a, b, witness.place)),
        };
        let via = match target {
            Some(target) => self.site_for(target, [a, b]).or_else(|| self.site_for(middle(a, b), [a, b])),
            None => None,
        };
        self.edges.replace(self.sites, edge, via.unwrap_or(witness.site))
    }

    /// Returns the site nearest to `target`, or a new one there, if it lies in the closed disc of ab and is neither `a` nor `b`.
    fn site_for(&mut self, target: Site, [a, b]: [Site; 2]) -> Option<u32> {
        let fits = |place: Site| in_disc(a, b, place) && ![a, b].contains(&place);
        match self.sites.nearest(target) {
            Some(site) => fits(self.sites.place(site)).then_some(site),
            None => fits(target).then(|| self.sites.nearest_or_new(target)),
        }
    }
}

/// Returns whether ab is too short for a new site in its middle that keeps the floor from both ends.
fn is_short(a: Site, b: Site, floor: u32) -> bool {
    let least = 2 * i64::from(floor) + 2;
    distance2(a, b) < least * least
}
