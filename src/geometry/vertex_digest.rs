//! A number that says which vertices a mesh has, on its lattice.

use std::fmt;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

/// The sum, modulo 2^128, of a 128-bit hash (XXH3) of the lattice integers x, y and z of every vertex, as little-endian i32. It
/// depends on neither the order of the vertices nor the cut into tiles. Together with the lattice it tells the whole mesh: there is one
/// Delaunay triangulation of its vertices, ties included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct VertexDigest(u128);

impl VertexDigest {
    /// Adds a vertex.
    #[inline]
    pub fn add(&mut self, [x, y, z]: [i32; 3]) {
        let mut bytes = [0; 12];
        for (field, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip([x, y, z]) {
            *field = value.to_le_bytes();
        }
        self.0 = self.0.wrapping_add(xxh3_128(&bytes));
    }

    /// Returns the digest of two sets of vertices together.
    pub fn join(self, other: VertexDigest) -> VertexDigest {
        VertexDigest(self.0.wrapping_add(other.0))
    }

    /// Returns the digest of these vertices.
    pub fn of(vertices: impl IntoIterator<Item = [i32; 3]>) -> VertexDigest {
        let mut digest = VertexDigest::default();
        vertices.into_iter().for_each(|vertex| digest.add(vertex));
        digest
    }
}

impl fmt::Display for VertexDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl From<VertexDigest> for String {
    fn from(digest: VertexDigest) -> String {
        digest.to_string()
    }
}

impl TryFrom<String> for VertexDigest {
    type Error = std::num::ParseIntError;

    fn try_from(text: String) -> Result<VertexDigest, Self::Error> {
        u128::from_str_radix(&text, 16).map(VertexDigest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_depends_on_every_coordinate_but_not_on_the_order() {
        let vertices = [[1, 2, 3], [-4, 5, 6], [7, 8, -9]];
        let digest = VertexDigest::of(vertices);
        assert_eq!(VertexDigest::of([vertices[2], vertices[0], vertices[1]]), digest);
        assert_eq!(VertexDigest::of([vertices[1]]).join(VertexDigest::of([vertices[0], vertices[2]])), digest);
        for (vertex, axis) in (0..9).map(|i| (i / 3, i % 3)) {
            let mut moved = vertices;
            moved[vertex][axis] += 1;
            assert_ne!(VertexDigest::of(moved), digest);
        }
        assert_eq!(VertexDigest::try_from(digest.to_string()), Ok(digest));
    }
}
