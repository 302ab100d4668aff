//! Random sites of every kind that is known to be hard.

use crate::geometry::Site;
use std::collections::BTreeSet;

/// A small generator (xorshift64*), so that cases are the same on every machine.
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Returns a number from 0 to `end` - 1.
    pub fn below(&mut self, end: i32) -> i32 {
        ((self.next() >> 33) % end as u64) as i32
    }

    /// Returns a number from 0 to 1, without 1.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The kinds of input that are known to be hard.
pub const KINDS: [&str; 15] = [
    "uniform",
    "coarse",
    "disc",
    "circle",
    "rotated lattice",
    "lattice",
    "collinear",
    "parallelogram",
    "clusters",
    "void",
    "line and one",
    "two lines",
    "cross",
    "parabola",
    "facing arcs",
];

/// Returns about `n` distinct sites of one of the [`KINDS`].
pub fn case(kind: &str, n: usize, random: &mut Random) -> Vec<Site> {
    let range = [30, 1000, 1 << 20, 1 << 28][random.below(4) as usize];
    let side = 1 + random.below(range).max((n as f64).sqrt() as i32);
    let turn = random.unit() * std::f64::consts::TAU;
    let root = (n as f64).sqrt().ceil() as i32;
    let (p, q) = (1 + random.below(20), random.below(20));
    let [ax, ay, bx, by] = [0; 4].map(|_| random.below(2000) - 1000);
    let (cx, cy, spots) = (random.below(1000), random.below(1000), 1 + random.below(20));
    let centres: Vec<_> = (0..spots).map(|_| [random.below(100_000), random.below(100_000)]).collect();
    let site = |i: i32, random: &mut Random| -> Site {
        match kind {
            "uniform" => [random.below(side), random.below(side)],
            "coarse" => [random.below(root + 2), random.below(root + 2)],
            "disc" => {
                let (r, a) = (random.unit().sqrt() * side as f64, random.unit() * std::f64::consts::TAU);
                [(r * a.cos()) as i32, (r * a.sin()) as i32]
            }
            "circle" => {
                let a = random.unit() * std::f64::consts::TAU;
                [(side as f64 * a.cos()).round() as i32, (side as f64 * a.sin()).round() as i32]
            }
            "rotated lattice" => [i % root * p - i / root * q, i % root * q + i / root * p],
            "lattice" => [i % root * p, i / root * (q + 1)],
            "collinear" => [ax * i, ay * i + (turn < 1.0 && i == 3) as i32],
            "parallelogram" => [i % root * ax + i / root * bx, i % root * ay + i / root * by],
            "clusters" => {
                let centre = centres[random.below(spots) as usize];
                let spread = (1.0 - random.unit()).ln().abs().sqrt() * 1500.0;
                let a = random.unit() * std::f64::consts::TAU;
                [centre[0] + (spread * a.cos()) as i32, centre[1] + (spread * a.sin()) as i32]
            }
            "line and one" if i == 0 => [by * 50, cx * 70],
            "line and one" => [ax * i, ay * i],
            "two lines" => [ax * (i / 2) + i % 2 * bx, ay * (i / 2) + i % 2 * by],
            "cross" => [[ax * i, ay * i], [by * i, bx * i]][(i % 2) as usize],
            "parabola" => [i * p, i * i],
            "facing arcs" => [i * p, [i * (n as i32 - i), 500 * n as i32 - i * (n as i32 - i)][(i % 2) as usize]],
            _ => loop {
                let at = [random.below(1000), random.below(1000)];
                if (at[0] - cx).pow(2) + (at[1] - cy).pow(2) > 400 * 400 {
                    break at;
                }
            },
        }
    };
    let mut sites: Vec<_> = (0..n as i32).map(|i| site(i, random)).collect();
    let mut seen = BTreeSet::new();
    sites.retain(|&s| seen.insert(s));
    sites
}
