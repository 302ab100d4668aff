//! A terrain with fewer triangles, to be seen from afar: the Delaunay triangulation of some of its vertices, within its boundary.
//!
//! All vertices and edges of the boundary stay. The edges are edges of the triangulation of all sites of the job, and such an edge is
//! also an edge of the Delaunay triangulation of any subset that has both its ends, because its empty circle stays empty. So two
//! terrains that meet along a part of their boundaries still meet there when either or both of them are simplified, the triangles
//! cover the same ground once, as before, and the program's own pipeline makes them.
//!
//! Inside, one of every cell of a coarse grid stays, and then in a few rounds those vertices that the triangulation is furthest from
//! (`refine.rs`). At the end the heights of all inner vertices are moved to where they are nearest to the terrain around (`fit.rs`).
//! Vertices on the boundary keep their own heights, or terrains would not meet. So do vertices of breaklines: see `kept_lines.rs`.

#[cfg(test)]
mod tests;

use crate::frame::Frame;
pub use crate::lod::filling::CoarseMesh;
use crate::lod::filling::Filling;
use crate::lod::fit::fit;
use crate::lod::kept_lines::KeptLines;
use crate::lod::refine::{Places, refine};
use crate::lod::vertical_error::vertical_error;
use breaklines::Breaklines;
use delaunay::geometry::Bounds;
use delaunay::geometry::square_grid::SquareGrid;
use sys::{Result, interrupt};

/// A terrain to be simplified: a part of a Delaunay triangulation.
pub struct Terrain<'a> {
    /// The lattice integers x, y, z of every vertex. Each is the corner of a triangle.
    pub positions: &'a [[i32; 3]],
    /// The triangles, counterclockwise seen from above. They cover their ground once.
    pub triangles: &'a [[u32; 3]],
    /// What may be on the boundary, if that is known.
    pub may_be_on_boundary: Option<NearBoundary<'a>>,
}

/// The surroundings of the boundary of a terrain.
#[derive(Clone, Copy)]
pub struct NearBoundary<'a> {
    /// Whether a vertex may be on the boundary.
    pub vertices: &'a [bool],
    /// The numbers of the triangles that have such a vertex.
    pub triangles: &'a [u32],
}

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// The triangles between some of the vertices.
    pub mesh: CoarseMesh,
    /// The greatest vertical distance to the original in metres.
    pub greatest_error: f64,
    /// The mean vertical distance to the vertices of the original in metres.
    pub typical_error: f64,
    /// The distance in metres between vertices inside.
    pub spacing: f64,
}

/// Vertices that stay inside for each triangle that is wanted, at least, however many vertices the boundary has.
const LEAST_INSIDE: f64 = 1.0 / 16.0;

/// One of this many vertices is looked at for the place of the grid.
const LOOKED_AT: usize = 8;

/// The share of the inner vertices that the grid chooses. A larger share leaves too few for the places that need them, a smaller one takes
/// more rounds.
const BY_GRID: f64 = 0.3;

/// Pieces of lines are at most this many times longer than vertices are apart. Longer ones would take too much room.
const PIECES_TO_SPACING: f64 = 2.0;

/// The part of the vertices that the grid need not reach on each side. Those are the ends of long triangles along the hull, or few
/// enough for the outermost cells.
const BEYOND_GRID: usize = 200;

