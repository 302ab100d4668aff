//! Step 4 of a job, by inner node of the tree: triangulate what the two children still need, discard what covers ground
//! that is closed below, and close what can be closed now. What closes here are the seams.

use super::closing::{State, close, covered};
use super::directory::Directory;
use super::journal::Done;
use super::records::{Frontier, Rim, Seam, SeamTriangle};
use super::span::Longest;
use super::tree::{Kind, Tree};
use crate::geometry::Site;
use crate::triangulation::reference;
use crate::{Error, Result};

/// Bytes that merging one frontier site takes at the peak: `spade`, the mesh and the marks.
const BYTES_PER_SITE: u64 = 600;

/// Merges the children of inner node `node`, whose own results must be in the job directory; returns the number of seam
/// triangles.
///
/// # Errors
/// [`Error::Memory`] if the frontiers do not fit `memory` bytes, [`Error::TooFine`] if a triangle is too long to be written, [`Error::Io`] on the job directory, [`Error::Broken`] if the
/// children contradict each other.
pub fn run(directory: &Directory, tree: &Tree, node: usize, memory: u64, longest: Longest) -> Result<Done<u64>> {
    let Kind::Inner(children) = tree.nodes[node].kind else {
        return Err(Error::Broken(format!("node {node} of the tree is a leaf and has nothing to merge")));
    };
    let union = join(Frontier::load(directory, children[0])?, Frontier::load(directory, children[1])?);
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
    let files = vec![Seam::new(&seam).save(directory, node)?, frontier.save(directory, node)?];
    Ok(Done::new(seam.len() as u64, files))
}

fn join(mut low: Frontier, high: Frontier) -> Frontier {
    let offset = low.sites.len() as u32;
    low.sites.extend(high.sites);
    low.boundary.extend(high.boundary.iter().map(|edge| edge.map(|v| v + offset)));
    low
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
