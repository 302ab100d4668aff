//! Divide and conquer (Guibas and Stolfi 1985, "Primitives for the manipulation of general subdivisions and the computation of Voronoi
//! diagrams", section 9): n log n time on any sites. It triangulates the inner nodes of the tree, whose sites lie along borders,
//! and the leaves that the pipeline rejects.
//!
//! The sites are sorted and halved; two triangulations that lie side by side are joined from their lower common tangent upwards.
//! Every decision is exact, and ties follow the rule of `geometry::predicates`, which is that of sites raised by symbolic amounts, so
//! that joining meets no ties at all.

use crate::geometry::Site;
use crate::geometry::lattice::REACH;
use crate::geometry::predicates::{in_circle, orient2d};
use crate::mesh::flip::legalize;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};
use crate::{Error, Result, interrupt};

/// Sites have up to six directed edges each, on average.
const MAX_SITES: usize = u32::MAX as usize / 6;

/// After this many sites or edges, the process asks whether it should stop.
const STEPS_BETWEEN_CHECKS: usize = 1 << 14;

/// Computes the canonical Delaunay triangulation of distinct `sites`. It has no triangle if there are fewer than three sites or all
/// lie on one line.
///
/// # Errors
/// [`Error::Interrupted`] if the process was asked to stop, [`Error::Broken`] if two sites coincide, if a coordinate exceeds
/// [`REACH`], or if there are too many sites for 32-bit numbers of their edges.
pub fn triangulate(sites: &[Site]) -> Result<HalfEdgeMesh> {
    if sites.len() > MAX_SITES || sites.as_flattened().iter().any(|c| !(-REACH..=REACH).contains(c)) {
        return Err(Error::Broken("a site is out of reach, or there are too many for one node".into()));
    }
    let mut order: Vec<SiteIndex> = (0..sites.len()).map(SiteIndex::new).collect();
    order.sort_unstable_by_key(|&i| sites[i.get()]);
    let sorted: Vec<Site> = order.iter().map(|&i| sites[i.get()]).collect();
    if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(Error::Broken("two sites of one tile coincide".into()));
    }
    if sites.len() < 3 {
        return Ok(HalfEdgeMesh::default());
    }
    let mut subdivision = Subdivision::new(&sorted);
    subdivision.triangulate(0, sorted.len())?;
    let mut mesh = subdivision.into_mesh(&order)?;
    interrupt::check()?;
    let flips = legalize(&mut mesh, sites);
    debug_assert_eq!(flips, 0, "joining decides every edge");
    Ok(mesh)
}

/// A directed edge. The other direction of edge `e` is `e ^ 1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Edge(u32);

impl Edge {
    fn get(self) -> usize {
        self.0 as usize
    }

    fn reversed(self) -> Edge {
        Edge(self.0 ^ 1)
    }
}

/// What is known of a directed edge: its origin and its neighbours in the ring of edges with that origin.
#[derive(Clone, Copy)]
struct Links {
    origin: u32,
    counterclockwise: Edge,
    clockwise: Edge,
}

/// Two edges on the hull of a part: the one that leaves its first site and has the hull on its left side, and the one that leaves
/// its last site and has the hull on its right side.
#[derive(Clone, Copy)]
struct HullEnds {
    first: Edge,
    last: Edge,
}

/// The edges of the triangulations of the parts.
struct Subdivision<'a> {
    /// Sorted by x, then by y.
    sites: &'a [Site],
    edges: Vec<Links>,
    /// Edges that were deleted, the even one of each pair.
    free: Vec<Edge>,
}

/// The origin of deleted edges.
const DELETED: u32 = u32::MAX;

