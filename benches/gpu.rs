//! The CPU's part of a leaf whose mesh a device has made, beside the whole leaf without a device, in the same run. The device takes no
//! time: its answers are made in advance, with the shaders' twins.
//!
//! `cargo bench --bench gpu [-- ROUNDS]` prints nanoseconds of thread CPU time a site, for tiles of generated sites, and of autzen.laz if
//! `$GDT_SHARED/data` or `../shared/data` has it. The two take turns, leaf by leaf; the medians of ROUNDS (15) rounds are printed.

#[path = "../tests/gpu/instant.rs"]
mod instant;
mod points;

use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::voronoi::counts::{PipelineCounts, STEP_NAMES};
use delaunay::voronoi::rejection::Rejection;
use delaunay::voronoi::{PipelineBuffers, triangulate};
use instant::Answer;
use points::{gaussian, median, uniform};
use std::hint::black_box;
use std::path::PathBuf;

/// About the number of sites in a tile.
const TILE: usize = 35_000;
/// Pixels a site of the textures.
const DENSITIES: [f64; 3] = [8.0, 12.0, 16.0];
/// One tile of so many is measured.
const EVERY: usize = 20;

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let rounds = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(15);
    for (name, sites) in [("uniform", uniform(10 * TILE)), ("gaussian", gaussian(10 * TILE))] {
        println!("{name}:");
        measure_all(&cut(sites, 10), rounds);
    }
    let Some(sites) = autzen() else { return };
    println!("autzen:");
    let parts = sites.len().div_ceil(TILE);
    let leaves: Vec<Vec<Site>> = cut(sites, parts).into_iter().step_by(EVERY).collect();
    let measured = measure_all(&leaves, rounds);
    if let Some(best) = measured.iter().min_by(|a, b| a.ratio.total_cmp(&b.ratio)) {
        println!("instant device: {:.1} ns a site, {:.3} of CPU only", best.with_device, best.ratio);
    }
}

fn measure_all(leaves: &[Vec<Site>], rounds: usize) -> Vec<Measured> {
    let leaves: Vec<Vec<Site>> = leaves.iter().cloned().map(in_rows).collect();
    let measured: Vec<Measured> = DENSITIES.iter().map(|&density| measure(&leaves, density, rounds)).collect();
    measured.iter().for_each(Measured::print);
    measured
}

/// What was measured with textures of one density.
struct Measured {
    density: f64,
    sites: usize,
    cpu_only: f64,
    with_device: f64,
    /// The median of the ratios of each round.
    ratio: f64,
    counts: PipelineCounts,
}

impl Measured {
    fn print(&self) {
        let share = |count: u64| 100.0 * count as f64 / self.sites as f64;
        println!(
            "{:>4} pixels a site: {:.1} ns a site on the CPU alone, {:.1} with a device; missing {:.3} %, inverted {:.3} %, removed {:.3} %, {:.4} flips a site",
            self.density,
            self.cpu_only,
            self.with_device,
            share(self.counts.missing),
            share(self.counts.inverted),
            share(self.counts.removed),
            self.counts.flips as f64 / self.sites as f64,
        );
        let steps = STEP_NAMES.iter().zip(self.counts.nanoseconds);
        let steps = steps.map(|(name, time)| format!("{name}: {:.1}", time as f64 / self.sites as f64));
        println!("     {}", steps.collect::<Vec<_>>().join(", "));
    }
}

fn measure(leaves: &[Vec<Site>], density: f64, rounds: usize) -> Measured {
    let answers: Vec<Answer> = leaves.iter().map(|leaf| Answer::new(leaf, density)).collect();
    let sites: usize = leaves.iter().map(Vec::len).sum();
    let (mut alone, mut helped) = (PipelineBuffers::default(), PipelineBuffers::default());
    let (mut cpu_only, mut with_device, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let mut counts = PipelineCounts::default();
    for round in 0..=rounds {
        let mut times = [0.0; 2];
        counts = PipelineCounts::default();
        for (leaf, answer) in leaves.iter().zip(&answers) {
            times[0] += timed(&mut alone, |buffers| triangulate(leaf, buffers)).0;
            let (time, more) = timed(&mut helped, |buffers| answer.complete(leaf, buffers));
            times[1] += time;
            counts += more;
        }
        // The first round warms up.
        if round > 0 {
            let [a, b] = times.map(|time| time / sites as f64);
            cpu_only.push(a);
            with_device.push(b);
            ratios.push(b / a);
        }
    }
    Measured {
        density,
        sites,
        cpu_only: median(cpu_only),
        with_device: median(with_device),
        ratio: median(ratios),
        counts,
    }
}

/// Returns the nanoseconds that a leaf takes.
fn timed(
    buffers: &mut PipelineBuffers,
    work: impl FnOnce(&mut PipelineBuffers) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection>,
) -> (f64, PipelineCounts) {
    let start = cpu_time();
    let (mesh, counts) = work(buffers).expect("the leaf is accepted");
    buffers.recycle(black_box(mesh));
    (cpu_time() - start, counts)
}

/// Returns the nanoseconds that this thread has run, so that other work on the machine counts as little as possible.
fn cpu_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// Cuts the sites across the longer side into `parts` of equal size.
fn cut(mut sites: Vec<Site>, parts: usize) -> Vec<Vec<Site>> {
    if parts < 2 {
        return vec![sites];
    }
    let bounds = Bounds::of_points(sites.iter().copied()).expect("a tile has sites");
    let axis = (bounds.extent(1) > bounds.extent(0)) as usize;
    let at = sites.len() * (parts / 2) / parts;
    sites.select_nth_unstable_by_key(at, |s| s[axis]);
    let other = sites.split_off(at);
    let mut leaves = cut(sites, parts / 2);
    leaves.extend(cut(other, parts - parts / 2));
    leaves
}

/// Returns the sites in the order in which a job has them.
fn in_rows(mut sites: Vec<Site>) -> Vec<Site> {
    sites.sort_unstable_by_key(|&[x, y]| (y, x));
    sites
}

/// Reads the distinct sites of autzen.laz.
fn autzen() -> Option<Vec<Site>> {
    let folder = std::env::var_os("GDT_SHARED").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared")));
    let Ok(mut reader) = las::Reader::from_path(folder.join("data/autzen.laz")) else {
        println!("autzen.laz was not found");
        return None;
    };
    let points = reader.read_all().ok()?;
    let low = [points.x_raw().min()?, points.y_raw().min()?];
    let mut sites = in_rows(points.x_raw().zip(points.y_raw()).map(|(x, y)| [x - low[0], y - low[1]]).collect());
    sites.dedup();
    Some(sites)
}
