//! The bits that the flip rounds keep for each triangle, 32 to a number. They lie in four sections of one buffer: three for the dirty
//! triangles of the round before, of this round and of the next, which take turns, and one for the inverted triangles.

use std::ops::Range;

/// Where the sections lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlipMarks {
    /// The length of a section.
    pub words: usize,
}

impl FlipMarks {
    /// The section of the inverted triangles.
    const INVERTED: usize = 3;

    /// Returns the sections for `triangles` triangles.
    pub fn of(triangles: usize) -> FlipMarks {
        FlipMarks { words: triangles.div_ceil(32) }
    }

    /// Returns the length of all sections.
    pub fn numbers(self) -> usize {
        4 * self.words
    }

    /// Returns where the triangles are marked that `round` tests. In the first round, 1, it tests all.
    pub fn dirty(self, round: u32) -> Range<usize> {
        self.section(round as usize % 3)
    }

    /// Returns where the triangles are marked that were not counterclockwise when they were last tested.
    pub fn inverted(self) -> Range<usize> {
        self.section(FlipMarks::INVERTED)
    }

    fn section(self, section: usize) -> Range<usize> {
        section * self.words..(section + 1) * self.words
    }
}
