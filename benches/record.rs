//! How large a job can this machine do? `cargo bench --bench record [-- [FILE.laz] [COPIES...] [--keep] [--flat] [--in FOLDER]
//! [--memory MIB] [--free GIB]]`.
//!
//! The cloud of a job is one file many times, side by side, which a server in this process hands out (`copies`). So the points take no disk,
//! and the temporary files of the job alone bound its size. For each number of COPIES the program runs once, with two threads, a memory of
//! MIB (256 by default), plain tiles and a tileset. Every tile is checked as soon as the job has published it, and then truncated, so
//! the results take no disk either. The verdict is that of `gdt-batch verify`: each tile is read once, and the borders of all are
//! matched when the job is done ([`verify::GrowingProof`]). The program knows nothing of this.
//!
//! With `--keep` the tiles stay, and `verify` itself must come to the same verdict. Scenes of 3D Tiles wider than 7 km follow the earth,
//! which takes more time a point than smaller ones do; with `--flat` all are flat (`format = "glb"`, for clouds too large for one file: from
//! 100 million points on).
//!
//! This prints for each job: the points, the processor time and memory, the stages, the share of the time in which at most one thread
//! runs (as in the benchmark `serial`: threads that wait for a processor or the disk run), and the verdict. The job is stopped if less than
//! GIB are free on the disk, 15 by default. The default FILE is that of the benchmark `job`, and the default COPIES are 1 and 10. FOLDER
//! is where the jobs write. Linux only.

mod cloud;
mod copies;
mod threads;

use cloud::{Outcome, default_file};
use copies::Copies;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use threads::states_of_workers;
use verify::{GrowingProof, Verdict};

/// The time between two looks at the threads, and between two looks at the tiles.
const INTERVAL: Duration = Duration::from_millis(20);
const BETWEEN_PROOFS: Duration = Duration::from_millis(500);

/// The memory that a proof takes.
const PROOF_MEMORY: u64 = 256 << 20;

/// What the user wants.
struct Arguments {
    file: Option<PathBuf>,
    copies: Vec<usize>,
    folder: Option<PathBuf>,
    keep: bool,
    flat: bool,
    /// The MiB of memory that the job may take.
    memory: u64,
    /// The bytes of the disk that stay free.
    free: u64,
}

impl Arguments {
    fn read() -> Outcome<Arguments> {
        let mut read = Arguments {
            file: None,
            copies: Vec::new(),
            folder: None,
            keep: false,
            flat: false,
            memory: 256,
            free: 15 << 30,
        };
        let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} needs a value"));
            match word.as_str() {
                "--keep" => read.keep = true,
                "--flat" => read.flat = true,
                "--in" => read.folder = Some(value()?.into()),
                "--memory" => read.memory = value()?.parse()?,
                "--free" => read.free = value()?.parse::<u64>()? << 30,
                _ => match word.parse() {
                    Ok(count) => read.copies.push(count),
                    Err(_) => read.file = Some(word.into()),
                },
            }
        }
        if read.copies.is_empty() {
            read.copies = vec![1, 10];
        }
        Ok(read)
    }
}

fn main() -> Outcome<()> {
    let arguments = Arguments::read()?;
    let scratch = match &arguments.folder {
        Some(folder) => tempfile::tempdir_in(folder)?,
        None => tempfile::tempdir()?,
    };
    let file = arguments.file.clone().map_or_else(|| default_file(scratch.path()), Ok)?;
    let copies = Copies::of(&file)?;
    let targets: Vec<Vec<String>> = arguments.copies.iter().map(|&count| copies.targets(count)).collect();
    println!("{}, {} points", file.display(), copies.points);
    let server = copies.serve()?;
    for targets in targets {
        let output = scratch.path().join(format!("{}-copies", targets.len()));
        let urls: Vec<String> = targets.iter().map(|target| format!("{server}{target}")).collect();
        let config = output.with_extension("toml");
        fs::write(&config, toml_of(&urls, &output, &arguments))?;
        let done = watched_job(&config, &output, scratch.path(), &arguments)?;
        done.print(targets.len())?;
        fs::remove_dir_all(&output)?;
    }
    Ok(())
}

/// Returns the configuration of a job that reads `urls` and writes to `output`.
fn toml_of(urls: &[String], output: &Path, arguments: &Arguments) -> String {
    let format = if arguments.flat { "glb" } else { "3dtiles" };
    let tiles = format!("format = {format:?}\ncompression = \"none\"\nlevels = false");
    let limits = format!("memory = \"{} MiB\"\nthreads = 2", arguments.memory);
    format!("[input]\nfiles = {urls:?}\n[output]\ndirectory = {output:?}\n{tiles}\n[limits]\n{limits}\n")
}