/// Simplifies `terrain` to about `triangles` triangles. The result has more if the boundary has too
/// many edges. Up to half of the vertices inside are those of breaklines, if there are `lines`.
///
/// # Errors
/// [`sys::Error::Broken`] if the boundary is not that of a part of a Delaunay triangulation, [`sys::Error::Interrupted`].
pub fn simplify(frame: &Frame, terrain: &Terrain, triangles: usize, lines: Option<&Breaklines>) -> Result<Simplified> {
    let boundary = Boundary::of(terrain);
    let positions = terrain.positions;
    let inside = positions.len() - boundary.vertices;
    let least = (triangles as f64 * LEAST_INSIDE) as usize;
    let wanted = (triangles / 2).saturating_sub(boundary.vertices / 2).max(least).min(inside);
    if wanted >= inside {
        let vertices = (0..positions.len() as u32).collect();
        let mesh = CoarseMesh { vertices, positions: positions.to_vec(), triangles: terrain.triangles.to_vec() };
        return Ok(Simplified { mesh, greatest_error: 0.0, typical_error: 0.0, spacing: 0.0 });
    }
    let [xy, up] = frame.resolution_metres();
    let mut kept = boundary.on.clone();
    let bounds = most_of(positions).unwrap_or(Bounds::of_point([0; 2]));
    let longest = PIECES_TO_SPACING * side_of(bounds, wanted);
    let kept_lines = KeptLines::choose(lines, positions, &boundary.on, wanted / 2, longest);
    kept_lines.vertices.iter().for_each(|&v| kept[v] = true);
    let by_grid = ((wanted - kept_lines.vertices.len()) as f64 * BY_GRID) as usize;
    keep_by_grid(positions, bounds, by_grid, &kept_lines, &mut kept);
    interrupt::check()?;
    let mut filling = Filling::new(positions, &kept, &boundary.edges)?;
    let mut places = Places::new(positions, &filling);
    let all = boundary.vertices + wanted;
    refine(positions, &mut kept, |v| kept_lines.allows(v), &mut filling, &mut places, all)?;
    let mut fixed = boundary.on.clone();
    kept_lines.vertices.iter().for_each(|&v| fixed[v] = true);
    let side = side_of(bounds, filling.vertices.len() - boundary.vertices);
    let typical_error = fit(positions, |v| fixed[v as usize], &mut filling, &mut places)? * up;
    let mesh = filling.into_coarse();
    interrupt::check()?;
    let greatest_error = vertical_error(positions, terrain.triangles, &mesh) * up;
    Ok(Simplified { mesh, greatest_error, typical_error, spacing: side * xy })
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
    fn of(terrain: &Terrain) -> Boundary {
        let sides_of = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let sides: Vec<[u32; 2]> = match terrain.may_be_on_boundary {
            Some(NearBoundary { vertices, triangles }) => {
                let sides = triangles.iter().flat_map(|&t| sides_of(&terrain.triangles[t as usize]));
                sides.filter(|side| side.iter().all(|&v| vertices[v as usize])).collect()
            }
            None => terrain.triangles.iter().flat_map(sides_of).collect(),
        };
        let mut known = sides.clone();
        known.sort_unstable();
        let edges: Vec<_> = sides.into_iter().filter(|&[a, b]| known.binary_search(&[b, a]).is_err()).collect();
        let mut on = vec![false; terrain.positions.len()];
        edges.as_flattened().iter().for_each(|&v| on[v as usize] = true);
        let vertices = on.iter().filter(|&&on| on).count();
        Boundary { edges, on, vertices }
    }
}

/// Keeps one vertex of `positions` in each cell of a grid with about `cells` cells within `bounds`: the one nearest to the middle of the
/// cell.
fn keep_by_grid(positions: &[[i32; 3]], bounds: Bounds<2>, cells: usize, lines: &KeptLines, kept: &mut [bool]) {
    if cells == 0 {
        return;
    }
    let grid = SquareGrid::new(bounds, side_of(bounds, cells), cells as f64);
    let cell_of = grid.cells_of(positions);
    // The distance from the middle in the upper half of the bits, the vertex in the lower one.
    let mut nearest = vec![u64::MAX; grid.cells()];
    let vertices = (0..).zip(positions.iter().zip(&cell_of));
    let is_free = |v: usize| !kept[v] && lines.allows(v);
    for (v, (p, &cell)) in vertices.filter(|(v, _)| is_free(*v as usize)) {
        let nearest = &mut nearest[cell as usize];
        *nearest = (*nearest).min(u64::from(grid.distance_from_middle(p)) << 32 | v);
    }
    nearest.into_iter().filter(|nearest| *nearest != u64::MAX).for_each(|nearest| kept[nearest as u32 as usize] = true);
}

/// Returns the side of square cells of which `cells` have the area of the box.
fn side_of(bounds: Bounds<2>, cells: usize) -> f64 {
    let area = [0, 1].map(|axis| (bounds.extent(axis) + 1) as f64).iter().product::<f64>();
    (area / cells.max(1) as f64).sqrt()
}

/// Returns the box in the plane of those of `positions` that are looked at, without the outermost on each side.
fn most_of(positions: &[[i32; 3]]) -> Option<Bounds<2>> {
    let beyond = positions.len() / LOOKED_AT / BEYOND_GRID;
    let ends = |axis: usize| {
        let mut values: Vec<i32> = positions.iter().step_by(LOOKED_AT).map(|p| p[axis]).collect();
        let last = values.len().checked_sub(beyond + 1)?;
        let low = *values.select_nth_unstable(beyond).1;
        Some([low, *values.select_nth_unstable(last).1])
    };
    let [x, y] = [ends(0)?, ends(1)?];
    Some(Bounds { min: [x[0], y[0]], max: [x[1], y[1]] })
}
