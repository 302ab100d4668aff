//! Step 3 of a job, by tile: triangulate the sites of one leaf and close what can be closed.

use crate::Result;
use crate::geometry::Site;
use crate::input::Point;
use crate::input::options::Duplicates;
use crate::job::durable::journal::Done;
use crate::job::durable::store::Store;
use crate::job::mesh::final_triangles::{Closing, State, close};
use crate::job::mesh::precision_limit::Longest;
use crate::job::mesh::sites;
use crate::job::partition::point_file::Spill;
use crate::job::partition::read::Partition;
use crate::job::records::{Frontier, Leaf, Rim, RimDraft};
use crate::mesh::half_edge::{HULL, HalfEdgeMesh};
use crate::output::normals::{self, NormalSum};
use crate::triangulation::{self, TriangulationCounts, Triangulator};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// What one leaf, or all of them, came to.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LeafFigures {
    /// Distinct sites.
    pub sites: u64,
    /// Points dropped because another has the same x and y.
    pub duplicates: u64,
    /// Triangles closed in leaves.
    pub triangles: u64,
    /// How the leaves were triangulated.
    pub outcome: TriangulationCounts,
}

impl AddAssign for LeafFigures {
    fn add_assign(&mut self, other: LeafFigures) {
        self.sites += other.sites;
        self.duplicates += other.duplicates;
        self.triangles += other.triangles;
        self.outcome += other.outcome;
    }
}

/// What the step needs to know of the configuration.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// Which of several points with the same x and y stays.
    pub duplicates: Duplicates,
    /// Who triangulates.
    pub triangulator: &'a Triangulator,
    /// How long a triangle may be.
    pub longest: Longest,
}

/// Triangulates leaf `tile` and leaves its sites, closed triangles and frontier in the store.
///
/// # Errors
/// [`crate::Error::Io`] on the spill or the store, [`crate::Error::TooFine`] if a triangle is too long to be written,
/// [`crate::Error::Broken`] if the triangulation fails.
pub fn run(
    store: &Store,
    partition: &Partition,
    spill: &Spill,
    tile: usize,
    task: Task<'_>,
) -> Result<Done<LeafFigures>> {
    let (points, dropped) = sites::load(spill, &partition.blocks[tile], task.duplicates)?;
    let sites: Vec<Site> = points.iter().map(|p| p.position).collect();
    let (mesh, outcome) = task.triangulator.triangulate(&sites)?;
    let node = partition.tree.leaves[tile];
    let is_root = partition.tree.nodes[node].parent.is_none();
    let cell = (!is_root).then_some(&partition.tree.nodes[node].cell);
    let closing = close(&mesh, &sites, cell, |_| false);
    check_spans(&mesh, &sites, &closing.states, task.longest)?;
    let draft = rim_draft(&mesh, &closing, &points);
    let closed = mesh.triangles.iter().zip(&closing.states).filter(|(_, state)| **state == State::Closed);
    let (leaf, triangles) = Leaf::save(store, tile, &points, closed.map(|(triangle, _)| *triangle))?;
    let rim = |&site: &u32| Rim { tile: tile as u32, site, position: points[site as usize].corner() };
    let frontier = Frontier { sites: closing.frontier.iter().map(rim).collect(), boundary: closing.boundary };
    let stored = vec![draft.save(store, tile)?, leaf, frontier.save(store, node)?];
    triangulation::recycle(mesh);
    Ok(Done::new(LeafFigures { sites: sites.len() as u64, duplicates: dropped, triangles, outcome }, stored))
}

fn check_spans(mesh: &HalfEdgeMesh, sites: &[Site], states: &[State], longest: Longest) -> Result<()> {
    if longest.holds_all(sites) {
        return Ok(());
    }
    let mut closed = mesh.triangles.iter().zip(states).filter(|(_, state)| **state == State::Closed);
    closed.try_for_each(|(corners, _)| longest.check(corners.map(|v| sites[v as usize])))
}

/// The frontier as far as the leaf knows it: the seams add their triangles to the normals when all are known.
fn rim_draft(mesh: &HalfEdgeMesh, closing: &Closing, points: &[Point]) -> RimDraft {
    let sites = || closing.frontier.iter().map(|&site| &points[site as usize]);
    RimDraft {
        sums: closing.spokes.iter().map(|&spoke| closed_around(mesh, closing, points, spoke)).collect(),
        rgb: sites().map(|point| point.rgb).collect(),
        class: sites().map(|point| point.class).collect(),
    }
}

/// The sum of normals over the closed triangles around the start of `spoke`.
fn closed_around(mesh: &HalfEdgeMesh, closing: &Closing, points: &[Point], spoke: u32) -> NormalSum {
    let around = (spoke != HULL).then(|| mesh.around(spoke)).into_iter().flatten();
    let closed = around.map(|t| t as usize).filter(|&t| closing.states[t] == State::Closed);
    let corners = closed.map(|t| mesh.triangles[t].map(|v| points[v as usize].corner()));
    corners.map(|[a, b, c]| normals::cross(a, b, c)).fold([0; 3], normals::add)
}
