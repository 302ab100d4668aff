//! The edges of a tile that levels cross.

/// What a side of a triangle has instead of the number of an edge if no level crosses it.
pub(crate) const NONE: u32 = u32::MAX;

/// An edge between vertices of different heights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossedEdge {
    /// The numbers of its vertices.
    pub(crate) low: u32,
    pub(crate) high: u32,
    /// The numbers of the levels that cross it: the first, and the one after the last.
    pub(crate) levels: [u32; 2],
}

impl CrossedEdge {
    /// Returns those of its levels that are from number `from` on, before number `to`.
    #[inline]
    pub(crate) fn within(&self, [from, to]: [u32; 2]) -> [u32; 2] {
        let first = self.levels[0].max(from);
        [first, self.levels[1].min(to).max(first)]
    }
}

/// The edges that levels cross, and where triangles have them.
#[derive(Debug, Default)]
pub(crate) struct CrossingEdges {
    pub(crate) edges: Vec<CrossedEdge>,
    /// For each triangle that has some, the numbers of the edges at its sides: from its first corner to its second, and so on.
    pub(crate) triangles: Vec<TriangleEdges>,
}

/// A triangle that levels cross.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleEdges {
    /// The edges at its sides, or [`NONE`].
    pub(crate) edges: [u32; 3],
    /// Whether a side goes down, along the triangle's own direction.
    pub(crate) goes_down: [bool; 3],
}

impl CrossingEdges {
    /// Finds the edges of `triangles`. `counts` has for each vertex how many levels are at it or below.
    pub(crate) fn of(triangles: &[[u32; 3]], counts: &[u32]) -> CrossingEdges {
        let count = |v: u32| counts[v as usize];
        let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        // Each vertex has room for all edges that begin at it as their low end, once for each of their triangles.
        let mut rooms = vec![0u32; counts.len() + 1];
        for [a, b] in triangles.iter().flat_map(sides).filter(|&[a, b]| count(a) != count(b)) {
            rooms[if count(a) < count(b) { a } else { b } as usize + 1] += 1;
        }
        for v in 0..counts.len() {
            rooms[v + 1] += rooms[v];
        }
        let mut known = vec![(NONE, NONE); rooms[counts.len()] as usize];
        let mut found = CrossingEdges::default();
        for triangle in triangles {
            let mut own = TriangleEdges { edges: [NONE; 3], goes_down: [false; 3] };
            for (side, [a, b]) in sides(triangle).into_iter().enumerate() {
                if count(a) == count(b) {
                    continue;
                }
                let goes_down = count(a) > count(b);
                let [low, high] = if goes_down { [b, a] } else { [a, b] };
                let next = found.edges.len() as u32;
                let room = &mut known[rooms[low as usize] as usize..rooms[low as usize + 1] as usize];
                let place = room.iter_mut().find(|(end, _)| *end == high || *end == NONE);
                // There is always room.
                let Some(place) = place else { continue };
                if place.0 == NONE {
                    *place = (high, next);
                    found.edges.push(CrossedEdge { low, high, levels: [count(low), count(high)] });
                }
                own.edges[side] = place.1;
                own.goes_down[side] = goes_down;
            }
            if own.edges != [NONE; 3] {
                found.triangles.push(own);
            }
        }
        found
    }
}
