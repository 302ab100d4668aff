//! Random numbers for the tests.

use delaunay_gpu::texture_size::TextureSize;

/// A small generator (xorshift64*), so that cases are the same on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32) % u64::from(end)) as u32
    }

    /// Returns `count` pixels (y << 16 | x), which may contain duplicates.
    pub(crate) fn pixels(&mut self, size: TextureSize, count: usize) -> Vec<u32> {
        (0..count).map(|_| self.below(size.height) << 16 | self.below(size.width)).collect()
    }
}