/// A job that is done, and what was seen of it.
struct Done {
    report: Value,
    verdict: Verdict,
    samples: Vec<Sample>,
    /// The most bytes of tiles that waited for their proof at once.
    waiting: u64,
    /// Seconds of processor time of this process: the server and the proof.
    own_cpu: f64,
}

/// What was seen of the job in one moment.
struct Sample {
    /// Seconds since the start of the job.
    at: f64,
    /// Seconds since the moment before.
    seconds: f64,
    /// Worker threads that run, or wait for a processor or the disk.
    busy: usize,
}

fn watched_job(config: &Path, output: &Path, scratch: &Path, arguments: &Arguments) -> Outcome<Done> {
    let own_start = cpu_time::ProcessTime::now();
    let mut program = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
    // It is right that the disk has no room for all results, but they do not stay.
    let mut job = program.arg("--force").arg(config).env("NO_PROXY", "127.0.0.1").spawn()?;
    let (process, ended) = (job.id().to_string(), AtomicBool::new(false));
    let (seen, samples) = std::thread::scope(|scope| {
        let watching = scope.spawn(|| watch(&process, &ended));
        let mut tiles = SeenTiles { proof: None, seen: HashSet::new(), waiting: 0, keep: arguments.keep };
        let checked = check_until_end(&mut job, &mut tiles, output, scratch, arguments.free);
        ended.store(true, Ordering::Relaxed);
        (checked.map(|()| tiles), watching.join().expect("the watching thread does not panic"))
    });
    let SeenTiles { proof, waiting, .. } = seen?;
    let verdict = proof.ok_or("the job wrote no tile")?.conclude(output)?;
    if arguments.keep && verify::verify(output, PROOF_MEMORY)? != verdict {
        return Err("verify comes to another verdict".into());
    }
    let report = serde_json::from_slice(&fs::read(output.join("report.json"))?)?;
    Ok(Done { report, verdict, samples, waiting, own_cpu: own_start.elapsed().as_secs_f64() })
}

/// Checks the tiles of `job` until it has ended, and those that are left then.
fn check_until_end(job: &mut Child, tiles: &mut SeenTiles, output: &Path, scratch: &Path, free: u64) -> Outcome<()> {
    let waiting = output.join("job/results");
    loop {
        let ended = job.try_wait()?;
        let checked = tiles.check_new(if ended.is_some() { output } else { &waiting }, scratch);
        let left = rustix::fs::statvfs(scratch).map(|disk| disk.f_bavail * disk.f_frsize);
        let stop = match (checked, left) {
            (Err(error), _) => Some(error),
            (_, Err(error)) => Some(error.into()),
            (_, Ok(left)) if left < free => Some(format!("only {} MiB of the disk are free", left >> 20).into()),
            _ => None,
        };
        match (ended, stop) {
            (None, None) => std::thread::sleep(BETWEEN_PROOFS),
            (Some(status), None) if status.success() => return Ok(()),
            (Some(status), None) => return Err(format!("the job ended with {status}").into()),
            (_, Some(error)) => {
                job.kill()?;
                job.wait()?;
                return Err(error);
            }
        }
    }
}

/// The tiles that were checked.
struct SeenTiles {
    /// Begins with the first tile.
    proof: Option<GrowingProof>,
    /// Their names.
    seen: HashSet<String>,
    /// The most bytes of tiles that waited at once.
    waiting: u64,
    keep: bool,
}

