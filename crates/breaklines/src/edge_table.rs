//! Edges between sites, each with the segments that it is a part of.

use crate::fast_hash::FastMap;
use crate::owners::Owners;
use crate::site_table::SiteTable;
use delaunay::geometry::Site;

/// An edge between two sites.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Its ends, the one with the lesser place first.
    pub(crate) ends: [u32; 2],
    /// The set of segments that it is a part of.
    pub(crate) owners: u32,
    /// Whether it has not been replaced by shorter edges.
    pub(crate) alive: bool,
}

/// Edges, no two of them alive between the same sites.
#[derive(Debug)]
pub(crate) struct EdgeTable {
    pub(crate) edges: Vec<Edge>,
    pub(crate) owners: Owners,
    between: FastMap<[u32; 2], u32>,
}

impl EdgeTable {
    /// Returns a table without edges. `owners` are its sets of segments.
    pub(crate) fn new(owners: Owners) -> EdgeTable {
        EdgeTable { edges: Vec::new(), owners, between: FastMap::default() }
    }

    /// Returns the edge between two sites, in any order.
    pub(crate) fn between(&self, a: u32, b: u32) -> Option<u32> {
        self.between.get(&[a.min(b), a.max(b)]).copied()
    }

    /// Adds an edge between two different sites, or the owners to the one that is there. Returns the new edge, if there is one.
    pub(crate) fn add(&mut self, sites: &SiteTable, [a, b]: [u32; 2], owners: u32) -> Option<u32> {
        if let Some(known) = self.between(a, b) {
            let edge = &mut self.edges[known as usize];
            edge.owners = self.owners.join(edge.owners, owners);
            return None;
        }
        let ends = if sites.place(a) < sites.place(b) { [a, b] } else { [b, a] };
        let edge = self.edges.len() as u32;
        self.edges.push(Edge { ends, owners, alive: true });
        self.between.insert([a.min(b), a.max(b)], edge);
        Some(edge)
    }

    /// Replaces an edge by a path over `via`, which is neither of its ends. Returns the edges that are new.
    pub(crate) fn replace(&mut self, sites: &SiteTable, edge: u32, via: u32) -> [Option<u32>; 2] {
        let Edge { ends: [a, b], owners, .. } = self.edges[edge as usize];
        self.edges[edge as usize].alive = false;
        self.between.remove(&[a.min(b), a.max(b)]);
        [self.add(sites, [a, via], owners), self.add(sites, [via, b], owners)]
    }

    /// Returns the numbers of the edges that are alive.
    pub(crate) fn alive(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.edges.len() as u32).filter(|&edge| self.edges[edge as usize].alive)
    }

    /// Returns the places of the ends of an edge.
    #[inline]
    pub(crate) fn places(&self, sites: &SiteTable, edge: u32) -> [Site; 2] {
        self.edges[edge as usize].ends.map(|end| sites.place(end))
    }
}
