//! Clouds of random points with integer coordinates, and how to write them to a file.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::random::Random;

impl Random {
    /// Returns a number from 0 to 1, exclusive.
    pub(crate) fn unit(&mut self) -> f64 {
        self.below(1 << 53) as f64 / (1u64 << 53) as f64
    }

    /// Returns two independent normal variables (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> [f64; 2] {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let (sin, cos) = (self.unit() * std::f64::consts::TAU).sin_cos();
        [radius * cos, radius * sin]
    }
}

/// Points x, y, z.
pub(crate) type Cloud = Vec<[i64; 3]>;

/// The side of the square in which the clouds lie.
const SIDE: f64 = 200_000.0;

pub(crate) fn with_heights(places: impl IntoIterator<Item = [i64; 2]>) -> Cloud {
    places.into_iter().enumerate().map(|(i, [x, y])| [x, y, (i as i64 * 7919) % 997]).collect()
}

pub(crate) fn rounded(x: f64, y: f64) -> [i64; 2] {
    [x.round() as i64, y.round() as i64]
}

/// Returns one round blob: dense in the middle, sparse outside.
pub(crate) fn gaussian(count: usize) -> Cloud {
    let mut random = Random(1);
    with_heights((0..count).map(|_| {
        let [u, v] = random.normal();
        rounded(u * SIDE / 6.0, v * SIDE / 6.0)
    }))
}

/// Returns blobs of very different density and a few points anywhere. Many points of the densest blob coincide.
pub(crate) fn clusters(count: usize) -> Cloud {
    let mut random = Random(2);
    let blobs: Vec<[f64; 3]> = (0..32)
        .map(|_| [random.unit() * SIDE, random.unit() * SIDE, 10f64.powf(-4.0 + 2.5 * random.unit()) * SIDE])
        .collect();
    with_heights((0..count).map(|_| {
        let [x, y, sigma] = blobs[random.below(32) as usize];
        let [u, v] = random.normal();
        match random.below(100) {
            0 => rounded(random.unit() * SIDE, random.unit() * SIDE),
            _ => rounded(x + sigma * u, y + sigma * v),
        }
    }))
}

/// Returns points anywhere in a square.
pub(crate) fn uniform(count: usize, side: u64, seed: u64) -> Cloud {
    let mut random = Random(seed);
    with_heights((0..count).map(|_| [random.below(side) as i64, random.below(side) as i64]))
}

/// Writes the cloud as text to the file `name` in `folder`, and returns its path.
pub(crate) fn write(folder: &Path, name: &str, cloud: &[[i64; 3]]) -> PathBuf {
    let mut text = String::from("x,y,z\n");
    for [x, y, z] in cloud {
        writeln!(text, "{x},{y},{z}").unwrap();
    }
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}
