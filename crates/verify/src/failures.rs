//! The failures that may be found in many places, counted, each with one example.

use std::collections::BTreeMap;

/// What can be wrong with a tile, a triangle, an edge or a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Failure {
    UnusableTile,
    OffLattice,
    NotCounterclockwise,
    Overused,
    NotDelaunay,
    Unused,
    PlaceDiffers,
    ShadingDiffers,
    NotAtHeightOfLine,
    InDisc,
}

impl Failure {
    fn plural(self) -> &'static str {
        match self {
            Failure::UnusableTile => "tiles that cannot be used",
            Failure::OffLattice => "vertices not on the lattice",
            Failure::NotCounterclockwise => "triangles not counterclockwise",
            Failure::Overused => "edges used more than once in one direction",
            Failure::NotDelaunay => "edges not Delaunay",
            Failure::Unused => "vertices without a triangle",
            Failure::PlaceDiffers => "sites at different places in different tiles",
            Failure::NotAtHeightOfLine => "vertices at another height than their breakline",
            Failure::InDisc => "vertices in the closed disc of an edge along a breakline",
            Failure::ShadingDiffers => {
                "sites with different normals, colours, classes or intensities in different tiles"
            }
        }
    }
}

/// Counts each kind of failure and keeps the first example of the first tile that has one, whatever the order of checking.
#[derive(Debug, Default)]
pub(super) struct Failures(BTreeMap<Failure, Occurrences>);

#[derive(Debug)]
struct Occurrences {
    count: u64,
    /// The tile of the example.
    tile: u32,
    example: String,
}

impl Failures {
    pub(super) fn note(&mut self, failure: Failure, tile: u32, example: impl FnOnce() -> String) {
        self.add(failure, 1, tile, example);
    }

    pub(super) fn merge(&mut self, other: Failures) {
        for (failure, Occurrences { count, tile, example }) in other.0 {
            self.add(failure, count, tile, || example);
        }
    }

    fn add(&mut self, failure: Failure, count: u64, tile: u32, example: impl FnOnce() -> String) {
        match self.0.get_mut(&failure) {
            None => {
                self.0.insert(failure, Occurrences { count, tile, example: example() });
            }
            Some(known) => {
                known.count += count;
                if tile < known.tile {
                    (known.tile, known.example) = (tile, example());
                }
            }
        }
    }

    /// Returns one sentence for each kind; `name` gives the name of a tile.
    pub(super) fn sentences(&self, name: impl Fn(u32) -> String) -> Vec<String> {
        let sentence = |(failure, found): (&Failure, &Occurrences)| {
            let name = name(found.tile);
            format!("{} {}, the first in {name}: {}", found.count, failure.plural(), found.example)
        };
        self.0.iter().map(sentence).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_is_the_first_of_the_first_tile() {
        let text = |number: u32| move || number.to_string();
        let (mut some, mut others) = (Failures::default(), Failures::default());
        some.note(Failure::Unused, 2, text(1));
        some.note(Failure::Unused, 2, text(2));
        others.note(Failure::Unused, 1, text(3));
        others.note(Failure::OffLattice, 0, text(4));
        some.merge(others);
        let name = |tile: u32| ["a", "b"][tile as usize].to_owned();
        let sentences = [
            "1 vertices not on the lattice, the first in a: 4".to_owned(),
            "3 vertices without a triangle, the first in b: 3".to_owned(),
        ];
        assert_eq!(some.sentences(name), sentences);
    }
}
