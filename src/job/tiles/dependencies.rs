//! Which tiles can be written while others are still triangulated.
//!
//! A tile is **settled** by the node that hands none of its sites up: no node above can give it another triangle, so once that node is
//! done its seams are complete, and its frontier can be stitched. Its own triangles may have corners in other tiles, whose normals
//! are finished when those tiles are stitched. Then it can be written.

/// A tile whose triangles are all known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settled {
    /// The tile.
    pub tile: usize,
    /// The node of the tree above which no seam touches it. Any node above that will do as well, once it is merged.
    pub by: usize,
}

/// Keeps account of which tiles wait for which.
pub struct Ready {
    /// Those that are stitched.
    stitched: Vec<Option<Settled>>,
    /// How many of its neighbours each of them still waits for.
    missing: Vec<usize>,
    /// The stitched tiles that wait for a tile.
    waiting: Vec<Vec<Settled>>,
}

impl Ready {
    /// For so many tiles, none of them stitched.
    pub fn new(tiles: usize) -> Ready {
        Ready { stitched: vec![None; tiles], missing: vec![0; tiles], waiting: vec![Vec::new(); tiles] }
    }

    /// Takes note that a tile is stitched, whose own triangles have corners in these other tiles, each named once. Returns the tiles
    /// that can be written now.
    pub fn stitched(&mut self, settled: Settled, neighbours: &[u32]) -> Vec<Settled> {
        self.stitched[settled.tile] = Some(settled);
        for neighbour in neighbours.iter().map(|&neighbour| neighbour as usize) {
            if self.stitched[neighbour].is_none() {
                self.missing[settled.tile] += 1;
                self.waiting[neighbour].push(settled);
            }
        }
        let mut ready = Vec::new();
        for waiting in std::mem::take(&mut self.waiting[settled.tile]) {
            self.missing[waiting.tile] -= 1;
            ready.extend((self.missing[waiting.tile] == 0).then_some(waiting));
        }
        ready.extend((self.missing[settled.tile] == 0).then_some(settled));
        ready
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever the order: every tile once, as soon as it and its neighbours are stitched.
        #[test]
        fn a_tile_is_ready_when_all_its_neighbours_are(
            edges in prop::collection::btree_set((0u32..12, 0u32..12), 0..40),
            order in Just((0..12).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            let neighbours = |tile: usize| {
                edges.iter().filter(|(a, b)| *a as usize == tile && a != b).map(|edge| edge.1).collect::<Vec<u32>>()
            };
            let mut ready = Ready::new(12);
            let mut written = Vec::new();
            for (at, &tile) in order.iter().enumerate() {
                let stitched = &order[..=at];
                for settled in ready.stitched(Settled { tile, by: tile + 100 }, &neighbours(tile)) {
                    prop_assert_eq!(settled.by, settled.tile + 100);
                    written.push(settled.tile);
                }
                written.sort_unstable();
                let all_there = |tile: usize| neighbours(tile).iter().all(|&n| stitched.contains(&(n as usize)));
                let mut expected: Vec<usize> = stitched.iter().copied().filter(|&tile| all_there(tile)).collect();
                expected.sort_unstable();
                prop_assert_eq!(&written, &expected);
            }
        }
    }
}
