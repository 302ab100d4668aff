//! Step 4 of a job, by merge node of the tree: triangulate what the nodes below still need, discard what covers ground
//! that is closed below, and close what can be closed now. What closes here are the seams.

use crate::geometry::Site;
use crate::job::durable::journal::Done;
use crate::job::durable::store::Store;
use crate::job::mesh::final_triangles::{State, close};
use crate::job::mesh::precision_limit::Longest;
use crate::job::partition::tree::Tree;
use crate::job::records::{Frontier, Rim, Seam, SeamTriangle};
use crate::mesh::region::covered;
use crate::triangulation::reference;
use crate::{Error, Result};

/// Bytes that merging one frontier site takes at the peak: `spade`, the mesh and the marks.
const BYTES_PER_SITE: u64 = 600;

/// Merges the frontiers below merge node `node`, which must be in the store; returns the tiles that it settles: those it hands
/// no site of up, though it was handed some.
///
/// # Errors
/// [`Error::Memory`] if the frontiers do not fit `memory` bytes, [`Error::TooFine`] if a triangle is too long to be
/// written, [`Error::Io`] on the store, [`Error::Broken`] if the frontiers contradict each other.
pub fn run(store: &Store, tree: &Tree, node: usize, memory: u64, longest: Longest) -> Result<Done<Vec<u32>>> {
    let union = join(store, &tree.merged_by(node))?;
    check_memory(union.sites.len(), memory)?;
    let sites: Vec<Site> = union.sites.iter().map(Rim::plane).collect();
    let mesh = reference::triangulate(&sites)?;
    let covered = covered(&mesh, &union.boundary)?;
    let cell = tree.nodes[node].parent.map(|_| &tree.nodes[node].cell);
    let closing = close(&mesh, &sites, cell, |triangle| covered[triangle]);
    let seam: Vec<SeamTriangle> = mesh
        .triangles
        .iter()
        .zip(&closing.states)
        .filter(|(_, state)| **state == State::Closed)
        .map(|(corners, _)| corners.map(|v| union.sites[v as usize]))
        .collect();
    seam.iter().try_for_each(|corners| longest.check(corners.map(|corner| corner.plane())))?;
    let frontier = closing.frontier.iter().map(|&site| union.sites[site as usize]).collect();
    let frontier = Frontier { sites: frontier, boundary: closing.boundary };
    let stored = vec![Seam::new(&seam).save(store, node)?, frontier.save(store, node)?];
    let above = frontier.tiles();
    let settled = union.tiles().into_iter().filter(|tile| above.binary_search(tile).is_err());
    Ok(Done::new(settled.collect(), stored))
}

/// The frontiers of `nodes` as one.
fn join(store: &Store, nodes: &[usize]) -> Result<Frontier> {
    let mut union = Frontier::default();
    for &node in nodes {
        let Frontier { sites, boundary } = Frontier::load(store, node)?;
        let offset = union.sites.len() as u32;
        union.sites.extend(sites);
        union.boundary.extend(boundary.iter().map(|edge| edge.map(|v| v + offset)));
    }
    Ok(union)
}

fn check_memory(sites: usize, memory: u64) -> Result<()> {
    let needed = sites as u64 * BYTES_PER_SITE;
    if needed <= memory {
        return Ok(());
    }
    Err(Error::Memory(format!(
        "{sites} sites lie on circles or triangles that no tile can decide alone, and joining them takes about {} MiB; \
         raise [limits] memory",
        needed >> 20
    )))
}
