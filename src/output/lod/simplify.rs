//! A terrain with fewer triangles, for looking at from afar: the Delaunay triangulation of some of its vertices, within its outline.
//!
//! All vertices of the outline stay, and so do its edges: they are edges of the triangulation of all sites of the job, and an edge of
//! a Delaunay triangulation is one of that of any subset that has both its ends, because its empty circle stays empty. So two terrains
//! that meet along a part of their outlines still meet there when both, or either of them, are simplified; the triangles cover the
//! same ground once, as before; and it is the program's own pipeline that makes them.
//!
//! Which vertices stay inside: first one of every cell of a grid, that of the most ordinary height; then, where the triangulation of
//! these is furthest off the terrain, the vertex that it is furthest off (Garland and Heckbert 1995, "Fast polygonal approximation
//! of terrains and height fields", here with all of them inserted at once).

#[cfg(test)]
mod tests;

use crate::geometry::Site;
use crate::mesh::index::SiteIndex;
use crate::mesh::region::covered;
use crate::output::Tile;
use crate::output::frame::Frame;
use crate::output::lod::boundary::on_outline;
use crate::output::lod::vertical_error::{Sieve, deviation};
use crate::triangulation::{self, canonical};
use crate::{Error, Result};
use std::collections::HashSet;

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// Its vertices are some of the original's, in their order.
    pub tile: Tile,
    /// The greatest vertical distance to the original, metres.
    pub error: f64,
}

/// However many vertices the outline has, there are at least this many for each triangle that is wanted inside.
const LEAST_INSIDE: f64 = 1.0 / 16.0;
/// One vertex of so many is looked at for the one that a triangle is furthest off.
const LOOKED_AT: usize = 8;
/// The share of the vertices inside that a grid chooses.
const BY_GRID: f64 = 0.6;

/// `tile`, a part of a Delaunay triangulation, with about so many `triangles`; with more where its outline has too many.
///
/// # Errors
/// [`Error::Broken`] if its outline is not that of a part of a Delaunay triangulation.
pub fn simplify(frame: &Frame, tile: &Tile, triangles: usize) -> Result<Simplified> {
    let outline = Outline::of(tile);
    let inside = tile.positions.len() - outline.vertices;
    let least = (triangles as f64 * LEAST_INSIDE) as usize;
    let wanted = (triangles / 2).saturating_sub(outline.vertices / 2).max(least).min(inside);
    let (mut kept, mut coarse) = (outline.on.clone(), tile.triangles.clone());
    if wanted < inside {
        let by_grid = (wanted as f64 * BY_GRID) as usize;
        keep_by_grid(tile, by_grid, &mut kept);
        coarse = outline.fill(tile, &kept)?;
        let rest = (outline.vertices + wanted).saturating_sub(kept.iter().filter(|&&kept| kept).count());
        if keep_furthest(tile, &coarse, rest, &mut kept) > 0 {
            coarse = outline.fill(tile, &kept)?;
        }
    }
    let error = deviation(&tile.positions, &tile.triangles, &coarse) * frame.resolution_metres()[1];
    Ok(Simplified { tile: tile.subset(coarse), error })
}

/// The edges round a terrain.
struct Outline {
    /// The directed edges that have the terrain on their left and nothing on their right.
    edges: Vec<[u32; 2]>,
    /// Whether a vertex is on one of them.
    on: Vec<bool>,
    /// How many are.
    vertices: usize,
}

impl Outline {
    fn of(tile: &Tile) -> Outline {
        let on = on_outline(tile.positions.len(), &tile.triangles);
        let between = |&[a, b]: &[u32; 2]| on[a as usize] && on[b as usize];
        let sides = tile.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(between);
        let sides: Vec<[u32; 2]> = sides.collect();
        let known: HashSet<[u32; 2]> = sides.iter().copied().collect();
        let edges = sides.into_iter().filter(|&[a, b]| !known.contains(&[b, a])).collect();
        let vertices = on.iter().filter(|&&on| on).count();
        Outline { edges, on, vertices }
    }

    /// The triangulation of the vertices `kept`, within the outline.
    fn fill(&self, tile: &Tile, kept: &[bool]) -> Result<Vec<[u32; 3]>> {
        let vertices: Vec<u32> = (0..).zip(kept).filter(|(_, kept)| **kept).map(|(v, _)| v).collect();
        let mut number = vec![SiteIndex(u32::MAX); kept.len()];
        vertices.iter().zip(0..).for_each(|(&v, n)| number[v as usize] = SiteIndex(n));
        let sites: Vec<Site> = vertices.iter().map(|&v| plane(tile.positions[v as usize])).collect();
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

fn plane(point: [i32; 3]) -> Site {
    [point[0], point[1]]
}

/// Keeps of each cell of a grid with about `cells` cells the vertex whose height is nearest to the mean of the cell's.
fn keep_by_grid(tile: &Tile, cells: usize, kept: &mut [bool]) {
    let Some([low, high]) = tile.bounds().filter(|_| cells > 0) else { return };
    let size = [0, 1].map(|k| high[k] as f64 - low[k] as f64 + 1.0);
    let side = (size[0] * size[1] / cells as f64).sqrt();
    let [columns, rows] = size.map(|size| (size / side).ceil().clamp(1.0, cells as f64) as usize);
    let cell = |p: &[i32; 3]| {
        let [column, row] = [0, 1].map(|k| ((p[k] as f64 - low[k] as f64) / side) as usize);
        row.min(rows - 1) * columns + column.min(columns - 1)
    };
    let mut sums = vec![(0i64, 0i64); columns * rows];
    for p in &tile.positions {
        let sum = &mut sums[cell(p)];
        *sum = (sum.0 + p[2] as i64, sum.1 + 1);
    }
    let mut nearest = vec![(i64::MAX, u32::MAX); columns * rows];
    for (v, p) in (0..).zip(&tile.positions) {
        let at = cell(p);
        let (sum, count) = sums[at];
        nearest[at] = nearest[at].min(((p[2] as i64 - sum / count).abs(), v));
    }
    nearest.iter().filter(|(_, v)| *v != u32::MAX).for_each(|&(_, v)| kept[v as usize] = true);
}

/// Keeps of the triangles of `coarse` that are furthest off the terrain the vertex that each is furthest off, `count` at the most; how
/// many.
fn keep_furthest(tile: &Tile, coarse: &[[u32; 3]], count: usize, kept: &mut [bool]) -> usize {
    let mut furthest: Vec<(u64, u32)> = Sieve::new(&tile.positions, LOOKED_AT).furthest(coarse).collect();
    if furthest.len() > count {
        // Distances are not negative, so their bits are in their order.
        furthest.sort_unstable_by(|a, b| b.cmp(a));
        furthest.truncate(count);
    }
    furthest.iter().for_each(|&(_, v)| kept[v as usize] = true);
    furthest.len()
}
