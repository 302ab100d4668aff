//! Random cases of every kind that is known to be hard, against `spade` with canonical flips.

use std::collections::{BTreeMap, BTreeSet};

use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use crate::triangulation::reference;
use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::g2_voronoi::LabelRows;
use crate::voronoi::{PipelineBuffers, PipelineCounts, Rejection, TextureRequest, TextureResolution, triangulate};

/// A small generator (xorshift64*), so that cases are the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, end: i32) -> i32 {
        ((self.next() >> 33) % end as u64) as i32
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

const KINDS: [&str; 10] = [
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
];

fn case(kind: &str, n: usize, random: &mut Random) -> Vec<Site> {
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

/// The triangles, each from its least corner, as a set.
fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.triangles.iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()).collect()
}

#[test]
fn random_cases_are_canonical_or_rejected() {
    let cases = std::env::var("GDT_CASES").ok().and_then(|s| s.parse().ok()).unwrap_or(2000);
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut buffers = PipelineBuffers::default();
    let mut rejected: BTreeMap<(&str, String), usize> = BTreeMap::new();
    let mut refused = 0;
    for i in 0..cases {
        let kind = KINDS[i % KINDS.len()];
        let n = 3 + (2000.0f64.powf(random.unit()) - 1.0) as usize;
        let sites = case(kind, n, &mut random);
        match triangulate(&sites, &mut buffers) {
            Ok((mesh, _)) => assert_eq!(
                triangles(&mesh),
                triangles(&reference::triangulate(&sites).unwrap()),
                "case {i}, {kind}: {sites:?}"
            ),
            Err(why) => {
                refused += (kind == "uniform" && sites.len() >= 1000) as usize;
                *rejected.entry((kind, why.to_string())).or_default() += 1;
            }
        }
    }
    eprintln!("of {} cases of each kind, rejected: {rejected:#?}", cases / KINDS.len());
    assert_eq!(refused, 0, "large uniform cases were rejected");
}

#[test]
fn the_mesh_is_the_same_with_any_texture() {
    let mut random = Random(7);
    let sites: Vec<Site> = (0..5000).map(|i| [200 * i, random.below(1 << 20)]).collect();
    let expected = triangles(&triangulate(&sites, &mut PipelineBuffers::default()).unwrap().0);
    let mut missing = Vec::new();
    for side in [80, 300, 1000] {
        let shape = TextureRequest { resolution: TextureResolution::Side(side), ..TextureRequest::default() };
        let (mesh, counts) = triangulate(&sites, &mut PipelineBuffers::with_shape(shape)).unwrap();
        assert!(triangles(&mesh) == expected, "{side}");
        missing.push(counts.missing);
    }
    assert!(missing.is_sorted_by(|finer, coarser| finer > coarser), "{missing:?}");
}

#[test]
fn uniform_sites_are_never_rejected() {
    let mut random = Random(42);
    let mut buffers = PipelineBuffers::default();
    for n in [1000, 3000, 10_000, 30_000] {
        for side in [1 << 10, 1 << 20, 1 << 28] {
            let mut sites: Vec<Site> = (0..n).map(|_| [random.below(side), random.below(side / 3)]).collect();
            sites.sort_unstable();
            sites.dedup();
            let (_, counts) = triangulate(&sites, &mut buffers).unwrap();
            eprintln!("{counts:?}");
        }
    }
}

/// Between two sites far out on a circle a region is thin, and falls apart; its pieces lie within pieces of the next.
#[test]
fn islands_within_islands_are_taken_out() {
    let mut random = Random(11);
    let mut buffers = PipelineBuffers::default();
    let mut islands = 0;
    for round in 0..400 {
        let sites = case("circle", 100 + 3 * round, &mut random);
        match triangulate(&sites, &mut buffers) {
            Ok((_, counts)) => islands += counts.islands,
            Err(why) => assert_eq!(why, Rejection::Crowded, "{sites:?}"),
        }
    }
    assert!(islands > 100, "{islands}");
}

#[test]
fn what_has_no_triangle_is_rejected() {
    let mut buffers = PipelineBuffers::default();
    assert_eq!(triangulate(&[[0, 0], [1, 1]], &mut buffers).unwrap_err(), Rejection::TooFew);
    let line: Vec<Site> = (0..1000).map(|i| [3 * i, 7 * i]).collect();
    assert!(triangulate(&line, &mut buffers).is_err());
    let twice = [[0, 0], [10, 0], [0, 10], [0, 0]];
    assert!(triangulate(&twice, &mut buffers).is_err());
    assert_eq!(triangulate(&[[0, 0], [i32::MAX, 0], [0, 10]], &mut buffers).unwrap_err(), Rejection::OutOfReach);
}

#[test]
fn labels_are_the_nearest_site_pixels() {
    let mut random = Random(5);
    for n in [1, 2, 3, 10, 100, 1000] {
        for [wide, high] in [[300, 300], [1, 900], [900, 1], [70, 2000]] {
            // Some textures with half of them empty, so that labels are far away too.
            let part = 1 + random.below(2);
            let sites: Vec<Site> = (0..n).map(|_| [random.below(wide) / part, random.below(high)]).collect();
            let ends = [[0, 0], [wide - 1, high - 1]];
            check_labels(&[&sites[..], &ends].concat());
        }
    }
}

/// Compares the rows of labels with all distances to all sites.
fn check_labels(sites: &[Site]) {
    let (mut texture, mut voronoi) = (SiteTexture::default(), LabelRows::default());
    // Whether too many are missing is of no importance here.
    let _ = texture.write(sites, &TextureRequest::default(), &mut PipelineCounts::default());
    let occupied = |x: usize, y: usize| texture.occupied[y * texture.words + x / 64] >> (x % 64) & 1 != 0;
    let pixels = (0..texture.width).flat_map(|x| (0..texture.height).map(move |y| (x, y)));
    let placed: Vec<(usize, usize)> = pixels.filter(|&(x, y)| occupied(x, y)).collect();
    voronoi.start(&texture);
    let mut labels = vec![0; texture.width + 2];
    for y in 0..texture.height {
        voronoi.row(&texture, y, &mut labels);
        for x in 0..texture.width {
            let key = |&(sx, sy): &(usize, usize)| (sx.abs_diff(x).pow(2) + sy.abs_diff(y).pow(2), sx, sy);
            let (_, sx, sy) = placed.iter().map(key).min().unwrap();
            assert_eq!(labels[x + 1], (sy << 16 | sx) as u32, "pixel ({x}, {y}) of {sites:?}");
        }
    }
}
