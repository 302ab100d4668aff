//! A short job on a made-up terrain, with a GPU and without it: whether the results are the same, and how much time the GPU saves.

use crate::exit_code::exit_code;
use crate::{config, sample};
use delaunay_gpu::selftest;
use delaunay_gpu::selftest::SelfTest;
use delaunay_gpu::triangulator::MIN_POINTS_PER_THREAD;
use job::options::RunOptions;
use job::progress::number_text::grouped;
use job::progress::stage::ProgressOutput;
use job::report::job_report::Report;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use sys::{Error, Result, interrupt};

/// Points of the terrain: enough that a job takes seconds.
const POINTS: u64 = 4_000_000;
/// The same for a software renderer, which takes some microseconds a point.
const SOFTWARE_POINTS: u64 = 200_000;
/// How often each job runs, in turn with the other.
const RUNS: usize = 3;
/// Below this share, more or less time is noise.
const NOISE: f64 = 0.05;

/// A job with a GPU beside the same job without it.
#[derive(Clone, Debug, Serialize)]
pub struct GpuTrial {
    /// Points of the terrain.
    pub points: u64,
    /// Seconds that the job takes without the GPU, from the first stage on: the median of some runs.
    pub seconds_without: f64,
    /// As above, with the GPU.
    pub seconds_with: f64,
    /// Leaves of the mesh.
    pub leaves: u64,
    /// Those of them that the GPU made.
    pub on_gpu: u64,
    /// Whether both jobs wrote the same bytes.
    pub same: bool,
}

/// All that `gdt-batch gpu` shows.
#[derive(Clone, Debug, Serialize)]
pub struct GpuCheck {
    /// The steps one by one.
    #[serde(flatten)]
    pub test: SelfTest,
    /// Whole jobs; `None` if nothing was to be timed, a step is wrong, or a job failed.
    pub trial: Option<GpuTrial>,
    /// Why a job failed.
    pub failure: Option<String>,
}

impl GpuCheck {
    /// Returns whether the GPU does everything right.
    pub fn holds(&self) -> bool {
        self.test.holds() && self.trial.as_ref().is_none_or(|trial| trial.same)
    }
}

/// Tests the steps on the GPU called `name` as [`selftest::run`] does, and then whole jobs. With `leaves` = 0 nothing is timed.
///
/// # Errors
/// Those of [`selftest::run`], and [`Error::Interrupted`].
pub fn run(name: Option<&str>, leaves: Option<usize>) -> Result<GpuCheck> {
    let test = selftest::run(name, leaves)?;
    let trial = match &test.gpu {
        Ok(adapter) if test.holds() && leaves != Some(0) => Some(compare_jobs(adapter, test.is_software())),
        _ => None,
    };
    Ok(match trial.transpose() {
        Ok(trial) => GpuCheck { test, trial, failure: None },
        Err(job::Error::System(Error::Interrupted)) => return Err(Error::Interrupted),
        Err(error) => GpuCheck { test, trial: None, failure: Some(error.to_string()) },
    })
}

fn compare_jobs(adapter: &str, is_software: bool) -> job::Result<GpuTrial> {
    // Until here a signal ends the process at once.
    interrupt::listen(exit_code)?;
    let points = if is_software { SOFTWARE_POINTS } else { POINTS };
    let place = tempfile::tempdir().map_err(Error::io("create a directory in", std::env::temp_dir()))?;
    sample::write(&place.path().join("terrain.laz"), points, 1, false)?;
    let [cpu, gpu] = ["cpu", "gpu"].map(|backend| write_config(place.path(), backend, adapter));
    let (cpu, gpu) = (cpu?, gpu?);
    let (mut without, mut with) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        without.push(run_job(&cpu)?);
        with.push(run_job(&gpu)?);
    }
    let files = &without[0].file_list;
    Ok(GpuTrial {
        points,
        seconds_without: median_seconds(&without),
        seconds_with: median_seconds(&with),
        leaves: with[0].leaves.outcome.leaves(),
        on_gpu: with[0].leaves.outcome.counts.on_gpu,
        same: without.iter().chain(&with).all(|report| report.file_list == *files),
    })
}

