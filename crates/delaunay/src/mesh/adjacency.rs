//! The triangles around each vertex of a mesh.

use std::ops::Range;

/// The triangles of a mesh by vertex. A triangle (v, a, b) is listed at vertex v as the directed edge from a to b, so corners keep
/// their sense of rotation. The triangles at a vertex are in the order of the mesh.
#[derive(Clone, Debug)]
pub struct VertexAdjacency {
    /// The edges opposite vertex v are `opposite[starts[v]..starts[v + 1]]`. There is one entry more than that needs.
    starts: Vec<u32>,
    /// The edges opposite all vertices.
    pub opposite: Vec<[u32; 2]>,
}

impl VertexAdjacency {
    /// Lists the `triangles` between vertices 0 to `vertices`.
    pub fn new(vertices: usize, triangles: &[[u32; 3]]) -> VertexAdjacency {
        // One place further than needed: filling moves every start to the next one's place.
        let mut starts = vec![0u32; vertices + 2];
        for &v in triangles.as_flattened() {
            starts[v as usize + 2] += 1;
        }
        for v in 2..starts.len() {
            starts[v] += starts[v - 1];
        }
        let mut opposite = vec![[0; 2]; 3 * triangles.len()];
        for &[a, b, c] in triangles {
            for (v, edge) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let place = &mut starts[v as usize + 1];
                opposite[*place as usize] = edge;
                *place += 1;
            }
        }
        VertexAdjacency { starts, opposite }
    }

    /// Returns the number of vertices, with and without triangles.
    #[inline]
    pub fn vertices(&self) -> usize {
        self.starts.len() - 2
    }

    /// Returns the edges opposite vertex `v`.
    #[inline(always)]
    pub fn around(&self, v: u32) -> &[[u32; 2]] {
        &self.opposite[self.range(v)]
    }

    /// Returns where the edges opposite vertex `v` are in [`VertexAdjacency::opposite`].
    #[inline(always)]
    pub fn range(&self, v: u32) -> Range<usize> {
        self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_is_listed_at_its_three_corners() {
        let adjacency = VertexAdjacency::new(5, &[[0, 1, 2], [2, 1, 4]]);
        assert_eq!(adjacency.vertices(), 5);
        assert_eq!(adjacency.around(0), [[1, 2]]);
        assert_eq!(adjacency.around(1), [[2, 0], [4, 2]]);
        assert_eq!(adjacency.around(2), [[0, 1], [1, 4]]);
        assert!(adjacency.around(3).is_empty());
        assert_eq!(adjacency.range(4), 5..6);
    }
}
