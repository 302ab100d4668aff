//! Step C1: complete the convex hull. Where two hull edges leave a pocket between them, a triangle fills it, by a flip of the
//! edge to infinity, until no pocket is left. This is the paper's stack walk around the boundary.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;

/// How many hull vertices on either side of a pocket are checked for lying in it.
const NEIGHBOURS: usize = 6;
/// After this many rounds of repair the leaf is rejected.
const MAX_ROUNDS: usize = 12;
/// In the first rounds, vertices are removed only where that leaves a clean hole.
const CLEAN_ROUNDS: usize = 4;
/// If all walks around the hull, and what fills pockets, take more steps for each site than this, the leaf is rejected. Each vertex that is
/// removed takes a walk: on narrow curves nearly all sites are on the hull, and most of them are removed.
const STEPS_PER_SITE: usize = 70;
/// So many records are looked at in the time of a step.
const RECORDS_PER_STEP: usize = 16;

/// Makes the hull convex. `shift` records what changes and which vertices are removed: where thin regions reach the frame, vertices
/// that belong inside may be on the hull.
pub(super) fn complete_hull(mesh: &mut ClosedMesh, sites: &[Site], shift: &mut ShiftRepair) -> Result<(), Rejection> {
    let mut walker = HullWalker { near: mesh.front(), steps_left: STEPS_PER_SITE * sites.len() };
    for round in 0..MAX_ROUNDS {
        let rays = walker.rays(mesh)?;
        let blocked = fill_pockets(mesh, sites, rays, shift, &mut walker)?;
        let hull = HullLoop::new(mesh, &walker.rays(mesh)?);
        if blocked.is_empty() && hull.turns_once(sites) {
            return Ok(());
        }
        let before = shift.removed.len();
        for vertex in hull.sharp_corners(sites, round >= 2).chain(blocked) {
            if let Some(h) = walker.outgoing(mesh, vertex)? {
                shift.remove(mesh, sites, h, round >= CLEAN_ROUNDS);
            }
        }
        shift.repair(mesh, sites)?;
        if shift.removed.len() == before && round > CLEAN_ROUNDS {
            break;
        }
    }
    Err(Rejection::NotAccepted("the hull could not be completed"))
}

/// Fills the pockets at `rays`, the half-edges that start at infinity; returns the vertices whose pockets were left open because
/// other hull vertices lie in them.
fn fill_pockets(
    mesh: &mut ClosedMesh,
    sites: &[Site],
    mut rays: Vec<ClosedEdge>,
    shift: &mut ShiftRepair,
    walker: &mut HullWalker,
) -> Result<Vec<VertexIndex>, Rejection> {
    let mut blocked = Vec::new();
    while let Some(h) = rays.pop() {
        // A flip moves half-edges, so one in the list need no longer start at infinity.
        if mesh.origin(h) != mesh.infinity() || !mesh.fails(sites, h) {
            continue;
        }
        if !is_empty(mesh, sites, h) {
            blocked.push(mesh.destination(h));
            continue;
        }
        walker.spend(1)?;
        let g = mesh.twin(h);
        mesh.flip(h);
        shift.suspects.extend([g, g.previous()]);
        rays.extend([h, mesh.twin(h.previous())]);
    }
    Ok(blocked)
}

/// Walks around the hull.
struct HullWalker {
    /// A half-edge of a triangle that may be a ghost still.
    near: ClosedEdge,
    /// The steps that are left to all walks.
    steps_left: usize,
}

impl HullWalker {
    /// Returns all half-edges that start at infinity, clockwise around the hull.
    fn rays(&mut self, mesh: &ClosedMesh) -> Result<Vec<ClosedEdge>, Rejection> {
        let first = self.first_ray(mesh)?;
        let mut rays = vec![first];
        loop {
            let ray = mesh.twin(rays[rays.len() - 1].previous());
            self.spend(1)?;
            if ray == first {
                // The other side of the hull is safe from what the caller does at the first ray.
                self.near = rays[rays.len() / 2];
                return Ok(rays);
            }
            rays.push(ray);
        }
    }

