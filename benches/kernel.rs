//! Leaf triangulation on one thread compared with `spade` and `delaunator`, on the same points in the same run.
//!
//! `cargo bench --bench kernel [-- NAME...] [-- --all]` runs the cases whose names contain a NAME; `--all` adds those of 4 M points
//! and more. Every case is a list of leaves. A leaf that the kernel rejects is halved and tried again; small leaves go to the
//! reference. Runs alternate, and the medians are printed. Real data is read from `$GDT_SHARED/data` or `../shared/data`, if it
//! exists.

mod points;

use delaunator::Point;
use gdt_batch::geometry::{Bounds, Site};
use gdt_batch::triangulation::reference;
use gdt_batch::voronoi::counts::{PipelineCounts, STEP_NAMES};
use gdt_batch::voronoi::{PipelineBuffers, triangulate};
use points::{Random, distinct, gaussian, median, uniform};
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::path::PathBuf;

/// The size of leaves in a job, by default.
const LEAF: usize = 50_000;
/// Leaves up to this size are not cut further.
const SMALL: usize = 3_000;

struct Case {
    name: String,
    leaves: Vec<Vec<Site>>,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let all = arguments.iter().any(|a| a == "--all");
    let wanted = |name: &str| {
        let mut names = arguments.iter().filter(|a| !a.starts_with("--")).peekable();
        names.peek().is_none() || names.any(|n| name.contains(n.as_str()))
    };
    println!(
        "ns per site (medians)      kernel   spade  delaun.  x spade  x delaun.  removed%  missing%  flips  reference"
    );
    let mut buffers = PipelineBuffers::default();
    let mut totals = Vec::new();
    for (name, make) in cases(all) {
        if !wanted(&name) {
            continue;
        }
        if let Some(leaves) = make() {
            totals.push((name.clone(), measure(&Case { name, leaves }, &mut buffers)));
        }
    }
    print_steps(&totals);
}

type Make = Box<dyn Fn() -> Option<Vec<Vec<Site>>>>;

fn cases(all: bool) -> Vec<(String, Make)> {
    let mut cases: Vec<(String, Make)> = Vec::new();
    let mut add = |name: &str, make: Make| cases.push((name.to_string(), make));
    for (label, n) in [("25 k", 25_000), ("50 k", 50_000), ("100 k", 100_000), ("250 k", 250_000), ("1 M", 1_000_000)] {
        add(&format!("uniform {label}"), Box::new(move || Some(vec![uniform(n)])));
    }
    for leaf in [12_500, 25_000, 50_000, 100_000, 250_000] {
        let name = format!("uniform 1 M, leaves {leaf}");
        add(&name, Box::new(move || Some(cut(uniform(1_000_000), leaf))));
    }
    add("gaussian 1 M, leaves", Box::new(|| Some(cut(gaussian(1_000_000), LEAF))));
    add("clusters 1 M, leaves", Box::new(|| Some(cut(clusters(1_000_000, 100), LEAF))));
    add("clusters 1 M, one leaf", Box::new(|| Some(vec![clusters(1_000_000, 100)])));
    add("lattice 100 k", Box::new(|| Some(vec![lattice(316)])));
    add("circle 100 k", Box::new(|| Some(vec![circle(100_000)])));
    add("crop, one leaf", Box::new(|| Some(vec![shared("crop.laz")?])));
    add("crop, leaves", Box::new(|| Some(cut(shared("crop.laz")?, LEAF))));
    add("Topography, leaves", Box::new(|| Some(cut(shared("Topography.laz")?, LEAF))));
    add("autzen_trim, leaves", Box::new(|| Some(cut(shared("autzen_trim.las")?, LEAF))));
    add("autzen every 9th leaf", Box::new(|| Some(cut(shared("autzen.laz")?, LEAF).into_iter().step_by(9).collect())));
    if all {
        for (label, n) in [("4 M", 4_000_000), ("10 M", 10_000_000)] {
            add(&format!("uniform {label}, leaves"), Box::new(move || Some(cut(uniform(n), LEAF))));
        }
        add("autzen, leaves", Box::new(|| Some(cut(shared("autzen.laz")?, LEAF))));
    }
    cases
}

