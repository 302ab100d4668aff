//! The in-circle test of all edges of a mesh, in batches: first the edges are listed and their corners fetched, without
//! branches that cannot be foreseen, then many determinants are computed side by side in single precision, with a bound
//! on their error. What the bound leaves in doubt is for the caller to decide exactly.

use crate::geometry::Site;
use crate::geometry::predicates::InCircleBatch;
use crate::voronoi::closed_mesh::{ClosedMesh, next, previous};

/// The batch at hand.
#[derive(Default)]
pub(super) struct EdgeTester {
    batch: InCircleBatch,
}

/// What [`EdgeTester::test`] found of the links between half-edges.
#[derive(Default)]
pub(super) struct LinkCheck {
    /// Edges tested.
    pub(super) count: usize,
    /// Whether any two half-edges are not each other's twins, or have other ends.
    pub(super) broken: bool,
}

impl EdgeTester {
    /// Numbers in the records of as many triangles as are tested at a time; each has at most three edges.
    pub(super) const BLOCK: usize = InCircleBatch::LANES / 3 * 8;

    /// Appends to `failing` the edges of the triangles in records `start..end`, at most [`EdgeTester::BLOCK`], that fail the
    /// in-circle test or may do so. An edge belongs to the later of its triangles. Of edges to infinity it says anything.
    /// With `CHECK`, it looks at the links too.
    #[inline(always)]
    pub(super) fn test<const CHECK: bool>(
        &mut self,
        sphere: &ClosedMesh,
        sites: &[Site],
        start: usize,
        end: usize,
        failing: &mut Vec<u32>,
    ) -> LinkCheck {
        let (records, front) = (sphere.records(), sphere.front());
        let mut edges = [0; InCircleBatch::LANES + 3];
        let mut links = LinkCheck::default();
        for (t, record) in (start as u32..).step_by(8).zip(records[start..end].chunks_exact(8)) {
            for i in 0..3 {
                let (h, twin) = (t + i, record[4 + i as usize]);
                edges[links.count] = h;
                links.count += ((twin < h) & (twin >= front)) as usize;
            }
        }
        for (lane, &h) in edges[..links.count].iter().enumerate() {
            let t = (h & !7) as usize;
            let record = &records[t..t + 8];
            let g = record[4 + (h & 3) as usize];
            if CHECK && g & 7 > 2 {
                links.broken = true;
                continue;
            }
            let opposite = records[previous(g) as usize];
            if CHECK {
                let there = records[h as usize] ^ records[next(g) as usize];
                let back = records[next(h) as usize] ^ records[g as usize];
                links.broken |= (there | back | (records[g as usize + 4] ^ h)) != 0;
                if opposite as usize >= sites.len() {
                    links.broken = true;
                    continue;
                }
            }
            let at = |v: u32| sites[v as usize];
            self.batch.set(lane, at(record[0]), at(record[1]), at(record[2]), at(opposite));
        }
        let doubtful = self.batch.inside_or_in_doubt(links.count);
        // Without a branch: about one edge in seven fails, and nobody can foresee which.
        let before = failing.len();
        failing.resize(before + links.count + 1, 0);
        let room = &mut failing[before..];
        let mut found = 0;
        for (&h, doubt) in edges[..links.count].iter().zip(doubtful) {
            room[found] = h;
            found += doubt as usize;
        }
        failing.truncate(before + found);
        links
    }
}
