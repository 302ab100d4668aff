//! Coarser lines, for terrains that are seen from afar.
//!
//! A line between two places where lines meet or end keeps every second of its sites at level 1, every fourth at level 2, and so on. What
//! is left of it is an edge again if no vertex lies in the closed disc of its longer pieces.

use crate::box_tree::BoxTree;
use crate::exact::{disc_box, in_disc, meet};
use delaunay::geometry::{Bounds, Site};

/// The level at which a place where lines meet or end is left out: none.
const NEVER: u8 = u8::MAX;

/// Into how many lines a closed one without such a place is cut, so that something is left of it.
const QUARTERS: usize = 4;

/// The coarser lines of breaklines.
#[derive(Clone, Debug)]
pub(crate) struct LineLevels {
    /// The highest level that still has the site.
    ranks: Vec<u8>,
    /// The pieces of each level from 1 on, of lines that have fewer sites there than on the level before.
    pieces: Vec<BoxTree<[Site; 2]>>,
}

impl LineLevels {
    /// Returns the levels of the lines between `places`.
    pub(crate) fn new(places: &[Site], subsegments: &[[u32; 2]]) -> LineLevels {
        let mut ranks = vec![NEVER; places.len()];
        let mut pieces: Vec<Vec<(Bounds<2>, [Site; 2])>> = Vec::new();
        for chain in Chains::new(places.len(), subsegments).all() {
            let last = chain.len() - 1;
            for (i, &site) in chain.iter().enumerate().take(last).skip(1) {
                ranks[site as usize] = i.trailing_zeros() as u8;
            }
            let levels = usize::BITS - (last - 1).leading_zeros();
            for level in 1..=levels as usize {
                pieces.resize_with(pieces.len().max(level), Vec::new);
                let stops: Vec<Site> =
                    (0..last).step_by(1 << level).chain([last]).map(|i| places[chain[i] as usize]).collect();
                let longer = stops.windows(2).map(|pair| [pair[0], pair[1]]);
                pieces[level - 1].extend(longer.map(|[a, b]| (disc_box(a, b), [a, b])));
            }
        }
        LineLevels { ranks, pieces: pieces.into_iter().map(BoxTree::new).collect() }
    }

    /// Returns the highest level that still has the site.
    pub(crate) fn rank(&self, site: usize) -> u8 {
        self.ranks[site]
    }

    /// Returns whether `place` lies in the closed disc of a piece of a level up to `level`, and is none of its ends.
    pub(crate) fn bar(&self, place: Site, level: u8) -> bool {
        let point = Bounds::of_point(place);
        let is_inside = |[a, b]: [Site; 2]| ![a, b].contains(&place) && in_disc(a, b, place);
        self.pieces.iter().take(level.into()).any(|pieces| pieces.any(|bounds| meet(bounds, &point), is_inside))
    }
}

/// The lines between places where lines meet or end.
struct Chains {
    /// Where the neighbours of each site are listed.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    is_done: Vec<bool>,
}

impl Chains {
    fn new(sites: usize, subsegments: &[[u32; 2]]) -> Chains {
        let mut starts = vec![0u32; sites + 1];
        subsegments.iter().flatten().for_each(|&site| starts[site as usize + 1] += 1);
        (1..starts.len()).for_each(|i| starts[i] += starts[i - 1]);
        let mut next = starts.clone();
        let mut neighbours = vec![0; 2 * subsegments.len()];
        for &[a, b] in subsegments {
            for [from, to] in [[a, b], [b, a]] {
                neighbours[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Chains { starts, neighbours, is_done: vec![false; sites] }
    }

    fn of(&self, site: u32) -> &[u32] {
        &self.neighbours[self.starts[site as usize] as usize..self.starts[site as usize + 1] as usize]
    }

    /// Returns all lines of two subsegments or more, as sites from end to end.
    fn all(mut self) -> Vec<Vec<u32>> {
        let mut chains = Vec::new();
        let sites = 0..self.is_done.len() as u32;
        for end in sites.clone().filter(|&site| self.of(site).len() != 2).collect::<Vec<_>>() {
            for next in self.of(end).to_vec() {
                chains.push(self.walk(end, next));
            }
        }
        for start in sites {
            if self.of(start).len() == 2 && !self.is_done[start as usize] {
                self.is_done[start as usize] = true;
                let ring = self.walk(start, self.of(start)[0]);
                let quarter = ring.len().div_ceil(QUARTERS);
                let cuts = (0..ring.len() - 1).step_by(quarter);
                chains.extend(cuts.map(|from| ring[from..=(from + quarter).min(ring.len() - 1)].to_vec()));
            }
        }
        chains.retain(|chain| chain.len() > 2);
        chains
    }

    /// Follows a line from `start` over `next` to where it ends. A line that was followed before, from its other end, has only its start.
    fn walk(&mut self, start: u32, next: u32) -> Vec<u32> {
        let (mut chain, mut last) = (vec![start], next);
        while self.of(last).len() == 2 && !std::mem::replace(&mut self.is_done[last as usize], true) {
            let before = chain[chain.len() - 1];
            chain.push(last);
            last = if self.of(last)[0] == before { self.of(last)[1] } else { self.of(last)[0] };
        }
        chain.push(last);
        chain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_every_second_site_from_level_to_level() {
        // A line of ten sites and a ring of eight.
        let places: Vec<Site> = (0..9)
            .map(|i| [10 * i, i % 2])
            .chain([[80, 9]])
            .chain((0..8).map(|i| [200 + 10 * i, i * (7 - i)]))
            .collect();
        let ring = (10..18).map(|i| [i.min(10 + (i - 9) % 8), i.max(10 + (i - 9) % 8)]);
        let pairs: Vec<[u32; 2]> = (0..8).map(|i| [i, i + 1]).chain([[8, 9]]).chain(ring).collect();
        let levels = LineLevels::new(&places, &pairs);
        let ranks: Vec<u8> = (0..10).map(|site| levels.rank(site)).collect();
        assert_eq!(ranks, [NEVER, 0, 1, 0, 2, 0, 1, 0, 3, NEVER]);
        let stay: Vec<usize> = (10..18).filter(|&site| levels.rank(site) > 0).collect();
        assert!((3..8).contains(&stay.len()), "{stay:?}");
        // In the disc from 0 to 20, and in that from 0 to 40.
        assert!(
            !levels.bar([10, 9], 0) && levels.bar([10, 9], 1) && !levels.bar([10, 15], 1) && levels.bar([10, 15], 2)
        );
        assert!(!levels.bar([0, 0], 3) && levels.bar([70, 1], 1));
    }
}
