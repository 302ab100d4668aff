//! Step 3, once for each tile: triangulates the sites of a leaf, and stores the triangles that are final and the frontier.

use crate::index::TileIndex;
use crate::merge_records::{Frontier, HullCount, Seam};
use crate::mesh::final_triangles::{FinalTriangles, TriangleState, find_final};
use crate::mesh::hull_flow::{NodeFlows, NodeMesh, flows_of_leaf};
use crate::mesh::hull_rule::HullRule;
use crate::mesh::precision_limit::PrecisionLimit;
use crate::mesh::sites::load_sites;
use crate::partition::point_file::PointFiles;
use crate::partition::result::Partition;
use crate::plan::job_plan::Plan;
use crate::records::{BorderVertex, Leaf, PartialNormals, Store};
use bytemuck::Zeroable;
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::{HalfEdgeIndex, SiteIndex};
use delaunay::triangulation;
use delaunay::triangulation::TriangulationCounts;
use delaunay_gpu::triangulator::Triangulator;
use lattice::VertexDigest;
use points::Point;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use tiles::normals;
use tiles::normals::NormalSum;

/// The figures of one leaf, or the sum over all.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LeafStats {
    /// Distinct sites.
    pub sites: u64,
    /// Points that were dropped because another has the same x and y.
    pub duplicates: u64,
    /// Triangles that leaves made final.
    pub triangles: u64,
    /// The digest of the sites with their heights.
    pub vertices: VertexDigest,
    /// The lattice box of the sites; `None` without any, and in the report.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounds: Option<Bounds<3>>,
    /// How the leaves were triangulated.
    pub outcome: TriangulationCounts,
}

impl AddAssign for LeafStats {
    fn add_assign(&mut self, other: LeafStats) {
        self.sites += other.sites;
        self.duplicates += other.duplicates;
        self.triangles += other.triangles;
        self.vertices = self.vertices.join(other.vertices);
        self.bounds = [self.bounds, other.bounds].into_iter().flatten().reduce(Bounds::union);
        self.outcome += other.outcome;
    }
}

/// Triangulates the sites of `tile` and stores them with the final triangles and the frontier.
///
/// # Errors
/// [`sys::Error::Io`] on the point file or the store, [`crate::Error::TooFine`] if a triangle is too long to be written,
/// [`sys::Error::Broken`] if the triangulation fails.
pub fn triangulate_leaf(
    plan: &Plan,
    partition: &Partition,
    points: &PointFiles,
    store: &Store,
    triangulator: &Triangulator,
    tile: TileIndex,
) -> crate::Result<LeafStats> {
    let (points, duplicates) = load_sites(points, &partition.blocks[tile.get()], plan.options.input.duplicates, None)?;
    let sites: Vec<Site> = points.iter().map(|p| p.position).collect();
    let (mesh, outcome) = triangulator.triangulate(&sites)?;
    let node = partition.tree.leaf(tile);
    let cell = partition.tree.node(node).cell.with_border();
    let found = find_final(&mesh, &sites, cell.as_ref(), |_| false);
    check_precision(&mesh, &sites, &found.states, PrecisionLimit::of(&plan.frame))?;
    let normals = partial_normals(&mesh, &found, &points);
    let corners = mesh.corners().iter().zip(&found.states);
    let triangles = corners.map(|(triangle, state)| (*triangle, *state == TriangleState::Final));
    let triangles = Leaf::save(store, tile, &points, triangles)?;
    let vertex = |&site: &SiteIndex| BorderVertex { tile, site, position: points[site.get()].corner() };
    let is_root = cell.is_none();
    let node_mesh = NodeMesh { mesh: &mesh, sites: &sites, found: &found, rule: HullRule::of(plan)?, is_root };
    let NodeFlows { passes, questions, trimmed, slivers } = flows_of_leaf(&node_mesh, tile)?;
    let border = found.frontier.iter().map(vertex).collect();
    let frontier = Frontier { sites: border, boundary: found.boundary, passes, questions, triangles };
    normals.save(store, tile)?;
    frontier.save(store, node)?;
    if is_root {
        // No merge answers what this tile asks.
        Seam::new(0, |_| [BorderVertex::zeroed(); 3], trimmed, HullCount { slivers, triangles }).save(store, node)?;
    }
    triangulation::recycle(mesh);
    let vertices = VertexDigest::of(points.iter().map(Point::corner));
    let bounds = Bounds::of_points(points.iter().map(Point::corner));
    Ok(LeafStats { sites: sites.len() as u64, duplicates, triangles, vertices, bounds, outcome })
}

/// Checks that single precision can hold all final triangles.
fn check_precision(
    mesh: &HalfEdgeMesh,
    sites: &[Site],
    states: &[TriangleState],
    limit: PrecisionLimit,
) -> crate::Result<()> {
    if limit.holds_all(sites) {
        return Ok(());
    }
    let mut final_ones = mesh.triangles.iter().zip(states).filter(|(_, state)| **state == TriangleState::Final);
    final_ones.try_for_each(|(corners, _)| limit.check(corners.map(|v| sites[v.get()])))
}

/// Returns what the leaf knows of the normals on its frontier. The seams add their triangles when all of them are known.
fn partial_normals(mesh: &HalfEdgeMesh, found: &FinalTriangles, points: &[Point]) -> PartialNormals {
    let sites = || found.frontier.iter().map(|&site| &points[site.get()]);
    PartialNormals {
        sums: found.half_edges.iter().map(|&start| final_normals_around(mesh, found, points, start)).collect(),
        rgb: sites().map(|point| point.rgb).collect(),
        class: sites().map(|point| point.class).collect(),
        intensity: if sites().any(|point| point.intensity != 0) {
            sites().map(|point| point.intensity).collect()
        } else {
            Vec::new()
        },
    }
}

/// Returns the sum of the normals of the final triangles around the origin of half-edge `start`.
fn final_normals_around(
    mesh: &HalfEdgeMesh,
    found: &FinalTriangles,
    points: &[Point],
    start: Option<HalfEdgeIndex>,
) -> NormalSum {
    let around = start.into_iter().flat_map(|start| mesh.around(start));
    let final_ones = around.filter(|&t| found.states[t] == TriangleState::Final);
    let corners = final_ones.map(|t| mesh.triangles[t].map(|v| points[v.get()].corner()));
    corners.map(|[a, b, c]| normals::cross(a, b, c)).fold([0; 3], normals::add)
}
