//! Sets of segments: which segments an edge is a part of.

use crate::fast_hash::FastMap;
use std::collections::BTreeMap;

/// A segment that an edge is a part of, and whether its way goes over the edge an odd number of times. A way that goes back and forth
/// encloses nothing, so only odd ones count for what is inside a lake.
pub(crate) type Owner = (u32, bool);

/// Sets of segments by number. Most have one segment. Others are made of two sets, so that each takes the same few bytes, however many
/// segments it has.
#[derive(Debug, Default)]
pub(crate) struct Owners {
    /// The numbers below this are those of the sets of one segment, which they are the numbers of.
    singles: u32,
    /// The two sets that each of the others is made of. Both have lesser numbers.
    joined: Vec<[u32; 2]>,
    known: FastMap<[u32; 2], u32>,
}

impl Owners {
    /// Returns the sets of each one of `segments` segments.
    pub(crate) fn new(segments: usize) -> Owners {
        Owners { singles: segments as u32, joined: Vec::new(), known: FastMap::default() }
    }

    /// Returns the number of sets that have been made of others.
    pub(crate) fn len(&self) -> usize {
        self.joined.len()
    }

    /// Returns the segments of a set, sorted.
    pub(crate) fn of(&self, set: u32) -> Vec<Owner> {
        if set < self.singles {
            return vec![(set, true)];
        }
        // The sets that are still to be taken apart, the greatest number first. Each is met in all its places before it is taken apart.
        let mut sets = BTreeMap::from([(set, true)]);
        let mut owners = Vec::new();
        while let Some((set, is_odd)) = sets.pop_last() {
            match set.checked_sub(self.singles) {
                None => owners.push((set, is_odd)),
                Some(joined) => {
                    for part in self.joined[joined as usize] {
                        *sets.entry(part).or_insert(false) ^= is_odd;
                    }
                }
            }
        }
        owners.reverse();
        owners
    }

    /// Returns the set of an edge that both ways go over.
    pub(crate) fn join(&mut self, one: u32, other: u32) -> u32 {
        let parts = [one.min(other), one.max(other)];
        *self.known.entry(parts).or_insert_with(|| {
            self.joined.push(parts);
            self.singles + (self.joined.len() - 1) as u32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_know_how_often_each_segment_is_in_them() {
        let mut owners = Owners::new(9);
        let both = owners.join(3, 1);
        assert_eq!(owners.of(both), [(1, true), (3, true)]);
        let again = owners.join(both, 3);
        assert_eq!(owners.of(again), [(1, true), (3, false)]);
        assert_eq!((owners.join(1, 3), owners.join(3, both), owners.len()), (both, again, 2));
        let all = owners.join(again, both);
        assert_eq!(owners.of(all), [(1, false), (3, true)]);
        assert_eq!(owners.of(7), [(7, true)]);
    }

    /// Each edge that another line goes over makes one set more, with all segments of the set before.
    #[test]
    fn many_large_sets_take_little() {
        let mut owners = Owners::new(100_000);
        let last = (1..100_000).fold(0, |set, segment| owners.join(set, segment));
        assert_eq!((owners.len(), owners.of(last).len()), (99_999, 100_000));
        // Joined with themselves again and again, sets have the same segments.
        let doubled = (0..60).fold(last, |set, _| owners.join(set, set));
        assert!(owners.of(doubled).len() == 100_000 && owners.of(doubled).iter().all(|(_, is_odd)| !is_odd));
    }
}
