//! Cuts segments where they cross or touch.

use crate::box_tree::BoxTree;
use crate::edge_table::EdgeTable;
use crate::error::BreaklineError;
use crate::exact::{crossing, dot, grown, in_disc, is_near, piece_boxes};
use crate::findings::Findings;
use crate::options::BreaklineOptions;
use crate::site_table::SiteTable;
use delaunay::geometry::{Bounds, Site};
use rayon::prelude::*;
use sys::interrupt;

/// The number of boxes that are compared with all others at once.
const BATCH: usize = 1 << 14;

/// A place where an edge is cut: the place, and the edge.
type Cut = (Site, u32);

/// Finds where the edges of a table cross.
pub(crate) struct Noding<'a> {
    pub(crate) sites: &'a mut SiteTable,
    pub(crate) edges: &'a EdgeTable,
    pub(crate) options: &'a BreaklineOptions,
    pub(crate) findings: &'a mut Findings,
}

impl Noding<'_> {
    /// Returns for every edge the sites on its way from its first end to its last.
    ///
    /// # Errors
    /// [`BreaklineError::TooMany`].
    pub(crate) fn paths(self) -> Result<Vec<Vec<u32>>, BreaklineError> {
        let boxes = self.boxes()?;
        let tree = BoxTree::new(boxes.clone());
        let mut cuts = self.crossings(&boxes, &tree)?;
        cuts.par_sort_unstable();
        self.findings.crossings = cuts.chunk_by(|one, other| one.0 == other.0).count() as u64;
        interrupt::check()?;
        let mut stops: Vec<(u32, u32)> =
            cuts.into_iter().map(|(place, edge)| (edge, self.sites.nearest_or_new(place))).collect();
        stops.extend(self.touches(&boxes)?);
        Ok(self.ways(stops))
    }

    /// Returns boxes that cover the edges.
    fn boxes(&self) -> Result<Vec<(Bounds<2>, u32)>, BreaklineError> {
        let (length, most) = (self.options.spacing.saturating_mul(2), self.options.most_sites);
        let mut boxes = Vec::new();
        for edge in self.edges.alive() {
            let [a, b] = self.edges.places(self.sites, edge);
            for bounds in piece_boxes(a, b, length) {
                boxes.push((bounds, edge));
                if boxes.len() > most {
                    return Err(BreaklineError::TooMany { most });
                }
            }
        }
        Ok(boxes)
    }

    /// Returns where edges cross, once for each edge that is cut there: where many cross at one place, that is one place.
    fn crossings(&self, boxes: &[(Bounds<2>, u32)], tree: &BoxTree<u32>) -> Result<Vec<Cut>, BreaklineError> {
        let most = self.options.most_sites;
        let mut found: Vec<Cut> = Vec::new();
        for batch in boxes.chunks(BATCH) {
            interrupt::check()?;
            found.par_extend(batch.par_iter().flat_map_iter(|(bounds, edge)| self.crossings_of(bounds, *edge, tree)));
            if found.len() > 2 * most {
                found.par_sort_unstable();
                found.dedup();
            }
            if found.len() > 2 * most {
                return Err(BreaklineError::TooMany { most });
            }
        }
        found.par_sort_unstable();
        found.dedup();
        if found.len() > 2 * most { Err(BreaklineError::TooMany { most }) } else { Ok(found) }
    }

    /// Returns where others cut the edge in this box. The same place comes out when the other edge is asked.
    fn crossings_of(&self, bounds: &Bounds<2>, edge: u32, tree: &BoxTree<u32>) -> Vec<Cut> {
        let mut found = Vec::new();
        let ends = self.edges.places(self.sites, edge);
        tree.meeting(bounds, |other| {
            let cut = crossing(ends, self.edges.places(self.sites, other));
            found.extend(cut.map(|place| (place, edge)));
        });
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Returns the sites within the floor of edges, with these edges.
    fn touches(&self, boxes: &[(Bounds<2>, u32)]) -> Result<Vec<(u32, u32)>, BreaklineError> {
        let places = (0..self.sites.len() as u32).map(|site| (Bounds::of_point(self.sites.place(site)), site));
        let tree = BoxTree::new(places.collect());
        let floor = self.sites.floor();
        let touches_of = |(bounds, edge): &(Bounds<2>, u32)| {
            let mut found = Vec::new();
            tree.meeting(&grown(*bounds, floor), |site| found.push((*edge, site)));
            let [a, b] = self.edges.places(self.sites, *edge);
            found.retain(|&(_, site)| is_near(a, b, self.sites.place(site), floor));
            found
        };
        let mut found = Vec::new();
        for batch in boxes.chunks(BATCH) {
            interrupt::check()?;
            found.par_extend(batch.par_iter().flat_map_iter(touches_of));
        }
        Ok(found)
    }

    /// Returns the ways over `stops`. Stops outside the disc of their edge, and its ends, are left out.
    fn ways(&self, mut stops: Vec<(u32, u32)>) -> Vec<Vec<u32>> {
        let order = |&(edge, site): &(u32, u32)| {
            let ([a, b], place) = (self.edges.places(self.sites, edge), self.sites.place(site));
            (edge, dot(a, b, place), place)
        };
        stops.retain(|&(edge, site)| {
            let ([a, b], place) = (self.edges.places(self.sites, edge), self.sites.place(site));
            in_disc(a, b, place) && ![a, b].contains(&place)
        });
        stops.par_sort_unstable_by_key(order);
        stops.dedup();
        let mut ways: Vec<Vec<u32>> = self.edges.edges.iter().map(|edge| vec![edge.ends[0]]).collect();
        stops.into_iter().for_each(|(edge, site)| ways[edge as usize].push(site));
        ways.iter_mut().zip(&self.edges.edges).for_each(|(way, edge)| way.push(edge.ends[1]));
        ways
    }
}
