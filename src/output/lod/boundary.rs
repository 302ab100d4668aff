//! Which vertices of a mesh are on its outline.

/// For each of `vertices` vertices whether it is on an edge that only one of `triangles` has; triangles are counterclockwise and
/// cover their ground once.
pub(crate) fn on_outline(vertices: usize, triangles: &[[u32; 3]]) -> Vec<bool> {
    // The edges that leave a vertex inside lead to the same vertices as those come from that come to it. Sums of scrambled numbers
    // are compared instead of sets: they differ where the sets do, but for one case in 2^64.
    let mut balance = vec![0u64; vertices];
    for &[a, b, c] in triangles {
        let [of_a, of_b, of_c] = [a, b, c].map(scrambled);
        for (v, to, from) in [(a, of_b, of_c), (b, of_c, of_a), (c, of_a, of_b)] {
            balance[v as usize] = balance[v as usize].wrapping_add(to).wrapping_sub(from);
        }
    }
    balance.iter().map(|&sum| sum != 0).collect()
}

fn scrambled(v: u32) -> u64 {
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
        assert_eq!(on_outline(8, &wheel), [true, true, true, true, true, true, true, false]);
    }

    proptest! {
        /// Any triangles of a lattice, left out here and there, so that there are holes and vertices where two of them meet.
        #[test]
        fn it_is_who_has_an_edge_without_its_reverse(left_out in prop::collection::vec(any::<bool>(), 2 * 8 * 8)) {
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
            prop_assert_eq!(on_outline(81, &triangles), expected);
        }
    }
}
