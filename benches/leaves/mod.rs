//! The leaves that benchmarks of the kernel triangulate.

use crate::points::{Random, distinct, gaussian, uniform};
use delaunay::geometry::{Bounds, Site};
use std::path::PathBuf;

/// The size of leaves in a job, by default.
const LEAF: usize = 50_000;

/// A list of leaves.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) leaves: Vec<Vec<Site>>,
}

/// Returns the cases whose names contain one of `names`, or all if there is none; with `all` also those of 4 M points and more. Each is
/// made when it is asked for.
pub(crate) fn cases(names: &[String], all: bool) -> impl Iterator<Item = Case> {
    let names: Vec<String> = names.iter().filter(|name| !name.starts_with("--")).cloned().collect();
    let is_wanted = move |name: &str| names.is_empty() || names.iter().any(|n| name.contains(n.as_str()));
    let wanted = all_cases(all).into_iter().filter(move |(name, _)| is_wanted(name));
    wanted.filter_map(|(name, make)| Some(Case { name, leaves: make()? }))
}

type Make = Box<dyn Fn() -> Option<Vec<Vec<Site>>>>;

fn all_cases(all: bool) -> Vec<(String, Make)> {
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

/// Returns the nanoseconds that this thread has run, so that other work on the machine counts as little as possible.
pub(crate) fn cpu_time() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// Cuts the sites at the median of the longer side until no part has more than `leaf` sites.
pub(crate) fn cut(mut sites: Vec<Site>, leaf: usize) -> Vec<Vec<Site>> {
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
