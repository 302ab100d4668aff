//! Hash tables with keys of two numbers, which are looked up several times for every subsegment.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A hash table with keys of a few small numbers. Nothing depends on the order of its entries.
pub(crate) type FastMap<K, V> = HashMap<K, V, BuildHasherDefault<FastHasher>>;

/// Mixes numbers with one multiplication each. The standard hasher takes several times as long, to withstand keys that were made to
/// collide. Places of sites could be made so too, but they would only make their own job slow.
#[derive(Debug, Default)]
pub(crate) struct FastHasher(u64);

impl Hasher for FastHasher {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(byte.into()));
    }

    fn write_u32(&mut self, value: u32) {
        self.write_u64(value.into());
    }

    fn write_i32(&mut self, value: i32) {
        self.write_u64(u64::from(value as u32));
    }

    fn write_u64(&mut self, value: u64) {
        let mixed = u128::from((self.0 ^ value).wrapping_add(0x9e37_79b9_7f4a_7c15)) * 0xa076_1d64_78bd_642f;
        self.0 = mixed as u64 ^ (mixed >> 64) as u64;
    }

    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }
}
