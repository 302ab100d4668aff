//! An order of triangles that depends on the mesh alone, not on the way in which it was found.

/// Below this many vertices the three corners of a triangle fit a number of 64 bits.
const MANY_VERTICES: usize = 1 << CORNER_BITS;
const CORNER_BITS: u32 = 21;

/// Returns the triangles of a mesh with `vertices` vertices in ascending order, each from its lowest corner on, in the same sense of
/// rotation.
pub fn ascending(vertices: usize, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    if vertices >= MANY_VERTICES {
        let mut ordered: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, b, c].min([b, c, a]).min([c, a, b])).collect();
        ordered.sort_unstable();
        return ordered;
    }
    let keys: Vec<u64> = triangles.iter().map(|&triangle| key(triangle)).collect();
    let corner = |key: u64, k: u32| (key >> (CORNER_BITS * (2 - k))) as u32 & (MANY_VERTICES as u32 - 1);
    let ordered = sorted(vertices, &keys, |key| corner(key, 0) as usize);
    ordered.into_iter().map(|key| [0, 1, 2].map(|k| corner(key, k))).collect()
}

/// Returns the corners as one number, from the lowest on.
#[inline(always)]
fn key([a, b, c]: [u32; 3]) -> u64 {
    let joined = |[a, b, c]: [u32; 3]| (u64::from(a) << CORNER_BITS | u64::from(b)) << CORNER_BITS | u64::from(c);
    joined([a, b, c]).min(joined([b, c, a])).min(joined([c, a, b]))
}

/// Returns `keys` in ascending order. They are put into groups first, which take half the time of a sort: `group` is a number below
/// `groups` that ascends with the key. Most groups have two keys.
fn sorted(groups: usize, keys: &[u64], group: impl Fn(u64) -> usize) -> Vec<u64> {
    let mut ends = vec![0u32; groups + 1];
    for &key in keys {
        ends[group(key) + 1] += 1;
    }
    for v in 1..ends.len() {
        ends[v] += ends[v - 1];
    }
    // This moves every start to the next one's place.
    let mut ordered = vec![0; keys.len()];
    for &key in keys {
        let place = &mut ends[group(key)];
        ordered[*place as usize] = key;
        *place += 1;
    }
    let mut start = 0;
    for &end in &ends[..groups] {
        match &mut ordered[start..end as usize] {
            [a, b] => (*a, *b) = ((*a).min(*b), (*a).max(*b)),
            keys => keys.sort_unstable(),
        }
        start = end as usize;
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_order_becomes_the_same(
            triangles in prop::collection::btree_set([0u32..12, 12..24, 24..40], 0..200),
            turns in prop::collection::vec(0usize..3, 200),
            keys in prop::collection::vec(any::<u32>(), 200),
            vertices in prop::sample::select(vec![40, MANY_VERTICES]),
        ) {
            // Half of them have the other sense of rotation.
            let mut expected: Vec<[u32; 3]> =
                triangles.iter().map(|&[a, b, c]| if b % 2 == 0 { [a, b, c] } else { [a, c, b] }).collect();
            expected.sort_unstable();
            let mut shuffled: Vec<_> = expected.iter().copied().zip(turns).zip(keys).collect();
            shuffled.sort_by_key(|&(_, key)| key);
            let turned = shuffled.into_iter().map(|((mut triangle, turn), _)| {
                triangle.rotate_left(turn);
                triangle
            });
            prop_assert_eq!(ascending(vertices, &turned.collect::<Vec<_>>()), expected);
        }
    }
}
