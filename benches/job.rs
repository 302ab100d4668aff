//! Compares the whole job with decoding alone: `cargo bench --bench job [-- FILE.laz [RUNS]]`.
//!
//! In each run, one process does four things in turn:
//! - one thread only decodes the file with the `las` crate;
//! - a whole job writes plain tiles alone;
//! - the same job reads the same points as LAS;
//! - a job writes everything that viewers use: tiles packed with meshopt, and levels of detail.
//!
//! It prints the medians, their ratios, and the stages of the median jobs. The default FILE is autzen.laz from the test data, or a
//! sample terrain of 4 million points if there is none. The default number of RUNS is 5.

mod jobs;

use job::progress::stage::ProgressOutput;
use job::report::job_report::Report;
use jobs::{FULL, Outcome, PLAIN, as_las, default_file, empty, write_config};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let scratch = tempfile::tempdir()?;
    let file = match arguments.next() {
        Some(path) => PathBuf::from(path),
        None => default_file(scratch.path())?,
    };
    let runs: usize = arguments.next().map_or(Ok(5), |n| n.parse())?;
    let unpacked = as_las(&file, scratch.path())?;
    let cases =
        [("plain tiles", &file, PLAIN), ("plain tiles, LAS", &unpacked, PLAIN), ("packed, levels", &file, FULL)];
    let (mut decoding, mut jobs) = (Vec::new(), [const { Vec::new() }; 3]);
    for run in 0..runs {
        decoding.push(decode(&file)?);
        for (case, (_, input, look)) in cases.iter().enumerate() {
            jobs[case].push(job(input, &scratch.path().join(format!("{case}-{run}")), look)?);
        }
    }
    decoding.sort_by(f64::total_cmp);
    let medians = jobs.map(|mut jobs: Vec<Report>| {
        jobs.sort_by(|a, b| a.wall_s.total_cmp(&b.wall_s));
        jobs.swap_remove(runs / 2)
    });
    let decode = decoding[runs / 2];
    println!("{}, {} runs, medians", file.display(), runs);
    medians.iter().zip(cases).for_each(|(job, (name, ..))| println!("{name}\n{job}"));
    println!("decode only, one thread, las crate  {decode:.2} s");
    for (job, (name, ..)) in medians.iter().zip(cases) {
        println!("whole job, {} threads, {name:<16} {:.2} s, {:.2} x", job.threads, job.wall_s, job.wall_s / decode);
    }
    let [plain, _, full] = medians;
    println!("packing and levels add {:.2} of the job without them", full.wall_s / plain.wall_s - 1.0);
    Ok(())
}

/// Returns the seconds that one thread takes to decode every record as fast as the `las` crate can: in batches, into one buffer.
fn decode(file: &Path) -> Outcome<f64> {
    let start = Instant::now();
    let mut reader = las::Reader::from_path(file)?;
    let mut batch = las::PointDataBuilder::new().for_header(reader.header()).build();
    while reader.fill_points(100_000, &mut batch)? > 0 {}
    Ok(start.elapsed().as_secs_f64())
}

/// Runs a job and returns its report, in which the wall time includes writing the report and cleaning up.
fn job(file: &Path, output: &Path, look: &str) -> Outcome<Report> {
    let config = write_config(file, output, look)?;
    let start = Instant::now();
    let mut report = job::run(&gdt_batch::config::load(&config)?, ProgressOutput::Quiet)?;
    report.wall_s = start.elapsed().as_secs_f64();
    empty(output)?;
    Ok(report)
}
