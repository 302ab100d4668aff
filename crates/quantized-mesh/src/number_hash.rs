//! Maps of small numbers, with a hash that is faster than that of the standard library. Nothing depends on their order.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A map from numbers.
pub(crate) type NumberMap<K, V> = HashMap<K, V, BuildHasherDefault<NumberHasher>>;

/// Multiplies by an odd number without a pattern, as in Knuth, "The Art of Computer Programming", 6.4.
#[derive(Clone, Copy, Default)]
pub(crate) struct NumberHasher(u64);

impl NumberHasher {
    fn add(&mut self, number: u64) {
        const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
        self.0 = (self.0.rotate_left(23) ^ number).wrapping_mul(FACTOR);
    }
}

impl Hasher for NumberHasher {
    fn write(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks::<4>();
        words.iter().for_each(|word| self.add(u32::from_le_bytes(*word).into()));
        rest.iter().for_each(|byte| self.add((*byte).into()));
    }

    /// The length of a key, which is the same for all of a map.
    fn write_usize(&mut self, _: usize) {}

    /// The upper bits are the best ones, and maps look at the lower ones too.
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hash::BuildHasher;

    #[test]
    fn neighbours_are_far_apart() {
        let hash = |key: [u32; 2]| BuildHasherDefault::<NumberHasher>::default().hash_one(key);
        let (mut low, mut high) = ([0u32; 256], [0u32; 128]);
        let keys = (0..256).flat_map(|a| (0..256).map(move |b| [a, b]));
        let all: std::collections::HashSet<u64> = keys.map(hash).collect();
        all.iter().for_each(|hash| {
            low[(hash & 255) as usize] += 1;
            high[(hash >> 57) as usize] += 1;
        });
        assert_eq!(all.len(), 1 << 16);
        assert!(low.iter().all(|count| (128..512).contains(count)), "{low:?}");
        assert!(high.iter().all(|count| (256..1024).contains(count)), "{high:?}");
    }
}
