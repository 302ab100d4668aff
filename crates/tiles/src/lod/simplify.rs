//! A terrain with fewer triangles, to be seen from afar: the Delaunay triangulation of some of its vertices.
//!
//! One of every cell of a coarse grid stays, and then in a few rounds the vertices at which the triangulation is worst (`refine.rs`).
//! At the end the heights are moved to where they are nearest to the terrain around (`fit.rs`). Vertices of breaklines keep their own:
//! see `kept_lines.rs`. This makes two meshes.
//!
//! - **What viewers get** has few vertices on the outline of the terrain (`outline.rs`). It covers all of the terrain and a little more, and its
//!   border hides what neighbours may do with theirs (`rim.rs`).
//! - **The working mesh** is what coarser terrains are made of. It takes in all other vertices on the outline too, with their own heights,
//!   and ends there. The edges of the outline are edges of the triangulation of all sites of the job, and such an edge is also
//!   an edge of the Delaunay triangulation of any subset that has both its ends, because its empty circle stays empty. So two terrains that
//!   meet along a part of their outlines still meet there, and together they cover their ground once.

#[cfg(test)]
mod tests;

use crate::frame::Frame;
use crate::lod::covering::covering;
pub use crate::lod::filling::CoarseMesh;
use crate::lod::filling::Filling;
use crate::lod::fit::{areas_around, fit};
use crate::lod::kept_lines::KeptLines;
use crate::lod::outline::Outline;
use crate::lod::refine::{Places, refine};
pub use crate::lod::rim::ShownMesh;
use crate::lod::rim::shown;
use crate::lod::terrain::Terrain;
use crate::lod::vertical_error::vertical_errors;
use breaklines::Breaklines;
use delaunay::geometry::Bounds;
use delaunay::geometry::square_grid::SquareGrid;
use sys::{Result, interrupt};

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// What viewers get.
    pub shown: ShownMesh,
    /// The mesh with all vertices on the outline, which ends there.
    pub working: CoarseMesh,
    /// The greatest vertical distance between the working mesh and the original in metres.
    pub working_error: f64,
    /// The greatest vertical distance between either mesh and the original in metres.
    pub shown_error: f64,
    /// The mean vertical distance to the vertices of the original in metres.
    pub typical_error: f64,
    /// The distance in metres between vertices.
    pub spacing: f64,
}

/// Vertices that are chosen for each triangle that is wanted, at least, however many the rim has.
const LEAST_INSIDE: f64 = 1.0 / 16.0;

/// Edges on the border of what viewers get are at most this many times longer than vertices are apart.
const RIM_TO_SPACING: f64 = 2.0;

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

/// Simplifies `terrain` to about `triangles` triangles for viewers. Up to half of the vertices are those of breaklines, if there are `lines`.
///
/// # Errors
/// [`sys::Error::Broken`] if the outline is not that of a part of a Delaunay triangulation, [`sys::Error::Interrupted`].
pub fn simplify(frame: &Frame, terrain: &Terrain, triangles: usize, lines: Option<&Breaklines>) -> Result<Simplified> {
    let outline = Outline::of(terrain);
    let positions = terrain.positions;
    let bounds = most_of(positions).unwrap_or(Bounds::of_point([0; 2]));
    let mut kept = outline.rim(positions, RIM_TO_SPACING * side_of(bounds, triangles / 2));
    let on_rim = count(&kept);
    let least = (triangles as f64 * LEAST_INSIDE) as usize;
    let wanted = (triangles / 2).saturating_sub(on_rim / 2).max(least).min(positions.len() - on_rim);
    if on_rim + wanted >= positions.len() {
        return Ok(Simplified::unchanged(terrain));
    }
    let [xy, up] = frame.resolution_metres();
    let longest = PIECES_TO_SPACING * side_of(bounds, wanted);
    let kept_lines = KeptLines::choose(lines, positions, &kept, wanted / 2, longest);
    kept_lines.vertices.iter().for_each(|&v| kept[v] = true);
    let by_grid = ((wanted - kept_lines.vertices.len()) as f64 * BY_GRID) as usize;
    keep_by_grid(positions, bounds, by_grid, &kept_lines, &mut kept);
    interrupt::check()?;
    let mut filling = Filling::new(positions, &kept)?;
    let mut places = Places::new(positions, &filling);
    let areas = areas_around(positions, terrain.triangles);
    refine(
        (positions, &weights(&areas, &outline)),
        &mut kept,
        |v| kept_lines.allows(v),
        &mut filling,
        &mut places,
        on_rim + wanted,
    )?;
    let side = side_of(bounds, filling.vertices.len());
    let mut fixed = vec![false; positions.len()];
    kept_lines.vertices.iter().for_each(|&v| fixed[v] = true);
    let located = places.locate_all(&filling);
    let typical_error = fit((positions, &areas), |v| fixed[v as usize], &mut filling, located)?;
    interrupt::check()?;
    let (shown, covers) = if located.len() == positions.len() {
        let covers = covering(positions, &outline, &filling, located);
        let may_move = |v: u32| !fixed[v as usize];
        (Some(shown((positions, &areas), &outline, &filling, &covers, located, may_move, typical_error)?), covers)
    } else {
        // Nearly all triangles are slivers.
        (None, Vec::new())
    };
    let (working, is_new) = with_outline(positions, kept, &outline, filling, &mut places)?;
    let shown = shown.unwrap_or_else(|| ShownMesh::without_skirts(working.clone()));
    interrupt::check()?;
    let changed = changed_triangles(&shown, &working, covers, is_new);
    let shown_in_part = (&shown.mesh, changed.as_slice(), shown.sunk);
    let errors = vertical_errors(positions, terrain.triangles, &outline.edges, &working, shown_in_part);
    let [working_error, shown_error] = errors.map(|error| error * up);
    Ok(Simplified { shown, working, working_error, shown_error, typical_error: typical_error * up, spacing: side * xy })
}

