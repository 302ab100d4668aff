//! The content of one tile, in lattice steps and source axes.

use crate::attributes::PointAttributes;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, bounds_of};
use multiversion::multiversion;

/// A piece of the terrain: vertices on the job's lattice and the triangles between them. Every vertex is the corner of at
/// least one triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tile {
    /// The lattice integers x, y, z of every vertex.
    pub positions: Vec<[i32; 3]>,
    /// The unit normals of the vertices (x east, y north, z up) in a space where all axes are in metres.
    pub normals: Option<Vec<[f32; 3]>>,
    /// The linear red, green and blue of the vertices, 65535 for full intensity.
    pub colors: Option<Vec<[u16; 3]>>,
    /// What the vertices carry of their points.
    pub attributes: PointAttributes,
    /// The corners as indices of vertices, counterclockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
}

impl Tile {
    /// Returns twice the area of all triangles in the plane, in square lattice steps.
    pub fn double_area(&self) -> u64 {
        let site = |corner: u32| {
            let [x, y, _] = self.positions[corner as usize];
            [x, y]
        };
        self.triangles.iter().map(|&[a, b, c]| orient2d(site(a), site(b), site(c)).unsigned_abs()).sum()
    }

    /// Returns the tile of these triangles between some of `positions`, without normals and colours. Vertices keep their order.
    pub fn of(positions: &[[i32; 3]], triangles: Vec<[u32; 3]>) -> Tile {
        Tile::with_vertices(positions, triangles).0
    }

    /// Does what [`Tile::of`] does, and returns the old number of every vertex.
    pub(crate) fn with_vertices(positions: &[[i32; 3]], mut triangles: Vec<[u32; 3]>) -> (Tile, Vec<u32>) {
        let vertices = renumber(&mut triangles);
        (Tile { positions: pick(positions, &vertices), triangles, ..Tile::default() }, vertices)
    }

    /// Returns the tile of these triangles between vertices of this tile.
    pub(crate) fn subset(&self, triangles: Vec<[u32; 3]>) -> Tile {
        let (Tile { positions, triangles, .. }, vertices) = Tile::with_vertices(&self.positions, triangles);
        self.with_style_of(&vertices, positions, triangles)
    }

    /// Returns the tile of these triangles between vertices at other `positions`, each of which is in all else like one of these `vertices`.
    pub(crate) fn with_style_of(&self, vertices: &[u32], positions: Vec<[i32; 3]>, triangles: Vec<[u32; 3]>) -> Tile {
        Tile {
            positions,
            normals: self.normals.as_ref().map(|all| pick(all, vertices)),
            colors: self.colors.as_ref().map(|all| pick(all, vertices)),
            attributes: self.attributes.pick(vertices),
            triangles,
        }
    }

    /// Returns the box of the vertices, or `None` without vertices.
    pub fn bounds(&self) -> Option<Bounds<3>> {
        bounds_of(&self.positions)
    }
}

/// Up to this many times the number of corners, a table by vertex is quicker than sorting the corners.
const TABLE_PER_CORNER: usize = 8;

/// Gives the vertices of `triangles` new numbers from 0 on, in the order of the old ones, and returns the old ones.
fn renumber(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let corners = triangles.as_flattened_mut();
    if corners.is_empty() {
        return Vec::new();
    }
    let [first, last] = ends(corners);
    let span = (last - first) as usize + 1;
    if span > TABLE_PER_CORNER * corners.len() {
        return renumber_by_sorting(triangles);
    }
    let (mut number, mut used) = (vec![0u32; span], 0);
    for &v in corners.iter() {
        let is_used = &mut number[(v - first) as usize];
        used += usize::from(*is_used == 0);
        *is_used = 1;
    }
    // One place more: each vertex is written where the next used one belongs. A branch would often be foretold wrongly.
    let (mut vertices, mut next) = (vec![0; used + 1], 0);
    for (v, number) in (first..=last).zip(&mut number) {
        vertices[next as usize] = v;
        next += std::mem::replace(number, next);
    }
    vertices.truncate(used);
    corners.iter_mut().for_each(|v| *v = number[(*v - first) as usize]);
    vertices
}

/// Returns the least and the greatest number.
#[multiversion(targets("x86_64+avx2"))]
fn ends(numbers: &[u32]) -> [u32; 2] {
    numbers.iter().fold([u32::MAX, 0], |[least, greatest], &v| [least.min(v), greatest.max(v)])
}

/// Does what [`renumber`] does, for old numbers that are far apart.
fn renumber_by_sorting(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let mut vertices: Vec<u32> = triangles.as_flattened().to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    for corner in triangles.as_flattened_mut() {
        *corner = vertices.partition_point(|v| v < corner) as u32;
    }
    vertices
}

fn pick<T: Copy>(all: &[T], which: &[u32]) -> Vec<T> {
    which.iter().map(|&v| all[v as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_table_and_sorting_give_the_same_numbers(
            mut triangles in prop::collection::vec(prop::array::uniform3(0u32..4_000), 0..200),
        ) {
            let mut sorted = triangles.clone();
            prop_assert_eq!(renumber(&mut triangles), renumber_by_sorting(&mut sorted));
            prop_assert_eq!(triangles, sorted);
        }
    }
}
