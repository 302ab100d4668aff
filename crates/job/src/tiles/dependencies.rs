//! Which tiles can be written while others are still triangulated.
//!
//! A tile is **finished** once a merge node passes none of its sites up: no node above can give it another triangle. Then its seam is
//! complete and the normals on its border can be finished. Its own triangles may have corners in other tiles, whose normals are
//! finished with those tiles. After them it can be written.

use crate::index::{NodeIndex, TileIndex};

/// A tile whose triangles are all known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FinishedTile {
    /// The tile.
    pub tile: TileIndex,
    /// A merged node above which no seam touches the tile.
    pub last_merge: NodeIndex,
}

/// Which tiles wait for which.
pub(crate) struct TileDependencies {
    /// The tiles whose border normals are done.
    done: Vec<Option<FinishedTile>>,
    /// The number of neighbours that each of them still waits for.
    missing: Vec<usize>,
    /// For each tile, the done tiles that wait for it.
    waiting: Vec<Vec<FinishedTile>>,
}

impl TileDependencies {
    /// Returns the state for this number of tiles, none of them done.
    pub(crate) fn new(tiles: usize) -> TileDependencies {
        TileDependencies { done: vec![None; tiles], missing: vec![0; tiles], waiting: vec![Vec::new(); tiles] }
    }

    /// Notes that the border normals of a tile are done. Its own triangles have corners in the tiles `neighbours`, which names each
    /// once. Returns the tiles that can be written now.
    pub(crate) fn border_done(&mut self, finished: FinishedTile, neighbours: &[TileIndex]) -> Vec<FinishedTile> {
        let tile = finished.tile.get();
        self.done[tile] = Some(finished);
        for neighbour in neighbours.iter().map(|neighbour| neighbour.get()) {
            if self.done[neighbour].is_none() {
                self.missing[tile] += 1;
                self.waiting[neighbour].push(finished);
            }
        }
        let mut ready = Vec::new();
        for waiting in std::mem::take(&mut self.waiting[tile]) {
            let missing = &mut self.missing[waiting.tile.get()];
            *missing -= 1;
            ready.extend((*missing == 0).then_some(waiting));
        }
        ready.extend((self.missing[tile] == 0).then_some(finished));
        ready
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::PartIndex;
    use proptest::prelude::*;

    proptest! {
        /// In whatever order the borders are done: every tile comes once, as soon as its border and those of its neighbours are.
        #[test]
        fn a_tile_is_ready_when_its_border_and_its_neighbours_are_done(
            edges in prop::collection::btree_set((0usize..12, 0usize..12), 0..40),
            order in Just((0..12).collect::<Vec<usize>>()).prop_shuffle(),
        ) {
            let neighbours = |tile: usize| {
                let edges = edges.iter().filter(|(a, b)| *a == tile && a != b);
                edges.map(|edge| PartIndex::FIRST.tile(edge.1)).collect::<Vec<TileIndex>>()
            };
            let mut dependencies = TileDependencies::new(12);
            let mut written = Vec::new();
            for (at, &tile) in order.iter().enumerate() {
                let done = &order[..=at];
                let finished = FinishedTile { tile: PartIndex::FIRST.tile(tile), last_merge: NodeIndex::new(tile + 100) };
                for ready in dependencies.border_done(finished, &neighbours(tile)) {
                    prop_assert_eq!(ready.last_merge.get(), ready.tile.get() + 100);
                    written.push(ready.tile.get());
                }
                written.sort_unstable();
                let all_there = |tile: usize| neighbours(tile).iter().all(|n| done.contains(&n.get()));
                let mut expected: Vec<usize> = done.iter().copied().filter(|&tile| all_there(tile)).collect();
                expected.sort_unstable();
                prop_assert_eq!(&written, &expected);
            }
        }
    }
}
