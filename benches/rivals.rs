//! Leaf triangulation on one thread compared with CGAL and Triangle, on the same leaves as in the benchmark `kernel`.
//!
//! `cargo bench --bench rivals [-- NAME...] [-- --all]` first has `benches/rivals/build` build the rivals from packages, and says which
//! are missing. Then it runs the cases whose names contain a NAME; `--all` adds those of 4 M points and more. In each round the kernel
//! and the rivals triangulate all leaves in turn. It prints the medians of the processor time of the one thread, and compares the
//! numbers of triangles: sites on one circle have several triangulations, but all of them have as many triangles.

mod leaves;
mod points;

use delaunay::geometry::Site;
use delaunay::triangulation::{divide_and_conquer, reference};
use delaunay::voronoi::{PipelineBuffers, triangulate};
use leaves::{Case, cases, cpu_time, cut};
use points::median;
use std::error::Error;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Leaves up to this size that the kernel rejects go to the reference, larger ones are halved, as in the benchmark `kernel`.
const SMALL: usize = 3_000;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let all = arguments.iter().any(|a| a == "--all");
    let rivals = build()?;
    let scratch = tempfile::tempdir()?;
    let file = scratch.path().join("leaves");
    print!("{:<26} {:>10}", "ns per site (medians)", "kernel");
    rivals.iter().for_each(|(name, _)| print!(" {name:>14} {:>7}", "x"));
    println!("  leaves with other numbers of triangles");
    for case in cases(&arguments, all) {
        write_leaves(&file, &case.leaves)?;
        measure(&case, &file, &rivals)?;
    }
    Ok(())
}

/// Builds the rivals, and returns their names and programs.
fn build() -> Outcome<Vec<(String, PathBuf)>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let built = Command::new(root.join("benches/rivals/build"))
        .arg(root.join("target/rivals"))
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| format!("benches/rivals/build cannot be run: {e}"))?;
    if !built.status.success() {
        return Err("the rivals cannot be built".into());
    }
    let lines = String::from_utf8(built.stdout)?;
    let rival = |line: &str| line.split_once(' ').map(|(name, program)| (name.to_string(), PathBuf::from(program)));
    Ok(lines.lines().filter_map(rival).collect())
}

/// Writes leaves as `benches/rivals/leaves.h` reads them.
fn write_leaves(path: &Path, leaves: &[Vec<Site>]) -> Outcome<()> {
    let mut file = BufWriter::new(File::create(path)?);
    file.write_all(&(leaves.len() as u32).to_ne_bytes())?;
    for leaf in leaves {
        file.write_all(&(leaf.len() as u32).to_ne_bytes())?;
        leaf.as_flattened().iter().try_for_each(|number| file.write_all(&number.to_ne_bytes()))?;
    }
    Ok(file.flush()?)
}

/// What one triangulation of all leaves took, and the number of triangles of each.
struct Round {
    nanoseconds: f64,
    triangles: Vec<usize>,
}

fn measure(case: &Case, file: &Path, rivals: &[(String, PathBuf)]) -> Outcome<()> {
    let sites: usize = case.leaves.iter().map(Vec::len).sum();
    let mut rivals = rivals.iter().map(|(_, program)| Rival::start(program, file)).collect::<Outcome<Vec<_>>>()?;
    let mut buffers = PipelineBuffers::default();
    let triangles =
        case.leaves.iter().map(|leaf| number_of_triangles(leaf, &mut buffers)).collect::<Outcome<Vec<_>>>()?;
    let (mut times, mut others) = (vec![Vec::new(); rivals.len() + 1], vec![0; rivals.len()]);
    for round in 0..=(1_500_000 / sites).clamp(3, 15) {
        let start = cpu_time();
        case.leaves.iter().for_each(|leaf| kernel(leaf, &mut buffers));
        let own = cpu_time() - start;
        let rounds = rivals.iter_mut().map(Rival::round).collect::<Outcome<Vec<_>>>()?;
        for (others, round) in others.iter_mut().zip(&rounds) {
            *others = triangles.iter().zip(&round.triangles).filter(|(own, rival)| own != rival).count();
        }
        // The first round warms up.
        if round > 0 {
            let all = std::iter::once(own).chain(rounds.iter().map(|round| round.nanoseconds));
            times.iter_mut().zip(all).for_each(|(times, time)| times.push(time / sites as f64));
        }
    }
    let mut medians = times.into_iter().map(median);
    let kernel = medians.next().unwrap_or(f64::NAN);
    print!("{:<26} {kernel:>10.0}", case.name);
    medians.for_each(|time| print!(" {time:>14.0} {:>7.2}", time / kernel));
    println!("  {others:?} of {}", case.leaves.len());
    rivals.into_iter().try_for_each(Rival::end)
}

/// Returns the number of triangles that a job makes of a leaf.
fn number_of_triangles(leaf: &[Site], buffers: &mut PipelineBuffers) -> Outcome<usize> {
    match triangulate(leaf, buffers) {
        Ok((mesh, _)) => Ok(mesh.triangles.len()),
        Err(_) => Ok(divide_and_conquer::triangulate(leaf)?.triangles.len()),
    }
}

/// Triangulates a leaf, or its halves if it is rejected.
fn kernel(leaf: &[Site], buffers: &mut PipelineBuffers) {
    match triangulate(leaf, buffers) {
        Ok((mesh, _)) => buffers.recycle(std::hint::black_box(mesh)),
        Err(_) if leaf.len() <= SMALL => {
            std::hint::black_box(reference::triangulate(leaf).expect("distinct sites"));
        }
        Err(_) => cut(leaf.to_vec(), leaf.len().div_ceil(2)).iter().for_each(|half| kernel(half, buffers)),
    }
}

/// The running program of a rival.
struct Rival {
    process: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Rival {
    fn start(program: &Path, leaves: &Path) -> Outcome<Rival> {
        let mut process = Command::new(program).arg(leaves).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let input = process.stdin.take().ok_or("no standard input")?;
        let output = BufReader::new(process.stdout.take().ok_or("no standard output")?);
        Ok(Rival { process, input, output })
    }

    /// Has it triangulate all leaves, while this process waits.
    fn round(&mut self) -> Outcome<Round> {
        self.input.write_all(b"\n")?;
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        let mut numbers = line.split_whitespace();
        let nanoseconds = numbers.next().ok_or("a rival ended")?.parse()?;
        let triangles = numbers.map(str::parse).collect::<Result<_, _>>()?;
        Ok(Round { nanoseconds, triangles })
    }

    fn end(mut self) -> Outcome<()> {
        drop(self.input);
        self.process.wait()?;
        Ok(())
    }
}
