//! Clouds of sites for the tests of meshes.

use super::common::shared;
use super::random::Random;
use delaunay::geometry::Site;
use std::collections::BTreeSet;

pub(crate) struct Cloud {
    pub(crate) name: &'static str,
    pub(crate) sites: Vec<Site>,
}

fn distinct(sites: impl IntoIterator<Item = Site>) -> Vec<Site> {
    sites.into_iter().collect::<BTreeSet<_>>().into_iter().collect()
}

impl Random {
    /// Returns a site of a square.
    fn site(&mut self, side: u32) -> Site {
        [self.below(side) as i32, self.below(side) as i32]
    }

    /// Returns a number that is nearly normally distributed.
    fn normal(&mut self, deviation: u32) -> i32 {
        (0..12).map(|_| self.below(deviation) as i32).sum::<i32>() - 6 * deviation as i32
    }
}

/// Returns clouds that the flip rounds finish.
pub(crate) fn clouds() -> Vec<Cloud> {
    let mut random = Random(0x0123_4567);
    let mut uniform = |count: usize, side: u32| distinct((0..count).map(|_| random.site(side)));
    let mut clouds = vec![
        ("uniform", uniform(30_000, 1 << 20)),
        ("far apart", uniform(20_000, 1 << 29).into_iter().map(|[x, y]| [x - (1 << 28), y - (1 << 28)]).collect()),
        ("coarse", uniform(20_000, 150)),
    ];
    clouds.push(("lattice", (0..20_000).map(|i| [i % 100 * 7, i / 100 * 7]).collect()));
    clouds.push(("oblong lattice", (0..20_000).map(|i| [i % 100 * 7, i / 100 * 3]).collect()));
    let turned = |i: i32| [i % 140 * 17 - i / 140 * 8, i / 140 * 17 + i % 140 * 8];
    clouds.push(("turned lattice", (0..20_000).map(turned).collect()));
    let normal = (0..30_000).map(|_| [random.normal(20_000), random.normal(20_000)]);
    clouds.push(("gaussian", distinct(normal)));
    let centres: Vec<Site> = (0..12).map(|_| random.site(100_000)).collect();
    let clusters = (0..15_000).map(|i| centres[i % 12].map(|c| c + random.normal(1500)));
    clouds.push(("clusters", distinct(clusters)));
    clouds.push(("scan lines", distinct((0..20_000).map(|i| [i % 200 * 10 + random.below(5) as i32, i / 200 * 60]))));
    clouds.into_iter().map(|(name, sites)| Cloud { name, sites }).collect()
}

/// Returns clouds with long chains of flips.
pub(crate) fn hard_clouds() -> Vec<Cloud> {
    let mut random = Random(0x89ab_cdef);
    let is_outside = |&[x, y]: &Site| (x - 1500).pow(2) + (y - 1500).pow(2) > 1_000_000;
    let around = distinct((0..30_000).map(|_| random.site(3000)).filter(is_outside));
    let angle = |i: u32| f64::from(i) / 2000.0 * std::f64::consts::TAU;
    let circle =
        distinct((0..2000).map(|i| [(angle(i).cos() * 1e6).round() as i32, (angle(i).sin() * 1e6).round() as i32]));
    let parabola = (0..2000).map(|i| [i * 3, i * i]).collect();
    vec![
        Cloud { name: "around a void", sites: around },
        Cloud { name: "circle", sites: circle },
        Cloud { name: "parabola", sites: parabola },
    ]
}

/// Returns the sites near the middle of a real cloud, in its own steps, if the shared test data are there.
pub(crate) fn real_cloud() -> Option<Cloud> {
    let path = shared()?.join("data/autzen_trim.las");
    let points = las::Reader::from_path(&path).and_then(|mut reader| reader.read_all()).expect("the file can be read");
    let all = distinct(points.x_raw().zip(points.y_raw()).map(|(x, y)| [x, y]));
    let middle = [0, 1].map(|k| {
        let mut coordinates: Vec<_> = all.iter().map(|site| site[k]).collect();
        coordinates.sort_unstable();
        coordinates[coordinates.len() / 2]
    });
    let mut sites: Vec<Site> = all.iter().map(|[x, y]| [x - middle[0], y - middle[1]]).collect();
    sites.sort_by_key(|[x, y]| x.abs().max(y.abs()));
    sites.truncate(40_000);
    sites.sort_unstable();
    Some(Cloud { name: "autzen", sites })
}
