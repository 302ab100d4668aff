//! The canonical Delaunay triangulation of a leaf by way of its discrete Voronoi diagram: the ten steps of Rong, Tan, Cao and
//! Stephanus 2008, "Computing Two-dimensional Delaunay Triangulation Using Graphics Hardware", here on one CPU thread.
//!
//! [`triangulate`] does all steps on one thread, in this order. Each step has a file of its name. [`triangulate_with`] goes on from a mesh
//! that a device has made of the leaf; the device's shaders are in `shaders/`, those of G1 to G6 in `shaders/atlas/`.
//!
//! | step | on this thread | on a device | then on this thread |
//! |---|---|---|---|
//! | G1 | `g1_write_sites`: writes the sites into a texture; losers move or are missing; `pixel_map`: where sites crowd, pixels are small | `g1_write_sites` | |
//! | G2 | `g2_voronoi`: labels each pixel with its nearest site, one row at a time | `g2_voronoi_exact`, or `g2_voronoi_jfa` | |
//! | G3 | `g3_islands`, after G6: removes the triangles that pieces of torn regions have made | `g3_islands`: gives the pieces other colours | |
//! | G4-G6 | `g6_triangles`: makes linked triangles where colours meet, with C2's tests and C4's flips while the row is in the cache | `g4_vertices`, `g5_count`, `g6_triangles` | `device_mesh`: checks all numbers |
//! | C2 | `c2_shift`: repairs triangles that are inverted at the sites' true places | `c4_flip`: flips them away where that is possible | `c2_shift`: what is left |
//! | C1 | `c1_hull`: makes the hull convex | | `c1_hull` |
//! | C4 | `c4_flip`: makes the flips that were not possible earlier | `c4_flip`: twelve rounds of flips | `c4_flip`: what is left |
//! | C3 | `c3_insert`: inserts the sites that are missing or were removed, flipping edges along the way | | `c3_insert` |
//! | | `accept`: proves the result | | `accept` |
//!
//! `completion` has the steps from C2 on, which are the same for both ways. They differ from the paper in some ways:
//!
//! - G1: a site that loses its pixel moves to a free neighbour, where the paper leaves it out. So C3, which is slow, has less to do. Where
//!   sites crowd along an axis, columns or rows are narrower. So one texture does for clusters.
//! - G2: the diagram is exact, where the paper floods by jumps and gets some pixels wrong. Two passes also cost less than a dozen.
//! - G4-G6: triangles are linked when they are made, and ghost triangles beyond the hull close the mesh. So no step needs a search for
//!   neighbours, and the hull is no special case.
//! - C2: the paper shifts one site after the other and treats each kind of inversion in a way of its own. Here all sites shift at once, and
//!   one mechanism repairs whatever is inverted: flips, or else a corner is taken out and comes back in C3. It is sound on any input.
//! - C1 comes after C2, because the hull at the true places is needed only once. C4 comes before C3, because walks in a Delaunay mesh are
//!   short and sure to end.
//! - All tests are exact, ties included, and `accept` proves the mesh.
//!
//! Any step may go wrong on unlucky input. Because `accept` proves the result, an error costs time and never correctness. All
//! steps work on one mesh, of `closed_mesh`; `edge_tester` tests many of its edges at once.

mod accept;
mod c1_hull;
mod c2_shift;
mod c3_insert;
mod c4_flip;
mod closed_mesh;
mod completion;
pub mod counts;
pub mod device_mesh;
mod edge_tester;
mod g1_write_sites;
mod g2_voronoi;
mod g3_islands;
mod g6_triangles;
mod index;
pub mod mesh_reply;
mod pixel_map;
pub mod rejection;
#[cfg(any(test, feature = "test-cases"))]
pub mod test_cases;
#[cfg(test)]
mod tests;
pub mod texture_request;
mod triangle_writer;

use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::voronoi::accept::AcceptanceCheck;
use crate::voronoi::c2_shift::ShiftRepair;
use crate::voronoi::c4_flip::FlipQueue;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::completion::Completion;
use crate::voronoi::counts::{PipelineCounts, StepTimer};
use crate::voronoi::device_mesh::{DeviceMesh, copy_sites};
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::LabelRows;
use crate::voronoi::g3_islands::IslandSearch;
use crate::voronoi::g6_triangles::TextureScan;
use crate::voronoi::mesh_reply::MeshReply;
use crate::voronoi::rejection::Rejection;
use crate::voronoi::texture_request::TextureRequest;

