//! Sets of segments: which segments an edge is a part of.

use std::collections::HashMap;

/// A segment that an edge is a part of, and whether its way goes over the edge an odd number of times. A way that goes back and forth
/// encloses nothing, so only odd ones count for what is inside a lake.
pub(crate) type Owner = (u32, bool);

/// Sets of segments by number. Most have one segment.
#[derive(Clone, Debug)]
pub(crate) struct Owners {
    /// The numbers below this are those of the sets of one segment, which they are the numbers of.
    singles: u32,
    sets: Vec<Vec<Owner>>,
    known: HashMap<Vec<Owner>, u32>,
}

impl Owners {
    /// Returns the sets of each one of `segments` segments.
    pub(crate) fn new(segments: usize) -> Owners {
        Owners { singles: segments as u32, sets: Vec::new(), known: HashMap::new() }
    }

    /// Returns the segments of a set, sorted.
    pub(crate) fn of(&self, set: u32) -> impl Iterator<Item = Owner> + '_ {
        let larger = set.checked_sub(self.singles);
        let single = larger.is_none().then_some((set, true));
        let larger = larger.map_or(&[][..], |larger| &self.sets[larger as usize][..]);
        single.into_iter().chain(larger.iter().copied())
    }

    /// Returns the set of an edge that both ways go over.
    pub(crate) fn join(&mut self, one: u32, other: u32) -> u32 {
        let mut all: Vec<Owner> = self.of(one).chain(self.of(other)).collect();
        all.sort_unstable();
        let joined: Vec<Owner> = all
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| (same[0].0, same.iter().filter(|(_, is_odd)| *is_odd).count() % 2 == 1))
            .collect();
        match joined[..] {
            [(segment, true)] => segment,
            _ => *self.known.entry(joined).or_insert_with_key(|joined| {
                self.sets.push(joined.clone());
                self.singles + (self.sets.len() - 1) as u32
            }),
        }
    }
}
