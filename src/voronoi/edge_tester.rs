//! The in-circle test of all edges of a mesh, in batches. First the edges are listed and their corners fetched, without unpredictable
//! branches. Then many determinants are computed side by side in single precision, with a bound on their error. The caller decides
//! exactly what the bound leaves in doubt.

use crate::geometry::Site;
use crate::geometry::predicates::InCircleBatch;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::index::ClosedEdge;

/// Tests a block of triangles at a time.
#[derive(Default)]
pub(super) struct EdgeTester {
    /// The sites of the corners of the block's triangles. The caller fetches them, and may need them too.
    pub(super) corners: [[Site; 3]; EdgeTester::ROOM],
    batch: InCircleBatch,
}

/// What [`EdgeTester::test`] found out about the links between half-edges.
#[derive(Default)]
pub(super) struct LinkCheck {
    /// How many edges were tested.
    pub(super) count: usize,
    /// Whether some half-edge and its twin are not each other's twins or have different ends.
    pub(super) broken: bool,
}

impl EdgeTester {
    /// The length, in numbers, of the records of as many triangles as one batch tests. Each triangle has at most three edges.
    pub(super) const BLOCK: usize = InCircleBatch::LANES / 3 * 8;
    /// Room for the triangles of a block: a power of two, so that no index needs a check.
    const ROOM: usize = (InCircleBatch::LANES / 3).next_power_of_two();

    /// Appends to `failing` the edges of the triangles in records `start..end`, at most [`EdgeTester::BLOCK`], that fail the
    /// in-circle test or may fail it. The sites of their corners must be in `corners`. An edge belongs to the later of its triangles. The
    /// result for edges to infinity is arbitrary. With `CHECK`, the links are checked too.
    #[inline(always)]
    pub(super) fn test<const CHECK: bool>(
        &mut self,
        mesh: &ClosedMesh,
        sites: &[Site],
        start: usize,
        end: usize,
        failing: &mut Vec<ClosedEdge>,
    ) -> LinkCheck {
        let (records, front) = (mesh.records(), mesh.front().0);
        let mut edges = [ClosedEdge::default(); InCircleBatch::LANES + 3];
        let mut links = LinkCheck::default();
        for (t, record) in (start as u32..).step_by(8).zip(records[start..end].chunks_exact(8)) {
            for i in 0..3 {
                let (h, twin) = (t + i, record[4 + i as usize]);
                edges[links.count] = ClosedEdge(h);
                links.count += ((twin < h) & (twin >= front)) as usize;
            }
        }
        for (lane, &h) in edges[..links.count].iter().enumerate() {
            let g = ClosedEdge(records[h.get() + 4]);
            if CHECK && g.0 & 7 > 2 {
                links.broken = true;
                continue;
            }
            let opposite = records[g.previous().get()];
            if CHECK {
                let there = records[h.get()] ^ records[g.next().get()];
                let back = records[h.next().get()] ^ records[g.get()];
                links.broken |= (there | back | (records[g.get() + 4] ^ h.0)) != 0;
                if opposite as usize >= sites.len() {
                    links.broken = true;
                    continue;
                }
            }
            let [a, b, c] = self.corners[(h.get() - start) / 8 % EdgeTester::ROOM];
            self.batch.set(lane, a, b, c, sites[opposite as usize]);
        }
        let doubtful = self.batch.inside_or_in_doubt(links.count);
        // Branch-free: about one edge in seven fails, and which one is unpredictable.
        let before = failing.len();
        failing.resize(before + links.count + 1, ClosedEdge::default());
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