/// Buffers that [`triangulate`] reuses from leaf to leaf. Each thread has its own.
#[derive(Default)]
pub struct PipelineBuffers {
    request: TextureRequest,
    texture: SiteTexture,
    labels: LabelRows,
    scan: TextureScan,
    closed: ClosedMesh,
    islands: IslandSearch,
    shift: ShiftRepair,
    flips: FlipQueue,
    acceptance: AcceptanceCheck,
    mesh: HalfEdgeMesh,
    /// The sites of a leaf whose mesh a device has made, with one more entry for the vertex at infinity.
    sites: Vec<Site>,
}

impl PipelineBuffers {
    /// Returns buffers for textures as `request` says, where this thread computes the diagrams. The mesh is the same with any.
    pub fn with_texture(request: TextureRequest) -> PipelineBuffers {
        PipelineBuffers { request, ..PipelineBuffers::default() }
    }

    /// Takes back a mesh that is no longer needed, so that the next leaf uses its memory.
    pub fn recycle(&mut self, mesh: HalfEdgeMesh) {
        self.mesh = mesh;
    }
}

/// Computes the canonical Delaunay triangulation of distinct `sites`. The corners of the mesh are positions in `sites`. Any order of
/// the sites will do, but an order in which neighbours are close, such as rows from the south, saves cache misses.
///
/// # Errors
/// [`Rejection`] if the pipeline does not suit the sites. It never returns a wrong mesh.
pub fn triangulate(sites: &[Site], buffers: &mut PipelineBuffers) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
    check_size(sites)?;
    let PipelineBuffers { request, texture, labels, scan, closed, islands, shift, flips, acceptance, mesh, .. } =
        buffers;
    let mut counts = PipelineCounts { sites: sites.len() as u64, ..PipelineCounts::default() };
    let mut timer = StepTimer::start();
    shift.reset(sites.len());
    flips.reset(sites.len());

    texture.write(sites, request, &mut counts)?;
    // The scan computes each row of labels when it needs it.
    labels.start(texture);
    timer.finish(&mut counts, 0);
    scan.run(texture, labels, closed, shift, flips)?;
    counts.inverted = shift.inverted.len() as u64;
    timer.finish(&mut counts, 1);
    islands.remove(closed, &texture.sites, texture.placed, shift, &mut counts)?;
    timer.finish(&mut counts, 2);

    let mut completion = Completion { closed, sites: &texture.sites, shift, flips, counts, timer };
    completion.repair()?;
    completion.insert(texture.missing(), |pixel| scan.start_near(pixel))?;
    let counts = completion.prove(Some(&texture.order), acceptance, mesh)?;
    Ok((std::mem::take(mesh), counts))
}

/// As [`triangulate`], but from a device's mesh if `reply` has one that suits.
///
/// # Errors
/// As [`triangulate`].
pub fn triangulate_with(
    sites: &[Site],
    reply: &MeshReply,
    buffers: &mut PipelineBuffers,
) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
    if let MeshReply::Made(made) = reply
        && let Ok(done) = from_device(sites, &made.lend(), buffers)
    {
        return Ok(done);
    }
    triangulate(sites, buffers)
}

/// As [`triangulate`], from the mesh that a device has made. The device need not be trusted: its mesh may be anything.
///
/// # Errors
/// [`Rejection`] if the device's mesh does not suit. [`triangulate`] may succeed nonetheless.
pub fn from_device(
    sites: &[Site],
    made: &DeviceMesh,
    buffers: &mut PipelineBuffers,
) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
    check_size(sites)?;
    let PipelineBuffers { closed, shift, flips, acceptance, mesh, sites: vertices, .. } = buffers;
    let mut counts = PipelineCounts { on_gpu: 1, sites: sites.len() as u64, ..PipelineCounts::default() };
    let mut timer = StepTimer::start();
    shift.reset(sites.len());
    flips.reset(sites.len());

    copy_sites(sites, vertices)?;
    counts.missing = made.load(vertices, closed, shift)? as u64;
    counts.inverted = shift.inverted.len() as u64;
    timer.finish(&mut counts, 1);

    let mut completion = Completion { closed, sites: vertices, shift, flips, counts, timer };
    completion.repair()?;
    completion.insert(made.missing(sites), |block| made.start_near(block))?;
    let counts = completion.prove(None, acceptance, mesh)?;
    Ok((std::mem::take(mesh), counts))
}

fn check_size(sites: &[Site]) -> Result<(), Rejection> {
    match sites.len() {
        0..3 => Err(Rejection::TooFew),
        n if n > 1 << 26 => Err(Rejection::TooMany),
        _ => Ok(()),
    }
}
