//! The tests of all triangles and edges of a mesh, a block of triangles at a time. First the corners are fetched, and the sites beyond the
//! edges, without unpredictable branches. Then many determinants are computed side by side in single precision, with a bound on their error.
//! The caller decides exactly what the bound leaves in doubt.

use crate::geometry::Site;
use crate::geometry::predicates::{TriangleBatch, Uncertain};
use crate::voronoi::index::ClosedEdge;

/// Tests a block of triangles at a time.
#[derive(Default)]
pub(super) struct EdgeTester {
    batch: TriangleBatch,
}

/// What [`EdgeTester::test`] found out. Bit `t` is that of triangle `t` of the block.
pub(super) struct TestedBlock {
    /// The triangles that may not be counterclockwise, and the edges that fail the in-circle test or may fail it. An edge belongs to the
    /// later of its triangles. The result for edges to infinity is arbitrary.
    pub(super) uncertain: Uncertain,
    /// The number of edges.
    pub(super) edges: usize,
    /// Whether some half-edge and its twin are not each other's twins or have different ends.
    pub(super) broken: bool,
}

impl EdgeTester {
    /// How many triangles a block may have.
    pub(super) const TRIANGLES: usize = TriangleBatch::LANES;

    /// Sets the corners of triangle `t` of the block.
    #[inline(always)]
    pub(super) fn set_corners(&mut self, t: usize, [a, b, c]: [Site; 3]) {
        let [p, q, r] = &mut self.batch.corners;
        (p[t], q[t], r[t]) = (a, b, c);
    }

    /// Tests the triangles of `block`, whose first record is `first` of `records`. Their corners must be set. The mesh begins with record
    /// `front`. With `CHECK`, the links are checked too.
    #[inline(always)]
    pub(super) fn test<const CHECK: bool>(
        &mut self,
        records: &[[u32; 8]],
        front: usize,
        first: usize,
        block: &Block,
        sites: &[Site],
    ) -> TestedBlock {
        let own = block.own_sides(8 * (first - front) as u32, 8 * front as u32);
        let (mut edges, mut broken) = (0, false);
        for (i, own) in own.into_iter().enumerate() {
            broken |= self.fetch_beyond::<CHECK>(records, first, block.records, i, own, sites);
            edges += own.count_ones() as usize;
        }
        let mut uncertain = self.batch.uncertain(block.count);
        for (side, own) in uncertain.sides.iter_mut().zip(own) {
            *side &= own;
        }
        TestedBlock { uncertain, edges, broken }
    }

    /// Fetches the sites beyond side `i` of the triangles `own`. With `CHECK`, returns whether some link is wrong.
    #[inline(always)]
    fn fetch_beyond<const CHECK: bool>(
        &mut self,
        records: &[[u32; 8]],
        first: usize,
        block: &[[u32; 8]; EdgeTester::TRIANGLES],
        i: usize,
        own: u64,
        sites: &[Site],
    ) -> bool {
        let beyond = &mut self.batch.beyond[i];
        let (mut wrong, mut corners) = (0, 0);
        let mut left = own;
        while left != 0 {
            let t = left.trailing_zeros() as usize % EdgeTester::TRIANGLES;
            left &= left - 1;
            let near = &block[t];
            let twin = near[4 + i];
            let Some(far) = records.get(twin as usize / 8) else { return true };
            // The corners 1, 2, 0 come after 0, 1, 2, and 2, 0, 1 before them.
            let (corner, twice) = ((twin & 3) as usize, 2 * (twin & 3));
            let (next, previous) = ((0b00_10_01 >> twice & 3) as usize, (0b01_00_10 >> twice & 3) as usize);
            if CHECK {
                let h = (8 * (first + t) + i) as u32;
                wrong |= (near[i] ^ far[next]) | (near[(i + 1) % 3] ^ far[corner]) | (far[4 + corner] ^ h);
                // No corner has the number 3 or more.
                corners |= twin | (twin & twin << 1) << 1;
            }
            let Some(&site) = sites.get(far[previous] as usize) else { return true };
            beyond[t] = site;
        }
        CHECK && (wrong != 0 || corners & 4 != 0)
    }
}

/// The records of a block of triangles.
pub(super) struct Block<'a> {
    /// The records. Those from `count` on have no triangles.
    pub(super) records: &'a [[u32; 8]; EdgeTester::TRIANGLES],
    /// How many triangles there are.
    pub(super) count: usize,
}

impl<'a> Block<'a> {
    /// Returns a block of `records`, from `first` on. If there are not enough for a block, they are copied to `padded`.
    #[inline(always)]
    pub(super) fn new(
        records: &'a [[u32; 8]],
        first: usize,
        padded: &'a mut [[u32; 8]; EdgeTester::TRIANGLES],
    ) -> Block<'a> {
        let records = &records[first..];
        if let Some(records) = records.first_chunk() {
            return Block { records, count: EdgeTester::TRIANGLES };
        }
        *padded = [[0; 8]; EdgeTester::TRIANGLES];
        padded[..records.len()].copy_from_slice(records);
        Block { records: padded, count: records.len() }
    }

    /// Returns for each side of the triangles whether it leads to an earlier triangle. A side that leads to its own triangle does not count,
    /// so a mesh with such sides has too few edges. The first half-edge of the block comes `start` after the first of the mesh, `front`.
    #[inline(always)]
    fn own_sides(&self, start: u32, front: u32) -> [u64; 3] {
        let mut own = [0; 3];
        for (t, record) in self.records.iter().enumerate().rev() {
            let h = start + 8 * t as u32;
            for (i, own) in own.iter_mut().enumerate() {
                // Slots, which come before the front, wrap around, and so do not count as earlier.
                let is_earlier = record[4 + i].wrapping_sub(front) < h;
                *own = (*own << 1) + u64::from(is_earlier);
            }
        }
        let all = u64::MAX >> (EdgeTester::TRIANGLES - self.count);
        own.map(|own| own & all)
    }
}

/// Returns the half-edges that are side `i` of the triangles in `word`, a bit for each triangle from record `first` on.
#[inline(always)]
pub(super) fn sides(mut word: u64, first: usize, i: usize) -> impl Iterator<Item = ClosedEdge> {
    std::iter::from_fn(move || {
        let t = word.trailing_zeros() as usize;
        let found = word != 0;
        word &= word.wrapping_sub(1);
        found.then_some(ClosedEdge((8 * (first + t) + i) as u32))
    })
}
