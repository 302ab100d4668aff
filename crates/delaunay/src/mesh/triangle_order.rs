//! An order of triangles that depends on the mesh alone, not on the way in which it was found.

/// A number of a vertex: in two bytes where that is enough, or in four.
pub trait Corner: Copy + Default + Into<u32> {
    /// Returns `number`, which must fit.
    fn of(number: u32) -> Self;
}

impl Corner for u16 {
    #[inline(always)]
    fn of(number: u32) -> u16 {
        debug_assert!(number <= u16::MAX.into(), "{number} takes more than two bytes");
        number as u16
    }
}

impl Corner for u32 {
    #[inline(always)]
    fn of(number: u32) -> u32 {
        number
    }
}

/// Sorts the triangles of meshes. It keeps its memory from mesh to mesh, so that its pages are faulted in once. Numbers of vertices have
/// the width that the file gives them: less memory to wait for.
#[derive(Debug, Default)]
pub struct TriangleSorter<C> {
    /// Where the next triangle with this first corner goes.
    first_places: Vec<u32>,
    /// Where the next triangle with this second corner goes.
    second_places: Vec<u32>,
    by_second: Vec<[C; 3]>,
    sorted: Vec<[C; 3]>,
}

impl<C: Corner> TriangleSorter<C> {
    /// Returns the triangles of a mesh with `vertices` vertices in ascending order, each from its lowest corner on, in the same sense of
    /// rotation. No two of them may have the same directed edge, so the first two corners tell them apart. Numbers of vertices must be below
    /// `vertices` and fit a `C`.
    ///
    /// It counts, first for the second corner, then for the first. That takes half the time of sorting the few triangles of each first
    /// corner, whose comparisons no processor foretells.
    pub fn ascending(&mut self, vertices: usize, triangles: &[[u32; 3]]) -> &[[C; 3]] {
        self.count(vertices, triangles);
        self.by_second.resize(triangles.len(), [C::default(); 3]);
        for &triangle in triangles {
            let turned = from_lowest(triangle);
            self.by_second[next(&mut self.second_places, turned[1])] = turned.map(C::of);
        }
        self.sorted.resize(triangles.len(), [C::default(); 3]);
        for &triangle in &self.by_second {
            self.sorted[next(&mut self.first_places, triangle[0].into())] = triangle;
        }
        &self.sorted
    }

    /// Finds where the triangles of each first and each second corner begin.
    fn count(&mut self, vertices: usize, triangles: &[[u32; 3]]) {
        let (first, second) = (&mut self.first_places, &mut self.second_places);
        for counts in [&mut *first, &mut *second] {
            counts.clear();
            counts.resize(vertices, 0);
        }
        for &triangle in triangles {
            let [a, b, _] = from_lowest(triangle);
            first[a as usize] += 1;
            second[b as usize] += 1;
        }
        for counts in [first, second] {
            let mut start = 0;
            counts.iter_mut().for_each(|count| start += std::mem::replace(count, start));
        }
    }
}

/// Returns a place and moves on to the one after it.
#[inline(always)]
fn next(places: &mut [u32], corner: u32) -> usize {
    let place = &mut places[corner as usize];
    *place += 1;
    *place as usize - 1
}

/// Returns the triangle from its lowest corner on, without branches.
#[inline(always)]
fn from_lowest([a, b, c]: [u32; 3]) -> [u32; 3] {
    let edge = |from: u32, to: u32| u64::from(from) << u32::BITS | u64::from(to);
    let lowest = edge(a, b).min(edge(b, c)).min(edge(c, a));
    let (first, second) = ((lowest >> u32::BITS) as u32, lowest as u32);
    [first, second, a ^ b ^ c ^ first ^ second]
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
            earlier in 0u32..300,
        ) {
            // Half of them have the other sense of rotation.
            let mut expected: Vec<[u32; 3]> =
                triangles.iter().map(|&[a, b, c]| if b % 2 == 0 { [a, b, c] } else { [a, c, b] }).collect();
            expected.sort_unstable();
            expected.dedup_by_key(|&mut [a, b, _]| [a, b]);
            let mut shuffled: Vec<_> = expected.iter().copied().zip(turns).zip(keys).collect();
            shuffled.sort_by_key(|&(_, key)| key);
            let turned = shuffled.into_iter().map(|((mut triangle, turn), _)| {
                triangle.rotate_left(turn);
                triangle
            });
            let triangles: Vec<_> = turned.collect();
            let mut sorter = TriangleSorter::<u32>::default();
            let mut short_sorter = TriangleSorter::<u16>::default();
            let strip: Vec<_> = (0..earlier).map(|a| [a, a + 1, a + 2]).collect();
            sorter.ascending(302, &strip);
            short_sorter.ascending(302, &strip);
            let short: Vec<_> = short_sorter.ascending(40, &triangles).iter().map(|t| t.map(u32::from)).collect();
            prop_assert_eq!(sorter.ascending(40, &triangles), &expected);
            prop_assert_eq!(short, expected);
        }
    }
}
