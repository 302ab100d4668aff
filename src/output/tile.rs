//! The content of one tile, in lattice steps and source axes.

use multiversion::multiversion;

/// A piece of the terrain: vertices on the job's lattice and the triangles between them. Every vertex is the corner of
/// at least one triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tile {
    /// Lattice integers x, y, z of every vertex.
    pub positions: Vec<[i32; 3]>,
    /// Unit normals of the vertices (x east, y north, z up) in a space where all axes are in metres.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Linear red, green and blue of the vertices, 65535 for full intensity.
    pub colors: Option<Vec<[u16; 3]>>,
    /// Corners as indices of vertices, counterclockwise seen from above.
    pub triangles: Vec<[u32; 3]>,
}

impl Tile {
    /// The tile of these triangles between some of `positions`, which keep their order, without normals and colours.
    pub fn of(positions: &[[i32; 3]], mut triangles: Vec<[u32; 3]>) -> Tile {
        let vertices = renumber(&mut triangles);
        Tile { positions: pick(positions, &vertices), triangles, ..Tile::default() }
    }

    /// The tile of only these triangles of this one.
    pub(crate) fn subset(&self, mut triangles: Vec<[u32; 3]>) -> Tile {
        let vertices = renumber(&mut triangles);
        Tile {
            positions: pick(&self.positions, &vertices),
            normals: self.normals.as_ref().map(|all| pick(all, &vertices)),
            colors: self.colors.as_ref().map(|all| pick(all, &vertices)),
            triangles,
        }
    }

    /// The least and greatest lattice integers of the vertices on every axis; `None` without vertices.
    pub fn bounds(&self) -> Option<[[i32; 3]; 2]> {
        bounds(&self.positions)
    }
}

/// The least and greatest of `positions` on every axis; `None` if there are none.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn bounds(positions: &[[i32; 3]]) -> Option<[[i32; 3]; 2]> {
    let first = *positions.first()?;
    Some(positions.iter().fold([first, first], |[low, high], p| {
        [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
    }))
}

/// A table of so many numbers for each corner is quicker than sorting the corners.
const TABLE_PER_CORNER: usize = 8;

/// Numbers the corners of `triangles` anew; the old numbers in order.
fn renumber(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let corners = triangles.as_flattened_mut();
    let Some((first, last)) = corners.iter().min().copied().zip(corners.iter().max().copied()) else {
        return Vec::new();
    };
    let span = (last - first) as usize + 1;
    if span > TABLE_PER_CORNER * corners.len() {
        return renumber_few(triangles);
    }
    let mut number = vec![0u32; span];
    corners.iter().for_each(|&v| number[(v - first) as usize] = 1);
    let vertices: Vec<u32> = (first..).zip(&number).filter(|(_, used)| **used > 0).map(|(v, _)| v).collect();
    vertices.iter().zip(0..).for_each(|(&v, new)| number[(v - first) as usize] = new);
    corners.iter_mut().for_each(|v| *v = number[(*v - first) as usize]);
    vertices
}

/// The same where the old numbers are far apart.
fn renumber_few(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    for corner in triangles.iter_mut().flatten() {
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
        fn both_ways_to_number_anew_agree(mut triangles in prop::collection::vec(prop::array::uniform3(0u32..4_000), 0..200)) {
            let mut few = triangles.clone();
            prop_assert_eq!(renumber(&mut triangles), renumber_few(&mut few));
            prop_assert_eq!(triangles, few);
        }
    }
}
