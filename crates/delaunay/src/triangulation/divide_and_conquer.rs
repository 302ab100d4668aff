//! Divide and conquer (Guibas and Stolfi 1985, "Primitives for the manipulation of general subdivisions and the computation of Voronoi
//! diagrams", section 9): n log n time on any sites. It triangulates the inner nodes of the tree, whose sites lie along borders,
//! and the leaves that the pipeline rejects.
//!
//! The sites are halved along the axis on which they reach further (after Dwyer 1987, "A faster divide-and-conquer algorithm for
//! constructing Delaunay triangulations"). Two triangulations that lie side by side are joined from their lower common tangent upwards.
//! Every decision is exact, and ties follow the rule of `geometry::predicates`, which is that of sites raised by symbolic amounts, so
//! that joining meets no ties at all.

use crate::error::{Error, Result};
use crate::geometry::REACH;
use crate::geometry::predicates::{in_circle, orient2d};
use crate::geometry::{Bounds, Site};
use crate::host;
use crate::mesh::flip::legalize;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::mesh::index::{HalfEdgeIndex, SiteIndex};

/// Sites have up to six directed edges each, on average.
const MAX_SITES: usize = u32::MAX as usize / 6;

/// After this many sites or edges, the process asks whether it should stop.
const STEPS_BETWEEN_CHECKS: usize = 1 << 14;

/// Computes the canonical Delaunay triangulation of distinct `sites`. It has no triangle if there are fewer than three sites or all
/// lie on one line.
///
/// # Errors
/// [`Error::Stopped`]; [`Error::Coincident`] if two sites coincide; [`Error::OutOfReach`] if a coordinate exceeds [`REACH`], or if there are too
/// many sites for 32-bit numbers of their edges.
pub fn triangulate(sites: &[Site]) -> Result<HalfEdgeMesh> {
    if sites.len() > MAX_SITES || sites.as_flattened().iter().any(|c| !(-REACH..=REACH).contains(c)) {
        return Err(Error::OutOfReach);
    }
    let mut subdivision = Subdivision::new(sites);
    if sites.len() < 2 {
        return Ok(HalfEdgeMesh::default());
    }
    subdivision.triangulate(0, sites.len(), Axis::X)?;
    let mut mesh = subdivision.into_mesh()?;
    host::check()?;
    let flips = legalize(&mut mesh, sites);
    debug_assert_eq!(flips, 0, "joining decides every edge");
    Ok(mesh)
}

/// A part with so many sites or fewer is sorted at once, and halved along one axis alone.
const SMALL_PART: usize = 32;

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

/// The direction in which a part is halved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    X,
    Y,
}

impl Axis {
    /// Returns what ascends along the axis. Sites with the same place on it go by the other coordinate. Both orders are the same but for a
    /// quarter turn, so that joining need not know the axis.
    #[inline]
    fn key(self, [x, y]: Site) -> u64 {
        let [along, across] = match self {
            Axis::X => [x, y],
            Axis::Y => [y, -x],
        };
        // One number is compared faster than two.
        let from_zero = |coordinate: i32| u64::from(coordinate.wrapping_sub(i32::MIN) as u32);
        from_zero(along) << 32 | from_zero(across)
    }

    /// Returns the axis along which `sites` reach further. Sites of merges lie in strips along borders: halves across a strip have few
    /// edges in common.
    fn longer(sites: &[PlacedSite]) -> Axis {
        let bounds = Bounds::of_points(sites.iter().map(|placed| placed.site));
        if bounds.is_some_and(|bounds| bounds.extent(1) > bounds.extent(0)) { Axis::Y } else { Axis::X }
    }
}

/// A site in the order of the parts.
#[derive(Clone, Copy)]
struct PlacedSite {
    site: Site,
    /// Its number where the caller has it.
    index: SiteIndex,
}

/// Two edges on the hull of a part: the one that leaves its first site along an axis and has the hull on its left side, and the one that
/// leaves its last site and has the hull on its right side.
#[derive(Clone, Copy)]
struct HullEnds {
    first: Edge,
    last: Edge,
}

/// The edges of the triangulations of the parts.
struct Subdivision {
    sites: Vec<PlacedSite>,
    edges: Vec<Links>,
    /// Edges that were deleted, the even one of each pair.
    free: Vec<Edge>,
}

/// The origin of deleted edges.
const DELETED: u32 = u32::MAX;

impl Subdivision {
    fn new(sites: &[Site]) -> Subdivision {
        let placed = |(i, &site)| PlacedSite { site, index: SiteIndex::new(i) };
        let sites: Vec<PlacedSite> = sites.iter().enumerate().map(placed).collect();
        Subdivision { edges: Vec::with_capacity(6 * sites.len()), sites, free: Vec::new() }
    }