/// Writes the configuration of a job on the terrain; returns its path.
fn write_config(place: &Path, backend: &str, adapter: &str) -> Result<PathBuf> {
    let path = place.join(format!("{backend}.toml"));
    let adapter = toml::Value::String(adapter.into());
    let text = format!(
        "[input]\nfiles = [\"terrain.laz\"]\n[triangulation]\nbackend = \"{backend}\"\n[gpu]\nadapter = {adapter}\n\
         [output]\ndirectory = \"{backend}\"\n"
    );
    std::fs::write(&path, text).map_err(Error::io("write", &path))?;
    Ok(path)
}

/// Runs a job, and removes its results.
fn run_job(config: &Path) -> job::Result<Report> {
    let options = config::load(config)?;
    let report = job::run(&options, RunOptions { force: true, ..ProgressOutput::Quiet.into() })?;
    let results = &options.output.directory;
    std::fs::remove_dir_all(results).map_err(Error::io("remove", results))?;
    Ok(report)
}

/// Returns the median of the jobs' seconds. To open the device takes as long for a job of any size, and does not count.
fn median_seconds(reports: &[Report]) -> f64 {
    let seconds = |report: &Report| report.wall_s - report.stages.first().map_or(0.0, |stage| stage.start_s);
    let mut seconds: Vec<f64> = reports.iter().map(seconds).collect();
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

impl GpuTrial {
    /// Returns the verdict: a sentence.
    pub fn verdict(&self) -> String {
        let times = self.seconds_without / self.seconds_with;
        if !self.same {
            "the jobs with and without this GPU wrote different bytes: this is a bug in gdt-batch".into()
        } else if self.on_gpu == 0 {
            "this GPU made none of the leaves, so it does not help here".into()
        } else if (1.0 - NOISE..=1.0 + NOISE).contains(&times) {
            "on this machine a job takes about as long with this GPU as without it".into()
        } else if times > 1.0 {
            format!("on this machine a job is about {times:.1} times faster with this GPU")
        } else {
            format!("on this machine a job is about {:.1} times slower with this GPU", times.recip())
        }
    }
}

impl fmt::Display for GpuTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let GpuTrial { points, seconds_without, seconds_with, leaves, on_gpu, .. } = self;
        writeln!(
            f,
            "a job of {} points: {seconds_without:.2} s without the GPU, {seconds_with:.2} s with it once it is open; it made {on_gpu} of \
             {leaves} leaves",
            grouped(*points)
        )?;
        writeln!(f, "{}", self.verdict())?;
        writeln!(
            f,
            "with backend = \"auto\" a job opens a GPU if each of its threads has {} points to do or more",
            grouped(MIN_POINTS_PER_THREAD)
        )
    }
}

impl fmt::Display for GpuCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.test)?;
        self.trial.iter().try_for_each(|trial| write!(f, "\n{trial}"))?;
        let place = std::env::temp_dir();
        let hint =
            |why: &String| format!("no job could be timed in {} (TMPDIR names another folder): {why}", place.display());
        self.failure.iter().try_for_each(|why| writeln!(f, "\n{}", hint(why)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_says_how_much_time_the_gpu_saves() {
        let trial = GpuTrial { points: 1, seconds_without: 3.0, seconds_with: 2.0, leaves: 9, on_gpu: 8, same: true };
        let verdict = |seconds_with, same| GpuTrial { seconds_with, same, ..trial.clone() }.verdict();
        assert!(verdict(2.0, true).ends_with("about 1.5 times faster with this GPU"));
        assert!(verdict(6.0, true).ends_with("about 2.0 times slower with this GPU"));
        assert!(verdict(2.95, true).contains("about as long"));
        assert!(verdict(2.0, false).contains("different bytes"));
        assert!(GpuTrial { on_gpu: 0, ..trial.clone() }.verdict().contains("none of the leaves"));
    }
}
