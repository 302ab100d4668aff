//! Step 4, once for each merge node of the tree: triangulates what the nodes below left pending, discards what covers ground that is
//! final already, and finds the triangles that are final now. These are the seam.

use crate::index::{NodeIndex, TileIndex};
use crate::merge_records::{FlowQuestion, Frontier, HullCount, Seam, tiles_of};
use crate::mesh::final_triangles::{TriangleState, find_final};
use crate::mesh::hull_flow::{FlowsBelow, NodeMesh, flows_of_merge};
use crate::mesh::hull_rule::HullRule;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::partition::tree::Cell;
use crate::plan::budget::BYTES_PER_MERGED_SITE;
use crate::plan::job_plan::Plan;
use crate::records::{BorderVertex, SeamTriangle, Store};
use delaunay::geometry::Site;
use delaunay::mesh::region::covered;
use delaunay::triangulation::divide_and_conquer;
use sys::{Error, Result, interrupt};

/// Merges the frontiers `below` of merge node `node`, which decides `cell`. Returns the tiles that this finishes: those that have sites
/// in a frontier below, and none in the frontier that goes up.
///
/// # Errors
/// [`Error::Memory`] if the frontiers do not fit `memory` bytes, [`crate::Error::TooFine`] if a triangle is too long to be written,
/// [`Error::Io`] on the store, [`Error::Broken`] if the frontiers contradict each other.
pub fn merge_frontiers(
    plan: &Plan,
    cell: Cell,
    below: &[(&Store, NodeIndex)],
    store: &Store,
    memory: u64,
    node: NodeIndex,
) -> crate::Result<Vec<TileIndex>> {
    let sites = below.iter().map(|&(store, child)| Frontier::count(store, child)).sum::<Result<u64>>()?;
    check_memory(sites, memory)?;
    let (union, flows_below) = join(below, sites)?;
    let sites: Vec<Site> = union.iter().map(BorderVertex::plane).collect();
    let mesh = divide_and_conquer::triangulate(&sites).map_err(|e| Error::of_triangulation(e.is_stopped(), e))?;
    interrupt::check()?;
    let covered = covered(&mesh, bytemuck::cast_slice(&flows_below.boundary))
        .map_err(|e| Error::of_triangulation(e.is_stopped(), e))?;
    interrupt::check()?;
    let cell = cell.with_border();
    let found = find_final(&mesh, &sites, cell.as_ref(), |triangle| covered[triangle]);
    interrupt::check()?;
    let node_mesh =
        NodeMesh { mesh: &mesh, sites: &sites, found: &found, rule: HullRule::of(plan)?, is_root: cell.is_none() };
    let flows = flows_of_merge(&node_mesh, &flows_below, |corners| corners.map(|v| union[v.get()].tile))?;
    // The seam takes as much memory as the mesh, which goes first.
    let mut seam = mesh.triangles;
    let mut states = found.states.iter();
    seam.retain(|_| states.next() == Some(&TriangleState::Final));
    drop((mesh.twins, sites, covered));
    let seam_triangle = |at: u32| -> SeamTriangle { seam[at as usize].map(|v| union[v.get()]) };
    let (limit, count) = (PrecisionLimit::of(&plan.frame), seam.len() as u32);
    (0..count).try_for_each(|at| limit.check(seam_triangle(at).map(|corner| corner.plane())))?;
    let hull = HullCount { slivers: flows.slivers, triangles: flows_below.triangles + u64::from(count) };
    let frontier = Frontier {
        sites: found.frontier.iter().map(|&site| union[site.get()]).collect(),
        boundary: found.boundary,
        passes: flows.passes,
        questions: flows.questions,
        triangles: hull.triangles,
    };
    interrupt::check()?;
    Seam::new(count, seam_triangle, flows.trimmed, hull).save(store, node)?;
    frontier.save(store, node)?;
    let above = frontier.tiles();
    let tiles_below = tiles_of(&union, &flows_below.questions);
    Ok(tiles_below.into_iter().filter(|tile| above.binary_search(tile).is_err()).collect())
}

/// Joins frontiers of at most `sites` sites into one. Their boundaries, and what they say of ways to the hull, come apart from their sites.
fn join(frontiers: &[(&Store, NodeIndex)], sites: u64) -> Result<(Vec<BorderVertex>, FlowsBelow)> {
    let (mut all, mut flows) = (Vec::with_capacity(sites as usize), FlowsBelow::default());
    for &(store, node) in frontiers {
        let Frontier { sites, boundary, passes, questions, triangles } = Frontier::load(store, node)?;
        let (vertex, edge) = (all.len() as u32, flows.boundary.len() as u32);
        all.extend(sites);
        flows.boundary.extend(boundary.iter().map(|ends| ends.map(|v| v + vertex)));
        flows.passes.extend(passes.iter().map(|pass| pass.map(|at| at + edge)));
        flows.questions.extend(questions.iter().map(|asked| FlowQuestion { exit: asked.exit + edge, ..*asked }));
        flows.triangles += triangles;
    }
    Ok((all, flows))
}

fn check_memory(sites: u64, memory: u64) -> Result<()> {
    let needed = sites * BYTES_PER_MERGED_SITE;
    if needed <= memory {
        return Ok(());
    }
    Err(Error::Memory(format!("joining {sites} sites takes about {} MiB; raise [limits] memory", needed >> 20)))
}
