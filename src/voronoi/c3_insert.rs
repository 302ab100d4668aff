//! Step C3: insert the sites that are missing and those that were taken out. Each is found by walking through the mesh,
//! which is Delaunay by then, and made Delaunay at once.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::{ClosedMesh, next, previous};
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g6_triangles::TextureScan;
use crate::voronoi::rejection::Rejection;

/// Where a new vertex goes: into a triangle, maybe onto one of its edges.
struct InsertionPoint {
    triangle: u32,
    on: Option<u32>,
}

/// Inserts the sites `removed` from the mesh and those missing in `texture`.
pub(super) fn insert_all(
    sphere: &mut ClosedMesh,
    texture: &SiteTexture,
    scan: &TextureScan,
    removed: &[[u32; 2]],
    flips: &mut FlipQueue,
) -> Result<(), Rejection> {
    for &[vertex, near] in removed {
        insert(sphere, &texture.sites, vertex, near, flips)?;
    }
    let (mut last_pixel, mut last) = (u32::MAX, 0);
    for (vertex, &pixel) in (texture.placed as u32..).zip(&texture.missing) {
        // The one before, if it was in this pixel or the next, is nearer than what the scan left here.
        let near = if pixel.wrapping_sub(last_pixel) < 2 { last } else { scan.start_near(pixel) };
        last = insert(sphere, &texture.sites, vertex, near, flips)?;
        last_pixel = pixel;
    }
    Ok(())
}

/// Inserts `vertex`, looking for its place from half-edge `near` on; returns a half-edge near it.
fn insert(
    sphere: &mut ClosedMesh,
    sites: &[Site],
    vertex: u32,
    near: u32,
    flips: &mut FlipQueue,
) -> Result<u32, Rejection> {
    let place = locate(sphere, sites, sites[vertex as usize], near, flips)?;
    let sides = sphere.split(place.triangle, vertex);
    flips.suspects.extend(sides);
    if let Some(side) = place.on {
        let h = sides[(side & 3) as usize];
        let g = sphere.twin(h);
        sphere.flip(h);
        flips.suspects.extend([h, previous(h), g, previous(g)]);
    }
    flips.run(sphere, sites)?;
    Ok(sides[0])
}

fn locate(
    sphere: &ClosedMesh,
    sites: &[Site],
    p: Site,
    near: u32,
    flips: &mut FlipQueue,
) -> Result<InsertionPoint, Rejection> {
    let mut h = start(sphere, near)?;
    loop {
        flips.step()?;
        let [a, b, c] = [h, next(h), previous(h)];
        let at = |e: u32| sites[sphere.origin(e) as usize];
        let (pa, pb, pc) = (at(a), at(b), at(c));
        let sides = [orient2d(pa, pb, p), orient2d(pb, pc, p), orient2d(pc, pa, p)];
        match sides.iter().position(|&s| s < 0) {
            Some(i) => {
                h = sphere.twin([a, b, c][i]);
                if sphere.is_ghost(h) {
                    return Ok(InsertionPoint { triangle: h, on: None });
                }
            }
            None => {
                let mut on = [a, b, c].into_iter().zip(sides).filter(|&(_, s)| s == 0).map(|(e, _)| e);
                let place = InsertionPoint { triangle: h, on: on.next() };
                return on.next().map_or(Ok(place), |_| Err(Rejection::NotAccepted("two sites in one place")));
            }
        }
    }
}

/// A half-edge of a finite triangle at or after `near`.
fn start(sphere: &ClosedMesh, near: u32) -> Result<u32, Rejection> {
    let finite = |h: u32| sphere.corners(h).is_some_and(|c| !c.contains(&sphere.infinity()));
    if near < sphere.end() && finite(near) {
        return Ok(near & !7);
    }
    let after = sphere.triangles().filter(|&h| h >= near);
    after.chain(sphere.triangles()).find(|&h| finite(h)).ok_or(Rejection::NotAccepted("no triangle"))
}
