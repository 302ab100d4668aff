//! The vertices on the boundary of a mesh.

/// Tells for each vertex from 0 to `vertices` whether it is on an edge that only one of `triangles` has. The triangles must be
/// counterclockwise and cover their ground once.
pub(crate) fn on_boundary(vertices: usize, triangles: &[[u32; 3]]) -> Vec<bool> {
    // Around an inner vertex, the edges that leave lead to the same vertices as the edges that arrive come from. Instead of these two
    // sets, sums of hashes are compared: they differ where the sets do, except in one case of 2^64.
    let mut balance = vec![0u64; vertices];
    // A vertex is the corner of about six triangles.
    let hashes: Vec<u64> = (0..vertices as u32).map(hash).collect();
    for &[a, b, c] in triangles {
        let [of_a, of_b, of_c] = [a, b, c].map(|v| hashes[v as usize]);
        for (v, to, from) in [(a, of_b, of_c), (b, of_c, of_a), (c, of_a, of_b)] {
            balance[v as usize] = balance[v as usize].wrapping_add(to).wrapping_sub(from);
        }
    }
    balance.iter().map(|&sum| sum != 0).collect()
}

#[inline(always)]
fn hash(v: u32) -> u64 {
    let x = (v as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_wheel_has_its_hub_inside() {
        let wheel: Vec<[u32; 3]> = (0..7).map(|i| [7, i, (i + 1) % 7]).collect();
        assert_eq!(on_boundary(8, &wheel), [true, true, true, true, true, true, true, false]);
    }

    proptest! {
        /// Triangles of a lattice without some of them, so that there are holes and vertices where two holes meet.
        #[test]
        fn boundary_vertices_have_an_edge_without_its_reverse(left_out in prop::collection::vec(any::<bool>(), 2 * 8 * 8)) {
            let at = |x: u32, y: u32| 9 * y + x;
            let squares = (0..64).map(|i| (i % 8, i / 8));
            let all = squares.flat_map(|(x, y)| {
                [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]]
            });
            let triangles: Vec<[u32; 3]> = all.zip(&left_out).filter(|(_, out)| !**out).map(|(t, _)| t).collect();
            let edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
            let mut expected = vec![false; 81];
            for &[a, b] in edges.iter().filter(|&&[a, b]| !edges.contains(&[b, a])) {
                (expected[a as usize], expected[b as usize]) = (true, true);
            }
            prop_assert_eq!(on_boundary(81, &triangles), expected);
        }
    }
}
