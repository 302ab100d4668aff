//! The in-circle test of all edges of a mesh, in batches. First the edges are listed and their corners fetched, without unpredictable
//! branches. Then many determinants are computed side by side in single precision, with a bound on their error. The caller decides
//! exactly what the bound leaves in doubt.

use crate::geometry::Site;
use crate::geometry::predicates::InCircleBatch;
use crate::voronoi::closed_mesh::ClosedMesh;
use crate::voronoi::index::ClosedEdge;

/// Tests a block of triangles at a time.
pub(super) struct EdgeTester {
    /// The sites of the corners of the block's triangles. The caller fetches them, and may need them too.
    pub(super) corners: [[Site; 3]; EdgeTester::ROOM],
    batch: InCircleBatch,
    /// The edges of the batch, and room for one more.
    edges: [ClosedEdge; EdgeTester::ROOM_FOR_EDGES],
    found: [ClosedEdge; EdgeTester::ROOM_FOR_EDGES],
}

impl Default for EdgeTester {
    fn default() -> Self {
        EdgeTester {
            corners: [[[0; 2]; 3]; EdgeTester::ROOM],
            batch: InCircleBatch::default(),
            edges: [ClosedEdge::default(); EdgeTester::ROOM_FOR_EDGES],
            found: [ClosedEdge::default(); EdgeTester::ROOM_FOR_EDGES],
        }
    }
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
    /// Room for the edges of a block, a power of two as well.
    const ROOM_FOR_EDGES: usize = (InCircleBatch::LANES + 1).next_power_of_two();

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
        let records = mesh.records().as_chunks::<8>().0;
        let block = &records[start / 8..end / 8];
        let mut links = LinkCheck { count: self.list(block, start as u32, mesh.front().0), broken: false };
        let mut wrong = 0;
        for (lane, &h) in self.edges[..links.count].iter().enumerate() {
            let t = (h.get() - start) / 8;
            let near = &block[t];
            let g = ClosedEdge(near[4 + h.corner()]);
            let Some(far) = records.get(g.get() / 8) else {
                links.broken = true;
                continue;
            };
            if CHECK {
                let there = near[h.corner()] ^ far[g.next().corner()];
                let back = near[h.next().corner()] ^ far[g.corner()];
                wrong |= there | back | (far[4 + g.corner()] ^ h.0) | u32::from(g.0 & 7 > 2);
            }
            let Some(&d) = sites.get(far[g.previous().corner()] as usize) else {
                links.broken = true;
                continue;
            };
            let [a, b, c] = self.corners[t % EdgeTester::ROOM];
            self.batch.set(lane % InCircleBatch::LANES, a, b, c, d);
        }
        links.broken |= wrong != 0;
        let doubtful = self.batch.inside_or_in_doubt(links.count);
        // Branch-free: about one edge in seven fails, and which one is unpredictable.
        let mut found = 0;
        for (&h, doubt) in self.edges.iter().zip(doubtful).take(links.count) {
            self.found[found % EdgeTester::ROOM_FOR_EDGES] = h;
            found += doubt as usize;
        }
        failing.extend_from_slice(&self.found[..found]);
        links
    }

    /// Lists the edges of a block of triangles, the first of which has the half-edge `start`, that lead to triangles before them; returns
    /// their number.
    #[inline(always)]
    fn list(&mut self, block: &[[u32; 8]], start: u32, front: u32) -> usize {
        let mut count = 0;
        // Branch-free, as one half-edge in two is listed.
        for (t, record) in (start..).step_by(8).zip(block) {
            for i in 0..3 {
                self.edges[count % EdgeTester::ROOM_FOR_EDGES] = ClosedEdge(t + i);
                // Slots, which come before the front, wrap around, and so do not count as before the triangle.
                let twin = record[4 + i as usize].wrapping_sub(front);
                count += (twin < t + i - front) as usize;
            }
        }
        count
    }
}