impl Subdivision<'_> {
    fn new(sites: &[Site]) -> Subdivision<'_> {
        Subdivision { sites, edges: Vec::with_capacity(6 * sites.len()), free: Vec::new() }
    }

    /// Triangulates the sites from `start` to before `end`, at least two of them.
    fn triangulate(&mut self, start: usize, end: usize) -> Result<HullEnds> {
        match end - start {
            2 => Ok(self.segment(start)),
            3 => Ok(self.triangle(start)),
            n => {
                if n > STEPS_BETWEEN_CHECKS {
                    interrupt::check()?;
                }
                let middle = start + n / 2;
                let left = self.triangulate(start, middle)?;
                let right = self.triangulate(middle, end)?;
                self.join(left, right)
            }
        }
    }

    fn segment(&mut self, start: usize) -> HullEnds {
        let edge = self.add(start as u32, start as u32 + 1);
        HullEnds { first: edge, last: edge.reversed() }
    }

    fn triangle(&mut self, start: usize) -> HullEnds {
        let first = start as u32;
        let a = self.add(first, first + 1);
        let b = self.add(first + 1, first + 2);
        self.splice(a.reversed(), b);
        match orient2d(self.sites[start], self.sites[start + 1], self.sites[start + 2]) {
            0 => HullEnds { first: a, last: b.reversed() },
            turn => {
                let c = self.connect(b, a);
                match turn > 0 {
                    true => HullEnds { first: a, last: b.reversed() },
                    false => HullEnds { first: c.reversed(), last: c },
                }
            }
        }
    }

    /// Joins two triangulations, all sites of the first before those of the second.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn join(&mut self, left: HullEnds, right: HullEnds) -> Result<HullEnds> {
        let (left_inner, right_inner) = self.lower_tangent(left.last, right.first);
        let mut base = self.connect(right_inner.reversed(), left_inner);
        let first = if self.origin(left_inner) == self.origin(left.first) { base.reversed() } else { left.first };
        let last = if self.origin(right_inner) == self.origin(right.last) { base } else { right.last };
        // `base` leads from the right part to the left part, and moves up until it is the upper common tangent.
        for step in 1.. {
            if step % STEPS_BETWEEN_CHECKS == 0 {
                interrupt::check()?;
            }
            let first_left = self.edges[base.reversed().get()].counterclockwise;
            let from_left = self.candidate(base, first_left, |links| links.counterclockwise);
            let first_right = self.edges[base.get()].clockwise;
            let from_right = self.candidate(base, first_right, |links| links.clockwise);
            base = match (self.is_above(from_left, base), self.is_above(from_right, base)) {
                (false, false) => break,
                (true, false) => self.connect(base.reversed(), from_left.reversed()),
                (false, true) => self.connect(from_right, base.reversed()),
                (true, true) => {
                    let [l, base_left, base_right, r] = [
                        self.destination(from_left),
                        self.destination(base),
                        self.origin(base),
                        self.destination(from_right),
                    ];
                    match self.in_circle(l, base_left, base_right, r) {
                        true => self.connect(from_right, base.reversed()),
                        false => self.connect(base.reversed(), from_left.reversed()),
                    }
                }
            };
        }
        Ok(HullEnds { first, last })
    }

    /// Walks down both hulls to the lower common tangent; returns the hull edges that leave its two ends.
    fn lower_tangent(&self, mut left: Edge, mut right: Edge) -> (Edge, Edge) {
        loop {
            if self.turn(self.origin(right), left) > 0 {
                left = self.left_next(left);
            } else if self.turn(self.origin(left), right) < 0 {
                right = self.right_previous(right);
            } else {
                return (left, right);
            }
        }
    }

    /// Goes around one end of `base`, from edge `first` on as `neighbour` says, and deletes the edges that the circle through
    /// `base` and their other end shows to be wrong. Returns the edge that then comes first.
    fn candidate(&mut self, base: Edge, first: Edge, neighbour: fn(&Links) -> Edge) -> Edge {
        let mut candidate = first;
        while self.is_above(candidate, base) {
            let next = neighbour(&self.edges[candidate.get()]);
            if !self.is_beaten(candidate, next, base) {
                break;
            }
            self.delete(candidate);
            candidate = next;
        }
        candidate
    }

    /// Returns whether the end of `next` is inside the circle through `base` and the end of `candidate`. An end that is not above
    /// `base` never is.
    fn is_beaten(&self, candidate: Edge, next: Edge, base: Edge) -> bool {
        self.is_above(next, base)
            && self.in_circle(
                self.destination(base),
                self.origin(base),
                self.destination(candidate),
                self.destination(next),
            )
    }

    fn is_above(&self, edge: Edge, base: Edge) -> bool {
        self.turn(self.destination(edge), base) < 0
    }

    /// Returns a positive number if `site` lies to the left of `edge`, a negative one if it lies to the right, zero on its line.
    fn turn(&self, site: u32, edge: Edge) -> i64 {
        let [from, to, site] = [self.origin(edge), self.destination(edge), site].map(|i| self.sites[i as usize]);
        orient2d(from, to, site)
    }

    fn in_circle(&self, a: u32, b: u32, c: u32, d: u32) -> bool {
        let [a, b, c, d] = [a, b, c, d].map(|i| self.sites[i as usize]);
        in_circle(a, b, c, d)
    }

    fn origin(&self, edge: Edge) -> u32 {
        self.edges[edge.get()].origin
    }

    fn destination(&self, edge: Edge) -> u32 {
        self.origin(edge.reversed())
    }

    /// Returns the next edge around the face on the left of `edge`.
    fn left_next(&self, edge: Edge) -> Edge {
        self.edges[edge.reversed().get()].clockwise
    }

    /// Returns the edge before `edge` around the face on its right, in its opposite direction: it leaves the destination of `edge`.
    fn right_previous(&self, edge: Edge) -> Edge {
        self.edges[edge.reversed().get()].counterclockwise
    }

    /// Adds an edge that is connected to no other.
    fn add(&mut self, origin: u32, destination: u32) -> Edge {
        let edge = self.free.pop().unwrap_or(Edge(self.edges.len() as u32));
        if edge.get() == self.edges.len() {
            let links = Links { origin: DELETED, counterclockwise: edge, clockwise: edge };
            self.edges.extend([links; 2]);
        }
        for (e, origin) in [(edge, origin), (edge.reversed(), destination)] {
            self.edges[e.get()] = Links { origin, counterclockwise: e, clockwise: e };
        }
        edge
    }

    /// Adds an edge from the destination of `from` to the origin of `to`, such that all three have the same face on their left.
    fn connect(&mut self, from: Edge, to: Edge) -> Edge {
        let edge = self.add(self.destination(from), self.origin(to));
        self.splice(edge, self.left_next(from));
        self.splice(edge.reversed(), to);
        edge
    }

    fn delete(&mut self, edge: Edge) {
        for e in [edge, edge.reversed()] {
            self.splice(e, self.edges[e.get()].clockwise);
            self.edges[e.get()].origin = DELETED;
        }
        self.free.push(Edge(edge.0 & !1));
    }

    /// Joins the rings of edges around the origins of `a` and `b` if they are two, and parts them if they are one.
    fn splice(&mut self, a: Edge, b: Edge) {
        let (after_a, after_b) = (self.edges[a.get()].counterclockwise, self.edges[b.get()].counterclockwise);
        self.edges[a.get()].counterclockwise = after_b;
        self.edges[b.get()].counterclockwise = after_a;
        self.edges[after_b.get()].clockwise = a;
        self.edges[after_a.get()].clockwise = b;
    }

    /// Returns the triangles, with `order[i]` in the place of site `i`.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    fn into_mesh(self, order: &[SiteIndex]) -> Result<HalfEdgeMesh> {
        let mut half_edge_of = vec![HalfEdgeIndex::HULL; self.edges.len()];
        let mut mesh = HalfEdgeMesh { triangles: Vec::with_capacity(2 * self.sites.len()), twins: Vec::new() };
        for edge in (0..self.edges.len() as u32).map(Edge) {
            if edge.get() % STEPS_BETWEEN_CHECKS == 0 {
                interrupt::check()?;
            }
            if let Some(sides) = self.triangle_left_of(edge).filter(|_| half_edge_of[edge.get()] == HalfEdgeIndex::HULL)
            {
                let half_edges = HalfEdgeIndex::of_triangle(mesh.triangles.len());
                mesh.triangles.push(sides.map(|side| order[self.origin(side) as usize]));
                sides.iter().zip(half_edges).for_each(|(side, h)| half_edge_of[side.get()] = h);
            }
        }
        mesh.twins = vec![HalfEdgeIndex::HULL; 3 * mesh.triangles.len()];
        for (at, &h) in half_edge_of.iter().enumerate().filter(|(_, h)| **h != HalfEdgeIndex::HULL) {
            mesh.twins[h.get()] = half_edge_of[at ^ 1];
        }
        Ok(mesh)
    }

    /// Returns the sides of the triangle on the left of `edge`, if there is one.
    fn triangle_left_of(&self, edge: Edge) -> Option<[Edge; 3]> {
        let second = self.left_next(edge);
        let third = self.left_next(second);
        let closes = self.origin(edge) != DELETED && self.left_next(third) == edge;
        (closes && self.turn(self.destination(second), edge) > 0).then_some([edge, second, third])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sites_in_one_place_are_an_error() {
        let error = triangulate(&[[0, 0], [4, 1], [0, 0], [2, 2]]).unwrap_err();
        assert!(matches!(error, Error::Broken(_)), "{error}");
    }

    #[test]
    fn sites_out_of_reach_are_an_error() {
        for far in [[REACH + 1, 0], [0, -REACH - 1], [i32::MIN, 5]] {
            assert!(matches!(triangulate(&[[0, 0], [4, 1], far]), Err(Error::Broken(_))));
        }
        assert_eq!(triangulate(&[[-REACH, -REACH], [REACH, -REACH], [0, REACH]]).unwrap().triangles.len(), 1);
    }

    /// Quadratic time would be 10^11 steps here, hours rather than a second.
    #[test]
    fn a_line_and_one_site_beside_it_end() {
        let mut sites: Vec<Site> = (0..300_000).map(|i| [i * 3, i * 2]).collect();
        sites.push([400_000, 800_001]);
        let mesh = triangulate(&sites).unwrap();
        assert_eq!(mesh.triangles.len(), sites.len() - 2);
    }
}
