//! What share of a job is serial: `cargo bench --features fault-injection --bench serial [-- FILE.laz [RUNS [THREADS...]]]`.
//!
//! A job is run with each number of threads in turn, each in a process of its own: plain tiles, the same from LAS, and packed with
//! levels, as in the benchmark `job`. Meanwhile a thread looks every few milliseconds which worker threads run. A thread runs if it is
//! on a processor, waits for one, or waits for the disk (state R or D). So more threads than there are processors count as well: the
//! job believes in as many processors as it has threads (`GDT_PROCESSORS`).
//!
//! For each stage this prints:
//! - the wall time and the processor time;
//! - the share of the wall time in which fewer threads run than there are, and in which at most one runs;
//! - what the stage would take if every thread had a processor of its own, the same shares of that time, and how many threads run on
//!   average. A moment takes its processor time divided by the threads that run: where ten share two processors, ten processors need a
//!   fifth of the time. Other programs on the machine do not count. It is an estimate, which knows nothing of caches and of memory.
//!
//! The default FILE is that of the benchmark `job`, the default number of RUNS is 3, and their times are averaged. The default THREADS
//! are 2 and 16. Linux only.

mod jobs;
mod threads;

use cpu_time::{ProcessTime, ThreadTime};
use job::progress::stage::ProgressOutput;
use job::report::job_report::Report;
use jobs::{FULL, Outcome, PLAIN, as_las, default_file, empty, write_config};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use threads::states_of_workers;

/// The time between two looks at the threads.
const INTERVAL: Duration = Duration::from_millis(3);

/// The first argument of the process of one job.
const ONE_JOB: &str = "one-job";

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if let [first, config] = &arguments[..]
        && first == ONE_JOB
    {
        println!("{}", serde_json::to_string(&watched_job(Path::new(config))?)?);
        return Ok(());
    }
    let scratch = tempfile::tempdir()?;
    let file = match arguments.first() {
        Some(path) => PathBuf::from(path),
        None => default_file(scratch.path())?,
    };
    let runs: usize = arguments.get(1).map_or(Ok(3), |n| n.parse())?;
    let threads = arguments.iter().skip(2).map(|n| n.parse()).collect::<Result<Vec<usize>, _>>()?;
    let threads = if threads.is_empty() { vec![2, 16] } else { threads };
    let unpacked = as_las(&file, scratch.path())?;
    let cases =
        [("plain tiles", &file, PLAIN), ("plain tiles, LAS", &unpacked, PLAIN), ("packed, levels", &file, FULL)];
    let processors = std::thread::available_parallelism()?.get();
    println!("{}, {runs} runs, means, {processors} processors", file.display());
    for (case, (name, input, look)) in cases.iter().enumerate() {
        let mut samples = vec![Vec::new(); threads.len()];
        for run in 0..runs {
            for (of_threads, &threads) in samples.iter_mut().zip(&threads) {
                let output = scratch.path().join(format!("{case}-{run}-{threads}"));
                let more = format!("{look}\n[limits]\nmemory = \"2 GiB\"\nthreads = {threads}");
                of_threads.extend(in_process(&write_config(input, &output, &more)?, threads)?);
                empty(&output)?;
            }
        }
        for (samples, &threads) in samples.iter().zip(&threads) {
            print_stages(name, samples, threads, runs);
        }
    }
    Ok(())
}

/// Runs the job of `config` in a process that believes to have `threads` processors, and returns what was seen of it.
fn in_process(config: &Path, threads: usize) -> Outcome<Vec<Sample>> {
    let mut command = Command::new(std::env::current_exe()?);
    let output = command.arg(ONE_JOB).arg(config).env("GDT_PROCESSORS", threads.to_string()).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// What was seen of a job in one moment.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Sample {
    stage: String,
    /// Seconds since the moment before.
    seconds: f64,
    /// Seconds of processor time since then.
    cpu: f64,
    /// Worker threads that run, or wait for a processor.
    running: usize,
    /// Worker threads that wait for the disk.
    waiting: usize,
}

/// Runs a job and watches its threads.
fn watched_job(config: &Path) -> Outcome<Vec<Sample>> {
    let options = gdt_batch::config::load(config)?;
    let ended = AtomicBool::new(false);
    let (start, report, moments) = std::thread::scope(|scope| {
        let watching = scope.spawn(|| watch(&ended));
        let start = Instant::now();
        let report = job::run(&options, ProgressOutput::Quiet);
        ended.store(true, Ordering::Relaxed);
        (start, report, watching.join().expect("the watching thread does not panic"))
    });
    let report = report?;
    if report.threads != options.limits.threads.0 {
        return Err(format!("{} threads were started", report.threads).into());
    }
    let stages = Stages::of(&report);
    let of_job = moments.windows(2).filter(|pair| pair[1].at >= start);
    let sample = |pair: &[Moment]| Sample {
        stage: stages.at((pair[1].at - start).as_secs_f64()),
        seconds: (pair[1].at - pair[0].at.max(start)).as_secs_f64(),
        cpu: pair[1].cpu - pair[0].cpu,
        running: pair[1].running,
        waiting: pair[1].waiting,
    };
    Ok(of_job.map(sample).collect())
}

