//! A number that says which triangles a mesh has, and nothing else.

use std::fmt;

use xxhash_rust::xxh3::xxh3_128;

/// The sum, modulo 2^128, of a 128-bit hash (XXH3) of every triangle: of the nine source coordinates x, y, z of its corners,
/// counterclockwise from the one that is least in (x, y), as little-endian f64. So it depends on neither the order of
/// triangles and corners, nor the cut into tiles, nor the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Digest(u128);

impl Digest {
    /// Adds a triangle, counterclockwise; corners are x, y, z in source units.
    #[inline]
    pub fn add(&mut self, triangle: [[f64; 3]; 3]) {
        let [a, b, c] = triangle;
        let less = |p: [f64; 3], q: [f64; 3]| p[0] < q[0] || (p[0] == q[0] && p[1] < q[1]);
        let turned = match (less(a, b), less(b, c), less(c, a)) {
            (true, _, false) => [a, b, c],
            (false, true, _) => [b, c, a],
            _ => [c, a, b],
        };
        let mut bytes = [0; 72];
        for (field, value) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(turned.as_flattened()) {
            *field = value.to_le_bytes();
        }
        self.0 = self.0.wrapping_add(xxh3_128(&bytes));
    }

    /// The digest of two sets of triangles together.
    pub fn join(self, other: Digest) -> Digest {
        Digest(self.0.wrapping_add(other.0))
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// The digest of these triangles; see [`Digest`].
pub fn digest_of(triangles: impl IntoIterator<Item = [[f64; 3]; 3]>) -> Digest {
    let mut digest = Digest::default();
    triangles.into_iter().for_each(|triangle| digest.add(triangle));
    digest
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f64; 3] = [0.0, 0.0, 1.0];
    const B: [f64; 3] = [2.0, 0.0, 0.5];
    const C: [f64; 3] = [0.0, 2.0, 7.0];
    const D: [f64; 3] = [2.0, 2.0, 7.0];

    #[test]
    fn order_does_not_matter_but_orientation_and_height_do() {
        let one = digest_of([[A, B, C], [B, D, C]]);
        assert_eq!(one, digest_of([[C, B, D], [B, C, A]]));
        assert_eq!(one, digest_of([[D, C, B], [C, A, B]]));
        assert_ne!(one, digest_of([[A, C, B], [B, D, C]]));
        assert_ne!(one, digest_of([[A, B, D], [A, D, C]]));
        assert_ne!(one, digest_of([[A, B, [0.0, 2.0, 7.01]], [B, D, C]]));
    }
}
