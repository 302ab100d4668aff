//! What the benchmarks share: generated sites, and the median.

use delaunay::geometry::Site;

/// A small generator: xorshift64*.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> [f64; 2] {
        let (r, a) = ((-2.0 * (1.0 - self.unit()).ln()).sqrt(), std::f64::consts::TAU * self.unit());
        [r * a.cos(), r * a.sin()]
    }
}

/// Returns `n` sites in a square, uniformly distributed.
pub(crate) fn uniform(n: usize) -> Vec<Site> {
    let mut random = Random(1);
    distinct((0..n).map(|_| [0; 2].map(|_| (random.unit() * 1e8) as i32)).collect())
}

/// Returns `n` sites around a centre, normally distributed.
pub(crate) fn gaussian(n: usize) -> Vec<Site> {
    let mut random = Random(2);
    distinct((0..n).map(|_| random.normal().map(|c| (c * 1e7) as i32)).collect())
}

/// Returns the distinct sites, in the order in which they first occur.
pub(crate) fn distinct(mut sites: Vec<Site>) -> Vec<Site> {
    let mut seen = std::collections::HashSet::with_capacity(sites.len());
    sites.retain(|&s| seen.insert(s));
    sites
}

/// Returns the median of `times`.
pub(crate) fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
