//! Cuts segments where they cross, touch, or leave the box of the job.

use crate::breaklines::box_tree::BoxTree;
use crate::breaklines::edge_table::EdgeTable;
use crate::breaklines::error::BreaklineError;
use crate::breaklines::exact::{crossing, dot, grown, in_disc, is_near, meet, piece_boxes};
use crate::breaklines::findings::Findings;
use crate::breaklines::options::BreaklineOptions;
use crate::breaklines::site_table::SiteTable;
use crate::geometry::{Bounds, Site};
use rayon::prelude::*;

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
        self.findings.crossings = cuts.len() as u64 / 2;
        cuts.extend(self.border_cuts());
        cuts.sort_unstable();
        let mut stops: Vec<(u32, u32)> =
            cuts.into_iter().map(|(place, edge)| (edge, self.sites.nearest_or_new(place))).collect();
        stops.extend(self.touches(&boxes));
        Ok(self.ways(stops))
    }

    /// Returns boxes that cover the edges as far as they lie in the box of the options.
    fn boxes(&self) -> Result<Vec<(Bounds<2>, u32)>, BreaklineError> {
        let (length, most) = (self.options.spacing.saturating_mul(2), self.options.most_sites);
        let mut boxes = Vec::new();
        for edge in self.edges.alive() {
            let [a, b] = self.edges.places(self.sites, edge);
            for bounds in piece_boxes(a, b, length) {
                if self.options.within.is_none_or(|within| meet(&within, &bounds)) {
                    boxes.push((bounds, edge));
                }
                if boxes.len() > most {
                    return Err(BreaklineError::TooMany { most });
                }
            }
        }
        Ok(boxes)
    }

    /// Returns where edges cross, once for each of the two.
    fn crossings(&self, boxes: &[(Bounds<2>, u32)], tree: &BoxTree<u32>) -> Result<Vec<Cut>, BreaklineError> {
        let most = self.options.most_sites;
        let mut found: Vec<(Site, u32, u32)> = Vec::new();
        for batch in boxes.chunks(BATCH) {
            found.par_extend(batch.par_iter().flat_map_iter(|(bounds, edge)| self.crossings_of(bounds, *edge, tree)));
            if found.len() > 2 * most {
                found.par_sort_unstable();
                found.dedup();
            }
            if found.len() > most {
                return Err(BreaklineError::TooMany { most });
            }
        }
        found.par_sort_unstable();
        found.dedup();
        Ok(found.into_iter().flat_map(|(place, one, other)| [(place, one), (place, other)]).collect())
    }

    fn crossings_of(&self, bounds: &Bounds<2>, edge: u32, tree: &BoxTree<u32>) -> Vec<(Site, u32, u32)> {
        let mut found = Vec::new();
        tree.meeting(bounds, |other| {
            if edge < other {
                let cut = crossing(self.edges.places(self.sites, edge), self.edges.places(self.sites, other));
                found.extend(cut.map(|place| (place, edge, other)));
            }
        });
        found
    }

    /// Returns where edges cross the border of the job's box, a little inside it.
    fn border_cuts(&self) -> Vec<Cut> {
        let Some(within) = self.inner_box() else { return Vec::new() };
        let [x, y] = [0, 1].map(|axis| [within.min[axis], within.max[axis]]);
        let sides = [
            [[x[0], y[0]], [x[1], y[0]]],
            [[x[1], y[0]], [x[1], y[1]]],
            [[x[0], y[1]], [x[1], y[1]]],
            [[x[0], y[0]], [x[0], y[1]]],
        ];
        let cut = |edge: u32, side: [Site; 2]| Some((crossing(side, self.edges.places(self.sites, edge))?, edge));
        self.edges.alive().flat_map(|edge| sides.into_iter().filter_map(move |side| cut(edge, side))).collect()
    }

    /// Returns the box that edges are cut to. It is smaller than that of the options by more than sites move.
    fn inner_box(&self) -> Option<Bounds<2>> {
        self.options.within.map(|within| inner_box(within, self.sites.floor()))
    }

    /// Returns the sites within the floor of edges, with these edges.
    fn touches(&self, boxes: &[(Bounds<2>, u32)]) -> Vec<(u32, u32)> {
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
        boxes.par_iter().flat_map_iter(touches_of).collect()
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

/// Returns the box that edges are cut to in the box `within`, where sites move by `floor` at most.
pub(crate) fn inner_box(within: Bounds<2>, floor: u32) -> Bounds<2> {
    let steps = 2 * floor + 2;
    Bounds {
        min: within.min.map(|v| v.saturating_add_unsigned(steps)),
        max: within.max.map(|v| v.saturating_sub_unsigned(steps)),
    }
}
