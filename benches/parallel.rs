//! Whole triangulations on several threads, compared with the parallel triangulation of PBBS: `cargo bench --bench parallel -- PBBS [RUNS
//! [THREADS...]] [--large]`.
//!
//! PBBS is a clone of the Problem Based Benchmark Suite; `benches/rivals/build-pbbs` builds its program. Its points lie in memory, and its
//! predicates are not exact. The kernel has a thread for each leaf, so this side is a job: from a LAS file to tiles on the disk, with
//! normals. Its stage `triangulate` has the triangles of the leaves, their proof, the merges, and their way to the disk; the others read
//! and write. `--large` adds ten million points. In each run all take turns. This prints medians in nanoseconds a point: wall time and
//! processor time, which for PBBS includes threads that look for work.

mod points;

use delaunay::geometry::Site;
use points::{gaussian, median, uniform};
use serde_json::Value;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Makes so many sites.
type Make = fn(usize) -> Vec<Site>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let is_large = arguments.iter().any(|word| word == "--large");
    let mut words = arguments.iter().filter(|word| !word.starts_with("--"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = root.join("target/rivals/pbbs");
    let suite = words.next().ok_or("name the folder of PBBS: see benches/rivals/build-pbbs")?;
    let built = Command::new(root.join("benches/rivals/build-pbbs")).arg(suite).arg(&program).status()?;
    if !built.success() {
        return Err("PBBS cannot be built".into());
    }
    let runs: usize = words.next().map_or(Ok(3), |word| word.parse())?;
    let threads = words.map(|word| word.parse()).collect::<Result<Vec<usize>, _>>()?;
    let threads = if threads.is_empty() { vec![1, 2] } else { threads };
    let scratch = tempfile::tempdir()?;
    println!("ns per point (medians)       threads   job: wall     CPU  triangulate CPU   PBBS: wall     CPU");
    let sizes: &[usize] = if is_large { &[1_000_000, 10_000_000] } else { &[1_000_000] };
    for &size in sizes {
        for (name, make) in [("uniform", uniform as Make), ("gaussian", gaussian as Make)] {
            let cloud = Cloud::write(&make(size), scratch.path())?;
            for &threads in &threads {
                cloud.measure(&format!("{name} {} M", size / 1_000_000), &program, runs, threads)?;
            }
        }
    }
    Ok(())
}

/// A cloud as both sides read it.
struct Cloud {
    points: usize,
    las: PathBuf,
    leaf: PathBuf,
}

impl Cloud {
    fn write(sites: &[Site], scratch: &Path) -> Outcome<Cloud> {
        let (las, leaf) = (scratch.join("cloud.las"), scratch.join("leaf"));
        let mut file = BufWriter::new(File::create(&leaf)?);
        let numbers = [1, u32::try_from(sites.len())?];
        numbers.iter().try_for_each(|number| file.write_all(&number.to_ne_bytes()))?;
        sites.as_flattened().iter().try_for_each(|number| file.write_all(&number.to_ne_bytes()))?;
        file.flush()?;
        let step = las::Transform { scale: 0.01, offset: 0.0 };
        let mut header = las::Builder::from((1, 2));
        header.transforms = las::Vector { x: step, y: step, z: step };
        let mut writer = las::Writer::from_path(&las, header.into_header()?)?;
        for &site in sites {
            let [x, y] = site.map(|number| f64::from(number) * 0.01);
            writer.write_point(las::Point { x, y, z: x % 10.0, ..las::Point::default() })?;
        }
        writer.close()?;
        Ok(Cloud { points: sites.len(), las, leaf })
    }

    fn measure(&self, name: &str, pbbs: &Path, runs: usize, threads: usize) -> Outcome<()> {
        let mut times = [const { Vec::new() }; 5];
        for _ in 0..runs {
            let all = self.job(threads)?.into_iter().chain(self.rival(pbbs, threads)?);
            times.iter_mut().zip(all).for_each(|(times, time)| times.push(time / self.points as f64));
        }
        let [wall, cpu, triangulate, rival_wall, rival_cpu] = times.map(median);
        println!(
            "{name:<28} {threads:>7} {wall:>11.0} {cpu:>7.0} {triangulate:>16.0} {rival_wall:>12.0} {rival_cpu:>7.0}"
        );
        Ok(())
    }

    /// Runs a job. Returns nanoseconds: its wall time, its processor time, and that of the stage `triangulate`.
    fn job(&self, threads: usize) -> Outcome<[f64; 3]> {
        let output = self.las.with_file_name("out");
        let config = self.las.with_extension("toml");
        let tiles = "format = \"3dtiles\"\ncompression = \"none\"\nlevels = false";
        let limits = format!("memory = \"4 GiB\"\nthreads = {threads}");
        let input = format!("files = [{:?}]\nunit = \"metre\"", self.las);
        fs::write(
            &config,
            format!("[input]\n{input}\n[output]\ndirectory = {output:?}\n{tiles}\n[limits]\n{limits}\n"),
        )?;
        let job = Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(["--quiet", "--restart"]).arg(config).status()?;
        if !job.success() {
            return Err("the job failed".into());
        }
        let report: Value = serde_json::from_slice(&fs::read(output.join("report.json"))?)?;
        let triangulate =
            report["stages"].as_array().into_iter().flatten().find(|stage| stage["stage"] == "triangulate");
        let seconds =
            [&report["wall_s"], &report["cpu_s"], &triangulate.ok_or("the job did not triangulate")?["cpu_s"]];
        fs::remove_dir_all(&output)?;
        Ok(seconds.map(|value| value.as_f64().unwrap_or(f64::NAN) * 1e9))
    }

    /// Has PBBS triangulate twice, of which the first warms up. Returns nanoseconds: wall time and processor time.
    fn rival(&self, program: &Path, threads: usize) -> Outcome<[f64; 2]> {
        let mut pbbs = Command::new(program)
            .arg(&self.leaf)
            .env("PARLAY_NUM_THREADS", threads.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        pbbs.stdin.take().ok_or("no standard input")?.write_all(b"\n\n")?;
        let lines = BufReader::new(pbbs.stdout.take().ok_or("no standard output")?).lines();
        let last = lines.last().ok_or("PBBS ended")??;
        pbbs.wait()?;
        let mut numbers = last.split_whitespace().map(str::parse);
        let mut next = || numbers.next().ok_or("PBBS says too little");
        Ok([next()??, next()??])
    }
}
