//! Sites on which triangulating takes quadratic time in many programs: `cargo bench --bench hard [-- [NAME...] [--sites N]]`.
//!
//! A leaf of N sites (1,000,000 if nothing else is said) is triangulated as a job does it: by the pipeline, and by divide and conquer
//! if the pipeline rejects it. The last column compares the time with that of as many random sites in the same run. `spade` runs on
//! a hundredth of the sites; its last column is its time a site, compared with its own on random sites.

mod points;

use delaunay::geometry::Site;
use delaunay::triangulation::{canonical, reference};
use points::{Random, distinct, gaussian, median, uniform};
use std::time::Instant;

/// The greatest coordinate.
const SIDE: f64 = 1e8;
const RUNS: usize = 3;

/// Returns a site by its number and the number of all sites.
type Shape = fn(usize, usize) -> [f64; 2];

const SHAPES: [(&str, Shape); 13] = [
    ("line and one", |i, n| if i == 0 { [SIDE / 2.0, SIDE / 3.0] } else { [along(i, n), 0.0] }),
    ("diagonal and one", |i, n| if i == 0 { [SIDE, 0.0] } else { [along(i, n); 2] }),
    ("two lines", |i, n| [along(i, n), SIDE / 10.0 * (i % 2) as f64]),
    ("thin strip", |i, n| [along(i, n), (i * 7919 % 10) as f64]),
    ("dense north edge", |i, n| match i % 10 {
        0..7 => [(i * 7919 % n) as f64 / n as f64 * SIDE, (i * 104_729 % n) as f64 / n as f64 * SIDE],
        _ => [along(i, n), SIDE],
    }),
    ("cross", |i, n| if i % 2 == 0 { [along(i, n), SIDE / 2.0] } else { [SIDE / 2.0, along(i, n)] }),
    ("parabola", |i, n| [along(i, n), (along(i, n) - SIDE / 2.0).powi(2) / SIDE]),
    ("narrow parabola", |i, n| [along(i, n) / 500.0, (along(i, n) - SIDE / 2.0).powi(2) / SIDE * 4.0]),
    ("facing parabolas", |i, n| {
        let y = (along(i, n) - SIDE / 2.0).powi(2) / SIDE / 10.0;
        [along(i, n), if i % 2 == 0 { y } else { SIDE / 5.0 - y }]
    }),
    ("circle", |i, n| on_circle(i, n, 1.0)),
    ("circle and centre", |i, n| on_circle(i, n, if i == 0 { 0.0 } else { 1.0 })),
    ("two circles", |i, n| on_circle(i, n, if i % 2 == 0 { 1.0 } else { 0.9 })),
    ("spiral", |i, n| on_circle(50 * i, n, i as f64 / n as f64)),
];

fn along(i: usize, n: usize) -> f64 {
    SIDE / n as f64 * i as f64
}

fn on_circle(i: usize, n: usize, radius: f64) -> [f64; 2] {
    let (sin, cos) = (i as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
    [SIDE * radius * cos, SIDE * radius * sin]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let option = arguments.iter().position(|a| a == "--sites");
    let count = option.and_then(|at| arguments.get(at + 1)?.parse().ok()).unwrap_or(1_000_000);
    let names: Vec<&String> = arguments[..option.unwrap_or(arguments.len())].iter().collect();
    let wanted = |name: &str| names.is_empty() || names.iter().any(|n| name.contains(n.as_str()));

    let base = time(&uniform(count), |sites| canonical(sites).is_ok());
    let spade_base = time(&uniform(count / 100), |sites| reference::triangulate(sites).is_ok());
    println!("ns per site (medians of {RUNS})   {count} sites  x random   spade, {}  x random", count / 100);
    println!("{:30} {:14.0} {:9.2} {:14.0} {:9.2}", "random", base, 1.0, spade_base, 1.0);
    let cloud = time(&gaussian(count), |sites| canonical(sites).is_ok());
    println!("{:30} {:14.0} {:9.2}", "random, normally distributed", cloud, cloud / base);
    for (name, shape) in SHAPES.into_iter().filter(|(name, _)| wanted(name)) {
        let [own, spade] = [count, count / 100].map(|n| sites(shape, n));
        let own = time(&own, |sites| canonical(sites).is_ok());
        let spade = time(&spade, |sites| reference::triangulate(sites).is_ok());
        println!("{name:30} {own:14.0} {:9.2} {spade:14.0} {:9.2}", own / base, spade / spade_base);
    }
}

/// Returns `n` sites of a shape, less those that fall together, in a random order.
fn sites(shape: Shape, n: usize) -> Vec<Site> {
    let mut sites = distinct((0..n).map(|i| shape(i, n).map(|c| c.round() as i32)).collect());
    let mut random = Random(7);
    for i in (1..sites.len()).rev() {
        sites.swap(i, (random.unit() * (i + 1) as f64) as usize);
    }
    sites
}

/// Returns the median time of a run in nanoseconds a site.
fn time(sites: &[Site], run: impl Fn(&[Site]) -> bool) -> f64 {
    let run = || {
        let start = Instant::now();
        assert!(run(sites), "no triangulation");
        start.elapsed().as_nanos() as f64 / sites.len() as f64
    };
    median((0..RUNS).map(|_| run()).collect())
}
