//! A number that says which vertices a mesh has, on its lattice.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Odd numbers without a pattern (those of wyhash), one for each input of the hash.
const SECRET: [u64; 4] = [0xa076_1d64_78bd_642f, 0xe703_7ed1_a0b4_28db, 0x8ebc_6af0_9c88_c6e3, 0x5899_65cc_7537_4cc3];

/// The sum, modulo 2^128, of a 128-bit hash of the lattice integers x, y and z of every vertex. It depends on neither the order of the vertices nor the cut into tiles. Together with the lattice it tells the whole mesh: there is one
/// Delaunay triangulation of its vertices, ties included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct VertexDigest(u128);

impl VertexDigest {
    /// Adds a vertex.
    #[inline]
    pub fn add(&mut self, [x, y, z]: [i32; 3]) {
        let [x, y, z] = [x, y, z].map(|v| u64::from(v as u32));
        let plane = x | y << 32;
        let high = fold(plane ^ SECRET[0], z ^ SECRET[1]);
        let low = fold(high ^ SECRET[2], plane.wrapping_add(z) ^ SECRET[3]);
        self.0 = self.0.wrapping_add(u128::from(high) << 64 | u128::from(low));
    }

    /// Returns the digest of two sets of vertices together.
    #[inline]
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

/// Mixes two numbers as wyhash does. XXH3 takes several times as long for so few bytes, which a job of all points would feel.
#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    product as u64 ^ (product >> 64) as u64
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
    fn neighbours_have_unlike_hashes() {
        let mut seen = std::collections::HashSet::new();
        let mut ones = 0;
        for (x, y, z) in (0..64 * 64 * 64).map(|i| (i % 64 - 32, i / 64 % 64 - 32, i / 4096 - 32)) {
            let hash = VertexDigest::of([[x, y, z]]).0;
            assert!(seen.insert(hash as u64) && seen.insert((hash >> 64) as u64), "{x} {y} {z}");
            ones += (hash ^ VertexDigest::of([[x, y, z + 1]]).0).count_ones();
        }
        let share = f64::from(ones) / (128.0 * 64.0 * 64.0 * 64.0);
        assert!((0.49..0.51).contains(&share), "{share}");
    }

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