    /// Triangulates the sites from `start` to before `end`, at least two of them. Returns the ends along `wanted`.
    fn triangulate(&mut self, start: usize, end: usize, wanted: Axis) -> Result<HullEnds> {
        let part = &mut self.sites[start..end];
        let axis = Axis::longer(part);
        let ends = if part.len() <= SMALL_PART {
            part.sort_unstable_by_key(|placed| axis.key(placed.site));
            if part.windows(2).any(|pair| pair[0].site == pair[1].site) {
                return Err(coincidence());
            }
            self.triangulate_sorted(start, end)?
        } else {
            if part.len() > STEPS_BETWEEN_CHECKS {
                host::check()?;
            }
            let middle = part.len() / 2;
            part.select_nth_unstable_by_key(middle, |placed| axis.key(placed.site));
            let left = self.triangulate(start, start + middle, axis)?;
            let right = self.triangulate(start + middle, end, axis)?;
            if self.site(self.origin(left.last)) == self.site(self.origin(right.first)) {
                return Err(coincidence());
            }
            self.join(left, right)?
        };
        Ok(if axis == wanted { ends } else { self.ends_along(wanted, ends.first) })
    }

    /// Triangulates the sites from `start` to before `end`, at least two of them, which are sorted along an axis. Returns the ends along it.
    fn triangulate_sorted(&mut self, start: usize, end: usize) -> Result<HullEnds> {
        match end - start {
            2 => Ok(self.segment(start)),
            3 => Ok(self.triangle(start)),
            n => {
                let left = self.triangulate_sorted(start, start + n / 2)?;
                let right = self.triangulate_sorted(start + n / 2, end)?;
                self.join(left, right)
            }
        }
    }

    /// Returns the ends along `axis` of the part with `edge` on its hull, and the hull on its left side.
    fn ends_along(&self, axis: Axis, edge: Edge) -> HullEnds {
        let key = |site: u32| axis.key(self.site(site));
        let (mut first, mut last, mut at) = (edge, edge, edge);
        loop {
            at = self.right_previous(at);
            if at == edge {
                return HullEnds { first, last: last.reversed() };
            }
            if key(self.origin(at)) < key(self.origin(first)) {
                first = at;
            }
            if key(self.destination(at)) > key(self.destination(last)) {
                last = at;
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
        match orient2d(self.site(first), self.site(first + 1), self.site(first + 2)) {
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
    /// [`Error::Stopped`].
    fn join(&mut self, left: HullEnds, right: HullEnds) -> Result<HullEnds> {
        let (left_inner, right_inner) = self.lower_tangent(left.last, right.first);
        let mut base = self.connect(right_inner.reversed(), left_inner);
        let first = if self.origin(left_inner) == self.origin(left.first) { base.reversed() } else { left.first };
        let last = if self.origin(right_inner) == self.origin(right.last) { base } else { right.last };
        // `base` leads from the right part to the left part, and moves up until it is the upper common tangent.
        for step in 1.. {
            if step % STEPS_BETWEEN_CHECKS == 0 {
                host::check()?;
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
        let [from, to, site] = [self.origin(edge), self.destination(edge), site].map(|i| self.site(i));
        orient2d(from, to, site)
    }

    fn in_circle(&self, a: u32, b: u32, c: u32, d: u32) -> bool {
        let [a, b, c, d] = [a, b, c, d].map(|i| self.site(i));
        in_circle(a, b, c, d)
    }

    fn site(&self, at: u32) -> Site {
        self.sites[at as usize].site
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

    /// Returns the triangles.
    ///
    /// # Errors
    /// [`Error::Stopped`].
    fn into_mesh(self) -> Result<HalfEdgeMesh> {
        let mut half_edge_of = vec![HalfEdgeIndex::HULL; self.edges.len()];
        let mut mesh = HalfEdgeMesh { triangles: Vec::with_capacity(2 * self.sites.len()), twins: Vec::new() };
        for edge in (0..self.edges.len() as u32).map(Edge) {
            if edge.get() % STEPS_BETWEEN_CHECKS == 0 {
                host::check()?;
            }
            if let Some(sides) = self.triangle_left_of(edge).filter(|_| half_edge_of[edge.get()] == HalfEdgeIndex::HULL)
            {
                let half_edges = HalfEdgeIndex::of_triangle(mesh.triangles.len());
                mesh.triangles.push(sides.map(|side| self.sites[self.origin(side) as usize].index));
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

fn coincidence() -> Error {
    Error::Coincident
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_sites_in_one_place_are_an_error() {
        let error = triangulate(&[[0, 0], [4, 1], [0, 0], [2, 2]]).unwrap_err();
        assert_eq!(error, Error::Coincident);
    }

    #[test]
    fn sites_out_of_reach_are_an_error() {
        for far in [[REACH + 1, 0], [0, -REACH - 1], [i32::MIN, 5]] {
            assert!(matches!(triangulate(&[[0, 0], [4, 1], far]), Err(Error::OutOfReach)));
        }
        assert_eq!(triangulate(&[[-REACH, -REACH], [REACH, -REACH], [0, REACH]]).unwrap().triangles.len(), 1);
    }

    /// Equal sites come apart where a part is halved between them.
    #[test]
    fn two_sites_in_one_place_are_found_in_any_part() {
        let line: Vec<Site> = (0..200).map(|i| [i, 3 * i % 7]).collect();
        let column: Vec<Site> = line.iter().map(|&[x, y]| [y, -x]).collect();
        for sites in [line, column] {
            for twice in 0..sites.len() {
                let twins = [&sites[..], &[sites[twice]]].concat();
                assert!(matches!(triangulate(&twins), Err(Error::Coincident)), "{:?}", sites[twice]);
            }
        }
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