    fn first_ray(&mut self, mesh: &ClosedMesh) -> Result<ClosedEdge, Rejection> {
        if !mesh.is_ghost(self.near) {
            let mut triangles = mesh.triangles();
            self.near = triangles.find(|&t| mesh.is_ghost(t)).ok_or(Rejection::NotAccepted("no hull"))?;
            self.spend(self.near.get() / 8 / RECORDS_PER_STEP)?;
        }
        mesh.ray(self.near).ok_or(Rejection::NotAccepted("no hull"))
    }

    /// Returns the half-edge that starts at `vertex` and runs along the hull, if the vertex is on the hull.
    fn outgoing(&mut self, mesh: &ClosedMesh, vertex: VertexIndex) -> Result<Option<ClosedEdge>, Rejection> {
        let rays = self.rays(mesh)?;
        let found = rays.iter().position(|&h| mesh.destination(h) == vertex);
        // The triangles of the vertex may go.
        self.near = rays[(found.unwrap_or(0) + rays.len() / 2) % rays.len()];
        Ok(found.map(|at| rays[at].next()))
    }

    fn spend(&mut self, steps: usize) -> Result<(), Rejection> {
        let left = self.steps_left.checked_sub(steps);
        self.steps_left = left.ok_or(Rejection::NotAccepted("too many vertices must leave the hull"))?;
        Ok(())
    }
}

/// The vertices of the hull, counterclockwise.
struct HullLoop(Vec<VertexIndex>);

impl HullLoop {
    fn new(mesh: &ClosedMesh, rays: &[ClosedEdge]) -> HullLoop {
        HullLoop(rays.iter().rev().map(|&h| mesh.destination(h)).collect())
    }

    /// Returns every vertex together with the one before it and the one after it.
    fn corners(&self) -> impl Iterator<Item = [VertexIndex; 3]> {
        let n = self.0.len();
        (0..n).map(move |i| [self.0[(i + n - 1) % n], self.0[i], self.0[(i + 1) % n]])
    }

    fn turns_once(&self, sites: &[Site]) -> bool {
        let upward = |p: Site, q: Site| q[1] > p[1] || (q[1] == p[1] && q[0] > p[0]);
        let starts_upward = |&[p, q, r]: &[Site; 3]| !upward(p, q) && upward(q, r);
        self.corners().map(|corner| corner.map(|v| v.site(sites))).filter(starts_upward).count() == 1
    }

    /// Returns the vertices at which the hull turns by more than a right angle, with their neighbours if `with_neighbours`.
    fn sharp_corners(&self, sites: &[Site], with_neighbours: bool) -> impl Iterator<Item = VertexIndex> {
        let along = |a: Site, b: Site, i: usize| b[i] as i64 - a[i] as i64;
        let is_sharp = move |corner: &[VertexIndex; 3]| {
            let [p, q, r] = corner.map(|v| v.site(sites));
            along(p, q, 0) * along(q, r, 0) + along(p, q, 1) * along(q, r, 1) < 0
        };
        let range = if with_neighbours { 0..3 } else { 1..2 };
        self.corners().filter(is_sharp).flat_map(move |corner| range.clone().map(move |i| corner[i]))
    }
}

/// Returns whether no hull vertex nearby lies in the pocket at half-edge `h`, which starts at infinity.
fn is_empty(mesh: &ClosedMesh, sites: &[Site], h: ClosedEdge) -> bool {
    let vertices = [mesh.destination(h), mesh.apex(h), mesh.apex(mesh.twin(h))];
    let [a, b, c] = vertices.map(|v| v.site(sites));
    let covers = |v: VertexIndex| {
        let p = v.site(sites);
        !vertices.contains(&v) && orient2d(a, b, p) >= 0 && orient2d(b, c, p) >= 0 && orient2d(c, a, p) >= 0
    };
    let (mut back, mut forth) = (h, h);
    for _ in 0..NEIGHBOURS {
        back = mesh.twin(back.previous());
        forth = mesh.twin(forth).next();
        if covers(mesh.destination(back)) || covers(mesh.destination(forth)) {
            return false;
        }
    }
    true
}