/// When the stages of a job ran, in seconds from its start.
struct Stages(Vec<(&'static str, f64, f64)>);

impl Stages {
    /// The order matters: border normals and tiles are written while others are triangulated.
    const NAMES: [(&'static str, &'static str); 7] = [
        ("plan", "plan"),
        ("read", "read"),
        ("triangulate", "triangulate, write"),
        ("border normals", "write the rest"),
        ("write", "write the rest"),
        ("levels", "levels"),
        ("publish", "publish"),
    ];

    fn of(report: &Report) -> Stages {
        let of_name = |(name, shown): &(&str, &'static str)| {
            let stage = report.stages.iter().find(|stage| stage.stage == *name)?;
            Some((*shown, stage.start_s, stage.start_s + stage.wall_s))
        };
        Stages(Stages::NAMES.iter().filter_map(of_name).collect())
    }

    fn at(&self, seconds: f64) -> String {
        let running = self.0.iter().find(|(_, start, end)| (*start..*end).contains(&seconds));
        let last = self.0.iter().map(|(_, _, end)| *end).fold(0.0, f64::max);
        let first = self.0.iter().map(|(_, start, _)| *start).fold(f64::INFINITY, f64::min);
        let besides = if seconds < first {
            "before"
        } else if seconds >= last {
            "after"
        } else {
            "between"
        };
        running.map_or(besides, |(name, ..)| name).to_string()
    }
}

/// A look at the threads of this process.
struct Moment {
    at: Instant,
    /// Seconds of processor time of all threads but the one that looks.
    cpu: f64,
    running: usize,
    waiting: usize,
}

fn watch(ended: &AtomicBool) -> Vec<Moment> {
    let (mut moments, mut turns) = (Vec::new(), HashMap::new());
    while !ended.load(Ordering::Relaxed) {
        let cpu = ProcessTime::now().as_duration().as_secs_f64() - ThreadTime::now().as_duration().as_secs_f64();
        let states = states_of_workers("self", &mut turns);
        let [running, waiting] = [b'R', b'D'].map(|state| states.iter().filter(|seen| **seen == state).count());
        moments.push(Moment { at: Instant::now(), cpu, running, waiting });
        std::thread::sleep(INTERVAL);
    }
    moments
}

/// The times of a stage.
#[derive(Default)]
struct Totals {
    wall: f64,
    cpu: f64,
    /// Wall time with fewer threads than there are, and with at most one.
    short: [f64; 2],
    /// The same if every thread had a processor.
    own_wall: f64,
    own_short: [f64; 2],
    /// The sum of the times of all threads.
    busy: f64,
}

impl Totals {
    fn add(&mut self, sample: &Sample, threads: usize) {
        let busy = (sample.running + sample.waiting).min(threads);
        let own = match busy {
            0 => sample.seconds,
            _ => (sample.cpu + sample.waiting as f64 * sample.seconds) / busy as f64,
        };
        self.wall += sample.seconds;
        self.cpu += sample.cpu;
        self.own_wall += own;
        self.busy += own * busy as f64;
        for (at, is_short) in [busy < threads, busy <= 1].into_iter().enumerate() {
            self.short[at] += if is_short { sample.seconds } else { 0.0 };
            self.own_short[at] += if is_short { own } else { 0.0 };
        }
    }

    fn print(&self, name: &str, runs: usize) {
        let runs = runs as f64;
        let percent = |part: f64, whole: f64| 100.0 * part / whole.max(f64::MIN_POSITIVE);
        println!(
            "  {name:<20} {:>7.3} {:>7.3} {:>7.0} % {:>5.0} % {:>12.3} {:>7.0} % {:>5.0} % {:>6.1}",
            self.wall / runs,
            self.cpu / runs,
            percent(self.short[0], self.wall),
            percent(self.short[1], self.wall),
            self.own_wall / runs,
            percent(self.own_short[0], self.own_wall),
            percent(self.own_short[1], self.own_wall),
            self.busy / self.own_wall.max(f64::MIN_POSITIVE),
        );
    }
}

fn print_stages(case: &str, samples: &[Sample], threads: usize, runs: usize) {
    println!("\n{case}, {threads} threads");
    println!("  stage                 wall s   cpu s  fewer run  <= 1  s, a processor each  fewer  <= 1  run");
    let shown =
        ["before", "plan", "between", "read", "triangulate, write", "write the rest", "levels", "publish", "after"];
    let mut all = Totals::default();
    for stage in shown {
        let mut totals = Totals::default();
        for sample in samples.iter().filter(|sample| sample.stage == stage) {
            totals.add(sample, threads);
            all.add(sample, threads);
        }
        if totals.wall > 0.0 {
            totals.print(stage, runs);
        }
    }
    all.print("whole job", runs);
}