impl SeenTiles {
    /// Checks the tiles in the folder `results` that are new, and truncates them.
    fn check_new(&mut self, results: &Path, scratch: &Path) -> Outcome<()> {
        let mut names = Vec::new();
        tile_names(results, &results.join("tiles"), &mut names)?;
        names.retain(|name| !self.seen.contains(name));
        let sizes = names.iter().filter_map(|name| results.join(name).metadata().ok()).map(|file| file.len());
        self.waiting = self.waiting.max(sizes.sum());
        let Some(first) = names.first() else { return Ok(()) };
        let proof = match self.proof.take() {
            Some(proof) => proof,
            None => GrowingProof::begin(&results.join(first), scratch, PROOF_MEMORY)?,
        };
        let checked = names.par_iter().map(|name| self.check(&proof, results, name).map(|is_there| (name, is_there)));
        let checked: Vec<(&String, bool)> = checked.collect::<Result<_, String>>()?;
        self.seen.extend(checked.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name.clone()));
        self.proof = Some(proof);
        Ok(())
    }

    /// Checks a tile. Returns whether it is there: at its end the job moves all to their places.
    fn check(&self, proof: &GrowingProof, results: &Path, name: &str) -> Result<bool, String> {
        let path = results.join(name);
        let Ok(file) = fs::File::options().read(true).write(true).open(&path) else { return Ok(false) };
        match proof.check(&path, name) {
            Ok(()) if self.keep => Ok(true),
            Ok(()) => file.set_len(0).map(|()| true).map_err(|error| format!("{name}: {error}")),
            Err(_) if !path.exists() => Ok(false),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Finds the tiles in `folder` that have their names, which begin at the folder `results`.
fn tile_names(results: &Path, folder: &Path, names: &mut Vec<String>) -> Outcome<()> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let (path, kind) = entry.and_then(|entry| Ok((entry.path(), entry.file_type()?)))?;
        if kind.is_dir() {
            tile_names(results, &path, names)?;
        } else if path.extension().is_some_and(|ending| ending == "glb") {
            names.push(path.strip_prefix(results)?.to_string_lossy().into_owned());
        }
    }
    Ok(())
}

fn watch(process: &str, ended: &AtomicBool) -> Vec<Sample> {
    let (start, mut samples, mut turns, mut before) = (Instant::now(), Vec::new(), HashMap::new(), 0.0);
    while !ended.load(Ordering::Relaxed) {
        let states = states_of_workers(process, &mut turns);
        let busy = states.iter().filter(|state| matches!(state, b'R' | b'D')).count();
        let at = start.elapsed().as_secs_f64();
        samples.push(Sample { at, seconds: at - before, busy });
        before = at;
        std::thread::sleep(INTERVAL);
    }
    samples
}

impl Done {
    fn print(&self, copies: usize) -> Outcome<()> {
        let number = |name: &str| self.report[name].as_f64().ok_or_else(|| format!("the report has no {name}"));
        let (points, wall, cpu) =
            (self.report["points"]["read"].as_f64().unwrap_or(0.0), number("wall_s")?, number("cpu_s")?);
        println!("\n{copies} copies, {points} points, {} parts, {} tiles", self.report["parts"], self.report["tiles"]);
        println!("  wall {wall:.1} s, CPU {cpu:.1} s, {:.4} µs a point", cpu / points * 1e6);
        println!("  server and proof {:.1} s of CPU, {:.4} µs a point", self.own_cpu, self.own_cpu / points * 1e6);
        println!(
            "  peak memory {:.1} MiB, temporary files {:.2} bytes a point, at most {:.0} MiB of tiles unproved",
            number("peak_memory")? / f64::from(1 << 20),
            number("bytes_temporary")? / points,
            self.waiting as f64 / f64::from(1 << 20)
        );
        println!("  stage                 wall s      CPU s  CPU, ns a point   threads");
        for stage in self.report["stages"].as_array().into_iter().flatten() {
            let [wall, cpu] = ["wall_s", "cpu_s"].map(|name| stage[name].as_f64().unwrap_or(f64::NAN));
            let name = stage["stage"].as_str().unwrap_or_default();
            println!("  {name:<16} {wall:>11.2} {cpu:>10.2} {:>16.2} {:>9.2}", cpu / points * 1e9, cpu / wall);
        }
        println!("  from                  wall s  at most one thread runs");
        let mut ends = self.starts();
        ends.rotate_left(1);
        for ((name, start), (_, end)) in self.starts().into_iter().zip(ends) {
            let end = if end > start { end } else { wall };
            let within = || self.samples.iter().filter(|sample| (start..end).contains(&sample.at));
            let all: f64 = within().map(|sample| sample.seconds).sum();
            let one: f64 = within().filter(|sample| sample.busy <= 1).map(|sample| sample.seconds).sum();
            println!("  {name:<16} {all:>11.2} {:>10.2} s {:>5.1} % of the job", one, 100.0 * one / wall);
        }
        println!("{}", self.verdict);
        Ok(())
    }

    /// Returns when the stages begin that every part has ended before, in their order.
    fn starts(&self) -> Vec<(&str, f64)> {
        let start = |name: &str| {
            let mut stages = self.report["stages"].as_array().into_iter().flatten();
            stages.find(|stage| stage["stage"] == name).and_then(|stage| stage["start_s"].as_f64())
        };
        let known = ["plan", "read", "levels", "publish"].map(|name| Some((name, start(name)?)));
        let mut starts: Vec<(&str, f64)> = known.into_iter().flatten().collect();
        starts.sort_by(|a, b| a.1.total_cmp(&b.1));
        starts
    }
}
