//! Textures of sites for the tests.

use gdt_batch::gpu::texture_size::TextureSize;

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

    /// Returns pixels in `spots` heaps with wide voids between them.
    pub(crate) fn heaps(&mut self, size: TextureSize, count: usize, spots: usize) -> Vec<u32> {
        let centres = self.pixels(size, spots);
        let reach = (size.width.min(size.height) / 16).max(1);
        let near = |random: &mut Random, centre: u32, side: u32| (centre + random.below(reach)).min(side - 1);
        (0..count)
            .map(|i| {
                let centre = centres[i % spots];
                near(self, centre >> 16, size.height) << 16 | near(self, centre & 0xffff, size.width)
            })
            .collect()
    }
}

/// Returns the cases of the tests: a name, the size of the texture, the pixels of the sites.
pub(crate) fn cases() -> Vec<(&'static str, TextureSize, Vec<u32>)> {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let size = |width, height| TextureSize { width, height };
    let all = |size: TextureSize| (0..size.height).flat_map(|y| (0..size.width).map(move |x| y << 16 | x)).collect();
    let row = |y: u32, width: u32| (0..width).map(|x| y << 16 | x).collect();
    let column = |x: u32, height: u32| (0..height).map(|y| y << 16 | x).collect();
    let mut cases = vec![
        ("one pixel, empty", size(1, 1), vec![]),
        ("one pixel, full", size(1, 1), vec![0]),
        ("two pixels", size(2, 1), vec![1]),
        ("four pixels, full", size(2, 2), all(size(2, 2))),
        ("empty", size(100, 70), vec![]),
        ("one site", size(300, 200), vec![77 << 16 | 299]),
        ("full", size(257, 129), all(size(257, 129))),
        ("twice the same", size(40, 40), [random.pixels(size(40, 40), 100), random.pixels(size(40, 40), 100)].concat()),
        ("one row", size(1000, 1), random.pixels(size(1000, 1), 60)),
        ("one column", size(1, 1000), random.pixels(size(1, 1000), 60)),
        ("two rows", size(777, 2), random.pixels(size(777, 2), 60)),
        ("two columns", size(2, 777), random.pixels(size(2, 777), 60)),
        ("a row of sites", size(600, 400), row(399, 600)),
        ("a column of sites", size(600, 400), column(0, 400)),
        ("a frame of sites", size(300, 300), [row(0, 300), row(299, 300), column(0, 300), column(299, 300)].concat()),
        ("a lattice", size(640, 480), (0..300).map(|i| (i / 20 * 32) << 16 | (i % 20 * 32)).collect()),
    ];
    for (name, w, h, count) in [
        ("tiny", 7, 5, 6),
        ("dense", 513, 511, 100_000),
        ("five pixels a site", 1000, 900, 180_000),
        ("sparse", 1024, 1024, 40),
        ("wide", 4096, 100, 2000),
        ("high", 100, 4096, 2000),
    ] {
        cases.push((name, size(w, h), random.pixels(size(w, h), count)));
    }
    cases.push(("heaps", size(1024, 768), random.heaps(size(1024, 768), 50_000, 12)));
    cases.push(("large", size(2048, 2048), random.pixels(size(2048, 2048), 1 << 20)));
    cases.push(("large and sparse", size(2048, 2048), random.pixels(size(2048, 2048), 5000)));
    cases
}