impl Simplified {
    /// Returns the terrain as it is.
    fn unchanged(terrain: &Terrain) -> Simplified {
        let vertices = (0..terrain.positions.len() as u32).collect();
        let (positions, triangles) = (terrain.positions.to_vec(), terrain.triangles.to_vec());
        let working = CoarseMesh { vertices, positions, triangles };
        let shown = ShownMesh::without_skirts(working.clone());
        Simplified { shown, working, working_error: 0.0, shown_error: 0.0, typical_error: 0.0, spacing: 0.0 }
    }
}

/// Takes all vertices on the `outline` of the terrain at `positions` into `filling`, with their own heights; it has those that are `kept`.
/// Returns the triangles within the outline, and for each triangle of `filling`, as far as that is long, whether it has changed.
fn with_outline(
    positions: &[[i32; 3]],
    mut kept: Vec<bool>,
    outline: &Outline,
    mut filling: Filling,
    places: &mut Places,
) -> Result<(CoarseMesh, Vec<bool>)> {
    let mut is_new = vec![false; filling.triangles()];
    let mut note = |triangle: usize| {
        if let Some(is_new) = is_new.get_mut(triangle) {
            *is_new = true;
        }
    };
    // Rings lead from place to place, so vertices that follow each other are near each other.
    for &v in outline.rings.iter().flatten() {
        if !std::mem::replace(&mut kept[v as usize], true) {
            places.insert(v, &mut filling, &mut note);
        }
    }
    if filling.vertices.len() < count(&kept) {
        // Walks to the places took too long.
        filling = filling.again_with(&kept)?;
        is_new.fill(true);
    }
    for (position, &v) in filling.positions.iter_mut().zip(&filling.vertices) {
        if outline.on[v as usize] {
            *position = positions[v as usize];
        }
    }
    let within = filling.within(&outline.edges)?;
    let (mesh, _) = filling.coarse(&within);
    filling.recycle();
    Ok((mesh, is_new))
}

/// Returns the triangles of `shown` that may not be in `working` with the same heights, but for what all of its inner vertices have sunk. They are
/// those of a filling that it `covers`; `is_new` tells which of the filling have changed since.
fn changed_triangles(shown: &ShownMesh, working: &CoarseMesh, covers: Vec<bool>, is_new: Vec<bool>) -> Vec<[u32; 3]> {
    let ShownMesh { mesh: shown, sunk, .. } = shown;
    let mut others = working.vertices.iter().zip(&working.positions);
    let has_moved: Vec<bool> = shown
        .vertices
        .iter()
        .zip(&shown.positions)
        .map(|(v, position)| {
            others.find(|(other, _)| *other == v).is_none_or(|(_, other)| other[2] - sunk != position[2])
        })
        .collect();
    let is_new = covers.into_iter().zip(is_new).filter(|(covers, _)| *covers).map(|(_, is_new)| is_new);
    let has_changed = |(t, is_new): &(&[u32; 3], bool)| *is_new || t.iter().any(|&v| has_moved[v as usize]);
    shown.triangles.iter().zip(is_new).filter(has_changed).map(|(t, _)| *t).collect()
}

/// Returns what the errors of vertices with these areas weigh. Those on the outline have triangles on one side alone, and their areas are half of
/// what they would be elsewhere.
fn weights(areas: &[f64], outline: &Outline) -> Vec<f64> {
    areas.iter().zip(&outline.on).map(|(&area, is_on)| if *is_on { 2.0 * area } else { area }).collect()
}

fn count(marked: &[bool]) -> usize {
    marked.iter().filter(|&&is_marked| is_marked).count()
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
