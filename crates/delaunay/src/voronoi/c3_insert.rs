//! Step C3: insert the sites that are missing or were removed. A walk through the mesh, which is Delaunay by then, finds the place
//! of each. After each insertion the mesh is made Delaunay again at once.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::index::{ClosedEdge, VertexIndex};
use crate::voronoi::rejection::Rejection;

/// Where a new vertex goes: into a triangle, and if it lies on a side of the triangle, onto that side.
struct InsertionPoint {
    triangle: ClosedEdge,
    on: Option<ClosedEdge>,
}

/// A site that is not in the mesh yet.
pub(super) struct MissingSite {
    pub(super) vertex: VertexIndex,
    /// The number of the part of the texture that the site belongs to. Parts with numbers that follow each other are neighbours.
    pub(super) place: u32,
}

/// Inserts the sites that were `removed` from the mesh and those that are `missing`. `start_near` returns a half-edge near a place, which
/// need not exist any more.
pub(super) fn insert_all(
    mesh: &mut ClosedMesh,
    sites: &[Site],
    removed: &[(VertexIndex, ClosedEdge)],
    missing: impl Iterator<Item = MissingSite>,
    start_near: impl Fn(u32) -> ClosedEdge,
    flips: &mut FlipQueue,
) -> Result<(), Rejection> {
    for &(vertex, near) in removed {
        insert(mesh, sites, vertex, near, flips)?;
    }
    let (mut last_place, mut last) = (u32::MAX, ClosedEdge::default());
    for MissingSite { vertex, place } in missing {
        // If the last site was in this place or the one before it, it is nearer than the triangle that was made here.
        let near = if place.wrapping_sub(last_place) < 2 { last } else { start_near(place) };
        last = insert(mesh, sites, vertex, near, flips)?;
        last_place = place;
    }
    Ok(())
}

/// Inserts `vertex`, looking for its place from half-edge `near` on; returns a half-edge near it.
fn insert(
    mesh: &mut ClosedMesh,
    sites: &[Site],
    vertex: VertexIndex,
    near: ClosedEdge,
    flips: &mut FlipQueue,
) -> Result<ClosedEdge, Rejection> {
    let place = locate(mesh, sites, vertex.site(sites), near, flips)?;
    let sides = mesh.split(place.triangle, vertex);
    flips.suspects.extend(sides);
    if let Some(side) = place.on {
        let h = sides[side.corner()];
        let g = mesh.twin(h);
        mesh.flip(h);
        flips.suspects.push(g.previous());
    }
    flips.run_around(mesh, sites)?;
    Ok(sides[0])
}

fn locate(
    mesh: &ClosedMesh,
    sites: &[Site],
    p: Site,
    near: ClosedEdge,
    flips: &mut FlipQueue,
) -> Result<InsertionPoint, Rejection> {
    let turn = |h: ClosedEdge| orient2d(mesh.origin(h).site(sites), mesh.destination(h).site(sites), p);
    let mut h = start(mesh, near, flips)?;
    if turn(h) < 0 {
        h = mesh.twin(h);
    }
    // From here on the site does not lie to the right of `h`, so that two sides of each triangle are left to look at.
    while mesh.apex(h) != mesh.infinity() {
        flips.step()?;
        let side = match (turn(h.next()) < 0, turn(h.previous()) < 0) {
            (true, _) => h.next(),
            (false, true) => h.previous(),
            (false, false) => return inside(h, h.triangle().sides().map(turn)),
        };
        h = mesh.twin(side);
    }
    Ok(InsertionPoint { triangle: h, on: None })
}

/// Returns the place of a site that lies in the triangle of `h`, given how its sides turn to the site.
fn inside(h: ClosedEdge, turns: [i64; 3]) -> Result<InsertionPoint, Rejection> {
    let mut on = h.triangle().sides().into_iter().zip(turns).filter(|&(_, turn)| turn == 0).map(|(side, _)| side);
    let place = InsertionPoint { triangle: h, on: on.next() };
    on.next().map_or(Ok(place), |_| Err(Rejection::NotAccepted("two sites in one place")))
}

/// Returns a half-edge of a finite triangle: that of `near`, its neighbour if `near` is a ghost, or one that comes soon after it.
fn start(mesh: &ClosedMesh, near: ClosedEdge, flips: &mut FlipQueue) -> Result<ClosedEdge, Rejection> {
    let is_finite = |h: ClosedEdge| mesh.corners(h).is_some_and(|c| !c.contains(&mesh.infinity()));
    let first = near.triangle().max(mesh.front());
    if first < mesh.end() && !mesh.is_free(first) {
        let beyond = first.sides().into_iter().map(|side| mesh.twin(side));
        if let Some(h) = std::iter::once(first).chain(beyond).find(|&h| h < mesh.end() && is_finite(h)) {
            return Ok(h.triangle());
        }
    }
    for h in (first.0..mesh.end().0).step_by(8).map(ClosedEdge).chain(mesh.triangles()) {
        flips.step()?;
        if is_finite(h) {
            return Ok(h);
        }
    }
    Err(Rejection::NotAccepted("no triangle"))
}
