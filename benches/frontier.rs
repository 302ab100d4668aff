//! How large the merges above the parts get: `cargo bench --bench frontier`.
//!
//! First it measures: random sites in a cell are triangulated, and their frontier is counted and compared with the length of the cell's
//! border in mean distances between sites. Then it simulates jobs of up to 10^13 points with that law, with counts only: parts of
//! changing density, and the merges of the tree above them.

mod points;

use delaunay::geometry::Site;
use delaunay::triangulation::divide_and_conquer;
use job::mesh::final_triangles::{TriangleState, find_final};
use job::partition::tree::Cell;
use job::plan::budget::BYTES_PER_MERGED_SITE;
use points::{Random, distinct, gaussian, median, uniform};
use std::time::Instant;

/// The greatest coordinate of uniform sites.
const SIDE: f64 = 1e8;
/// The points of a part unless there would be more than [`MOST_PARTS`].
const POINTS_PER_PART: f64 = 2e7;
const MOST_PARTS: f64 = 1000.0;
/// Bytes of a frontier site on the disk, with its part of the boundary.
const BYTES_PER_SITE: f64 = 28.0;

fn main() {
    let law = measure();
    let nanoseconds = time_of_a_merge();
    println!("\nA merge takes {nanoseconds:.0} ns a site on one thread (sites along the borders of four squares)");
    println!("\nSimulated merges above the parts");
    println!(
        "     points   parts  points/part   sites joined     on disk   seconds   largest merge     memory  seconds"
    );
    for exponent in 9..=13 {
        simulate(10f64.powi(exponent), law, nanoseconds);
    }
}

/// Measures how many sites of a cell are on its frontier. Returns their number for each mean distance along its border.
fn measure() -> f64 {
    println!("                sites    frontier   a mean distance along the border   pending triangles");
    let square = Cell { min: [0; 2], max: [SIDE as i64; 2] };
    let mut law = 0.0;
    for count in [10_000, 50_000, 250_000, 1_000_000] {
        law = measure_in(square, "uniform", &uniform(count));
    }
    // Few of these lie near the border, and those far apart: the law is an upper bound.
    let wide = Cell { min: [-SIDE as i64; 2], max: [SIDE as i64; 2] };
    measure_in(wide, "normal", &gaussian(1_000_000));
    law
}

fn measure_in(cell: Cell, name: &str, sites: &[Site]) -> f64 {
    let mesh = divide_and_conquer::triangulate(sites).expect("distinct sites within reach");
    let found = find_final(&mesh, sites, Some(&cell), |_| false);
    let pending = found.states.iter().filter(|&&state| state == TriangleState::Pending).count();
    let law = found.frontier.len() as f64 / (4.0 * (sites.len() as f64).sqrt());
    println!("{name:10} {:10} {:11} {law:34.2} {pending:19}", sites.len(), found.frontier.len());
    law
}

/// Measures how long it takes to triangulate sites as merges do, in nanoseconds a site: they lie along the borders of four squares.
fn time_of_a_merge() -> f64 {
    let mut random = Random(5);
    let width = SIDE / 2000.0;
    let mut border = |_| {
        let along = random.unit() * SIDE;
        let across = (random.unit() - 0.5) * width + SIDE / 2.0 * (random.unit() * 3.0).floor().min(2.0);
        let site = if random.unit() < 0.5 { [along, across] } else { [across, along] };
        site.map(|c| c as i32)
    };
    let sites = distinct((0..400_000).map(&mut border).collect());
    let run = || {
        let start = Instant::now();
        let mesh = divide_and_conquer::triangulate(&sites).expect("distinct sites within reach");
        assert!(!mesh.triangles.is_empty(), "no triangulation");
        start.elapsed().as_nanos() as f64 / sites.len() as f64
    };
    median((0..5).map(|_| run()).collect())
}

/// A job of parts in rows and columns.
struct Simulation {
    /// Parts along x and along y.
    size: [usize; 2],
    /// The mean number of sites along the side of each part.
    along: Vec<f64>,
    law: f64,
    joined: f64,
    largest: f64,
}

fn simulate(points: f64, law: f64, nanoseconds: f64) {
    let wanted = (points / POINTS_PER_PART).clamp(1.0, MOST_PARTS);
    let depth = wanted.log2().ceil() as u32;
    let size = [1usize << depth.div_ceil(2), 1usize << (depth / 2)];
    let parts = size[0] * size[1];
    let mut random = Random(17);
    // Densities of surveys differ by factors, and so do the sites along a border: by their roots.
    let densities: Vec<f64> = (0..parts).map(|_| (0.7 * random.normal()[0]).exp()).collect();
    let total: f64 = densities.iter().sum();
    let along = densities.iter().map(|density| (points * density / total).sqrt()).collect();
    let mut simulation = Simulation { size, along, law, joined: 0.0, largest: 0.0 };
    simulation.merge([0, 0], size);
    let (joined, largest) = (simulation.joined, simulation.largest);
    println!(
        "{points:11.0e} {parts:7} {:12.1e} {joined:14.2e} {:8.2} GB {:9.1} {largest:15.2e} {:7.2} GB {:8.1}",
        points / parts as f64,
        joined * BYTES_PER_SITE / 1e9,
        joined * nanoseconds / 1e9,
        largest * BYTES_PER_MERGED_SITE as f64 / 1e9,
        largest * nanoseconds / 1e9,
    );
}

impl Simulation {
    /// Merges the block of parts that begins at `from`, two blocks at every node. Returns the sites of its frontier.
    fn merge(&mut self, from: [usize; 2], size: [usize; 2]) -> f64 {
        if size == [1, 1] {
            return self.frontier(from, size);
        }
        let axis = if size[0] >= size[1] { 0 } else { 1 };
        let (mut half, mut second) = (size, from);
        half[axis] /= 2;
        second[axis] += half[axis];
        let below = self.merge(from, half) + self.merge(second, half);
        self.joined += below;
        self.largest = self.largest.max(below);
        self.frontier(from, size)
    }

    /// Returns the frontier sites of a block: those along its border.
    fn frontier(&self, from: [usize; 2], size: [usize; 2]) -> f64 {
        let along = |x: usize, y: usize| self.along[y * self.size[0] + x];
        let [last_x, last_y] = [from[0] + size[0] - 1, from[1] + size[1] - 1];
        let horizontal: f64 = (from[0]..=last_x).map(|x| along(x, from[1]) + along(x, last_y)).sum();
        let vertical: f64 = (from[1]..=last_y).map(|y| along(from[0], y) + along(last_x, y)).sum();
        self.law * (horizontal + vertical)
    }
}
