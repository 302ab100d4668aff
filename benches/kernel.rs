//! Leaf triangulation on one thread compared with `spade` and `delaunator`, on the same points in the same run.
//!
//! `cargo bench --bench kernel [-- NAME...] [-- --all]` runs the cases whose names contain a NAME; `--all` adds those of 4 M points
//! and more. Every case is a list of leaves. A leaf that the kernel rejects is halved and tried again; small leaves go to the
//! reference. Runs alternate, and the medians are printed. Real data is read from `$GDT_SHARED/data` or `../shared/data`, if it
//! exists.

mod leaves;
mod points;

use delaunator::Point;
use delaunay::geometry::Site;
use delaunay::triangulation::reference;
use delaunay::voronoi::counts::{PipelineCounts, STEP_NAMES};
use delaunay::voronoi::{PipelineBuffers, triangulate};
use leaves::{Case, cases, cpu_time, cut};
use points::median;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Leaves up to this size are not cut further.
const SMALL: usize = 3_000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let all = arguments.iter().any(|a| a == "--all");
    println!(
        "ns per site (medians)      kernel   spade  delaun.  x spade  x delaun.  removed%  missing%  flips  reference"
    );
    let mut buffers = PipelineBuffers::default();
    let mut totals = Vec::new();
    for case in cases(&arguments, all) {
        totals.push((case.name.clone(), measure(&case, &mut buffers)));
    }
    print_steps(&totals);
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
