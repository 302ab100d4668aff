//! A terrain with fewer triangles, to be seen from afar: the Delaunay triangulation of some of its vertices, within its boundary.
//!
//! All vertices and edges of the boundary stay. The edges are edges of the triangulation of all sites of the job, and such an edge is
//! also an edge of the Delaunay triangulation of any subset that has both its ends, because its empty circle stays empty. So two
//! terrains that meet along a part of their boundaries still meet there when either or both of them are simplified, the triangles
//! cover the same ground once, as before, and the program's own pipeline makes them.
//!
//! Inside, the vertices that stay are chosen in two passes. First, one vertex of every cell of a grid stays: the one whose height is
//! nearest to the mean of the cell. Then the triangulation of these is compared with the terrain: where a triangle is furthest from
//! it, the vertex with the greatest distance stays too (Garland and Heckbert 1995, "Fast polygonal approximation of terrains and
//! height fields", here with all vertices of a pass inserted at once).

#[cfg(test)]
mod tests;

use crate::geometry::square_grid::SquareGrid;
use crate::geometry::{Bounds, Site};
use crate::mesh::index::SiteIndex;
use crate::mesh::region::covered;
use crate::output::frame::Frame;
use crate::output::lod::boundary::on_boundary;
use crate::output::lod::vertex_cells::{VertexCells, plane};
use crate::output::lod::vertical_error::vertical_error;
use crate::output::tile::Tile;
use crate::triangulation::{self, canonical};
use crate::{Error, Result, interrupt};
use std::collections::HashSet;

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// Its vertices are some of the original's, in their order.
    pub tile: Tile,
    /// The greatest vertical distance to the original in metres.
    pub error: f64,
}

/// Vertices that stay inside for each triangle that is wanted, at least, however many vertices the boundary has.
const LEAST_INSIDE: f64 = 1.0 / 16.0;

/// The second pass looks at one of this many vertices.
const LOOKED_AT: usize = 8;

/// The share of the inner vertices that the first pass chooses.
const BY_GRID: f64 = 0.6;

/// Simplifies `tile`, a part of a Delaunay triangulation, to about `triangles` triangles. The result has more if the boundary has too
/// many edges.
///
/// # Errors
/// [`Error::Broken`] if the boundary is not that of a part of a Delaunay triangulation, [`Error::Interrupted`].
pub fn simplify(frame: &Frame, tile: &Tile, triangles: usize) -> Result<Simplified> {
    let boundary = Boundary::of(tile);
    let inside = tile.positions.len() - boundary.vertices;
    let least = (triangles as f64 * LEAST_INSIDE) as usize;
    let wanted = (triangles / 2).saturating_sub(boundary.vertices / 2).max(least).min(inside);
    if wanted >= inside {
        return Ok(Simplified { tile: tile.subset(tile.triangles.clone()), error: 0.0 });
    }
    let mut kept = boundary.on.clone();
    let by_grid = (wanted as f64 * BY_GRID) as usize;
    keep_by_grid(tile, by_grid, &mut kept);
    let mut coarse = boundary.fill(tile, &kept)?;
    let rest = (boundary.vertices + wanted).saturating_sub(kept.iter().filter(|&&kept| kept).count());
    if keep_furthest(tile, &coarse, rest, &mut kept) > 0 {
        coarse = boundary.fill(tile, &kept)?;
    }
    interrupt::check()?;
    let error = vertical_error(&tile.positions, &tile.triangles, &coarse) * frame.resolution_metres()[1];
    Ok(Simplified { tile: tile.subset(coarse), error })
}

/// The edges around a terrain.
struct Boundary {
    /// The directed edges with the terrain on their left and nothing on their right.
    edges: Vec<[u32; 2]>,
    /// Tells whether a vertex is on one of them.
    on: Vec<bool>,
    /// The number of vertices on them.
    vertices: usize,
}