/// Runs the three in turn until each has run for about a second, at least three times, and prints the medians.
fn measure(case: &Case, buffers: &mut PipelineBuffers) -> (usize, PipelineCounts) {
    let sites: usize = case.leaves.iter().map(Vec::len).sum();
    let points = |s: &Site| Point2::new(s[0] as f64, s[1] as f64);
    let spade_leaves: Vec<Vec<Point2<f64>>> = case.leaves.iter().map(|l| l.iter().map(points).collect()).collect();
    let points = |s: &Site| Point { x: s[0] as f64, y: s[1] as f64 };
    let delaunator_leaves: Vec<Vec<Point>> = case.leaves.iter().map(|l| l.iter().map(points).collect()).collect();
    let rounds = (1_500_000 / sites).clamp(3, 15);
    let mut times = [(); 3].map(|()| Vec::new());
    let (mut counts, mut by_reference) = (PipelineCounts::default(), 0);
    for round in 0..=rounds {
        (counts, by_reference) = (PipelineCounts::default(), 0);
        let start = cpu_time();
        for leaf in &case.leaves {
            by_reference += kernel(leaf, buffers, &mut counts);
        }
        let kernel_time = cpu_time() - start;
        let start = cpu_time();
        for leaf in &spade_leaves {
            let mesh = DelaunayTriangulation::<Point2<f64>>::bulk_load(leaf.clone()).expect("finite");
            std::hint::black_box(mesh.num_inner_faces());
        }
        let spade_time = cpu_time() - start;
        let start = cpu_time();
        for leaf in &delaunator_leaves {
            std::hint::black_box(delaunator::triangulate(leaf));
        }
        // The first round warms up.
        if round > 0 {
            for (times, time) in times.iter_mut().zip([kernel_time, spade_time, cpu_time() - start]) {
                times.push(time / sites as f64);
            }
        }
    }
    let [kernel, spade, delaunator] = times.map(median);
    println!(
        "{:<26} {kernel:>6.0} {spade:>7.0} {delaunator:>8.0} {:>8.2} {:>10.2} {:>9.2} {:>9.2} {:>6.2} {:>10.4}",
        case.name,
        spade / kernel,
        delaunator / kernel,
        100.0 * counts.removed as f64 / sites as f64,
        100.0 * counts.missing as f64 / sites as f64,
        counts.flips as f64 / sites as f64,
        by_reference as f64 / sites as f64,
    );
    (sites, counts)
}

/// Triangulates a leaf, or its halves if it is rejected; returns the number of sites that went to the reference.
fn kernel(leaf: &[Site], buffers: &mut PipelineBuffers, counts: &mut PipelineCounts) -> usize {
    match triangulate(leaf, buffers) {
        Ok((mesh, more)) => {
            *counts += more;
            buffers.recycle(std::hint::black_box(mesh));
            0
        }
        Err(why) if leaf.len() <= SMALL => {
            if std::env::var_os("WHY").is_some() {
                println!("{} sites: {why}", leaf.len());
            }
            std::hint::black_box(reference::triangulate(leaf).expect("distinct sites"));
            leaf.len()
        }
        Err(why) => {
            if std::env::var_os("WHY").is_some() {
                println!("{} sites: {why}", leaf.len());
            }
            let halves = cut(leaf.to_vec(), leaf.len().div_ceil(2));
            halves.iter().map(|half| kernel(half, buffers, counts)).sum()
        }
    }
}

fn print_steps(totals: &[(String, (usize, PipelineCounts))]) {
    println!("\nns per site by step (last run)");
    for (name, (sites, counts)) in totals {
        print!("{name:<26}");
        for (step, nanoseconds) in STEP_NAMES.iter().zip(counts.nanoseconds) {
            print!(" {}: {:.1}", step.split(' ').next().unwrap_or(step), nanoseconds as f64 / *sites as f64);
        }
        println!("  (islands {}, inverted {}, moved {})", counts.islands, counts.inverted, counts.moved);
    }
}

/// Returns the nanoseconds that this thread has run, so that other work on the machine counts as little as possible.
fn cpu_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// Cuts the sites at the median of the longer side until no part has more than `leaf` sites.
fn cut(mut sites: Vec<Site>, leaf: usize) -> Vec<Vec<Site>> {
    if sites.len() <= leaf {
        return vec![sites];
    }
    let bounds = Bounds::of_points(sites.iter().copied()).expect("a leaf has sites");
    let axis = (bounds.extent(1) > bounds.extent(0)) as usize;
    let half = sites.len() / 2;
    sites.select_nth_unstable_by_key(half, |s| s[axis]);
    let other = sites.split_off(half);
    let mut leaves = cut(sites, leaf);
    leaves.extend(cut(other, leaf));
    leaves
}

/// Reads the distinct sites of a file of the shared test data.
fn shared(name: &str) -> Option<Vec<Site>> {
    let folder = std::env::var_os("GDT_SHARED").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared")));
    let Ok(mut reader) = las::Reader::from_path(folder.join("data").join(name)) else {
        println!("{name} was not found");
        return None;
    };
    let points = reader.read_all().ok()?;
    let low = [points.x_raw().min()?, points.y_raw().min()?];
    let sites = points.x_raw().zip(points.y_raw()).map(|(x, y)| [x - low[0], y - low[1]]).collect();
    Some(distinct(sites))
}

fn clusters(n: usize, spots: usize) -> Vec<Site> {
    let mut random = Random(3);
    let centres: Vec<[f64; 2]> = (0..spots).map(|_| [random.unit() * 1e8, random.unit() * 1e8]).collect();
    let mut site = |i: usize| {
        let (centre, [x, y]) = (centres[i % spots], random.normal());
        [(centre[0] + 1e5 * x) as i32, (centre[1] + 1e5 * y) as i32]
    };
    distinct((0..n).map(&mut site).collect())
}

fn lattice(side: i32) -> Vec<Site> {
    (0..side * side).map(|i| [i % side * 100, i / side * 100]).collect()
}

fn circle(n: usize) -> Vec<Site> {
    let mut random = Random(4);
    let angles = (0..n).map(|_| random.unit() * std::f64::consts::TAU);
    distinct(angles.map(|a| [(1e8 * a.cos()) as i32, (1e8 * a.sin()) as i32]).collect())
}
