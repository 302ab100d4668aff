//! Where the levels of step G5's prefix sums lie in their buffer.

use crate::gpu::texture_size::TextureSize;

/// Numbers that are added up to one number of the next level.
pub(super) const BLOCK: u32 = 64;

/// A level of the prefix sums: its first number in the buffer, and how many numbers it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PrefixSumLevel {
    pub(super) first: u32,
    pub(super) length: u32,
}

impl PrefixSumLevel {
    /// Returns the position after the last number of the level.
    pub(super) fn end(self) -> u32 {
        self.first + self.length
    }
}

/// Returns the levels over `count` numbers, at least two. The last level is the total alone.
pub(super) fn levels(count: u32) -> Vec<PrefixSumLevel> {
    let mut last = PrefixSumLevel { first: 0, length: count };
    let mut levels = vec![last];
    loop {
        last = PrefixSumLevel { first: last.end(), length: last.length.div_ceil(BLOCK).max(1) };
        levels.push(last);
        if last.length == 1 {
            return levels;
        }
    }
}

/// Returns where in `BufferId::Counts` the number of all triangles of a texture of `size` lies.
pub(super) fn position_of_total(size: TextureSize) -> u32 {
    levels(size.all_segments()).last().map_or(0, |level| level.first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_with_the_total() {
        let empty = [PrefixSumLevel { first: 0, length: 0 }, PrefixSumLevel { first: 0, length: 1 }];
        assert_eq!(levels(0), empty);
        assert_eq!(levels(1), [PrefixSumLevel { first: 0, length: 1 }, PrefixSumLevel { first: 1, length: 1 }]);
        let lengths: Vec<_> = levels(1_000_000).iter().map(|level| level.length).collect();
        assert_eq!(lengths, [1_000_000, 15_625, 245, 4, 1]);
    }
}