impl Boundary {
    fn of(tile: &Tile) -> Boundary {
        let on = on_boundary(tile.positions.len(), &tile.triangles);
        let between = |&[a, b]: &[u32; 2]| on[a as usize] && on[b as usize];
        let sides = tile.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(between);
        let sides: Vec<[u32; 2]> = sides.collect();
        let known: HashSet<[u32; 2]> = sides.iter().copied().collect();
        let edges = sides.into_iter().filter(|&[a, b]| !known.contains(&[b, a])).collect();
        let vertices = on.iter().filter(|&&on| on).count();
        Boundary { edges, on, vertices }
    }

    /// Returns the triangulation of the vertices that are `kept`, within the boundary.
    fn fill(&self, tile: &Tile, kept: &[bool]) -> Result<Vec<[u32; 3]>> {
        let vertices: Vec<u32> = (0..).zip(kept).filter(|(_, kept)| **kept).map(|(v, _)| v).collect();
        let mut number = vec![SiteIndex(u32::MAX); kept.len()];
        vertices.iter().zip(0..).for_each(|(&v, n)| number[v as usize] = SiteIndex(n));
        let sites: Vec<Site> = vertices.iter().map(|&v| plane(tile.positions[v as usize])).collect();
        interrupt::check()?;
        let mesh = canonical(&sites)?;
        let edges: Vec<_> = self.edges.iter().map(|edge| edge.map(|v| number[v as usize])).collect();
        let covered = covered(&mesh, &edges)?;
        let inside = mesh.triangles.iter().zip(covered).filter(|(_, covered)| *covered);
        let triangles: Vec<_> = inside.map(|(t, _)| t.map(|v| vertices[v.get()])).collect();
        triangulation::recycle(mesh);
        if triangles.is_empty() {
            return Err(Error::Broken("a terrain without triangles cannot be simplified".into()));
        }
        Ok(triangles)
    }
}

/// Keeps one vertex in each cell of a grid with about `cells` cells: the one whose height is nearest to the mean height of the cell.
fn keep_by_grid(tile: &Tile, cells: usize, kept: &mut [bool]) {
    let Some(bounds) = Bounds::of_points(tile.positions.iter().map(|&p| plane(p))).filter(|_| cells > 0) else {
        return;
    };
    let area = [0, 1].map(|axis| (bounds.extent(axis) + 1) as f64).iter().product::<f64>();
    let grid = SquareGrid::new(bounds, (area / cells as f64).sqrt(), cells as f64);
    let mut sums = vec![(0i64, 0i64); grid.cells()];
    for p in &tile.positions {
        let sum = &mut sums[grid.cell(p[0], p[1])];
        *sum = (sum.0 + p[2] as i64, sum.1 + 1);
    }
    let mut nearest = vec![(i64::MAX, u32::MAX); grid.cells()];
    for (v, p) in (0..).zip(&tile.positions) {
        let at = grid.cell(p[0], p[1]);
        let (sum, count) = sums[at];
        nearest[at] = nearest[at].min(((p[2] as i64 - sum / count).abs(), v));
    }
    nearest.iter().filter(|(_, v)| *v != u32::MAX).for_each(|&(_, v)| kept[v as usize] = true);
}

/// Compares the triangles of `coarse` with the terrain and keeps the vertices with the greatest distances: one a triangle, `count` in
/// all at most. Returns the number of vertices kept.
fn keep_furthest(tile: &Tile, coarse: &[[u32; 3]], count: usize, kept: &mut [bool]) -> usize {
    let mut furthest: Vec<(u64, u32)> = VertexCells::new(&tile.positions, LOOKED_AT).furthest(coarse).collect();
    if furthest.len() > count {
        // Distances are not negative, so their bits are in the same order.
        furthest.sort_unstable_by(|a, b| b.cmp(a));
        furthest.truncate(count);
    }
    furthest.iter().for_each(|&(_, v)| kept[v as usize] = true);
    furthest.len()
}
