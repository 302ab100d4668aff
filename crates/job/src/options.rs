//! The options of a job: those of each crate, and `[limits]`.

use crate::progress::stage::ProgressOutput;
use delaunay_gpu::options::GpuOptions;
use delaunay_gpu::triangulation_options::{MaxPointsPerPart, TriangulationOptions};
use points::lines::options::LineOptions;
use points::options::InputOptions;
use serde::{Deserialize, Serialize};
use sys::Warnings;
use sys::threads::available;
use tiles::options::OutputOptions;

/// Everything that a user says about a job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JobOptions {
    /// What to read.
    pub input: InputOptions,
    /// Which lines become edges of the mesh.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub breaklines: Vec<LineOptions>,
    /// How to triangulate.
    pub triangulation: TriangulationOptions,
    /// How to use a GPU.
    pub gpu: GpuOptions,
    /// What to write.
    pub output: OutputOptions,
    /// What the job may use of the machine.
    pub limits: Limits,
    /// Whether the job keeps what a later run needs that does only what has changed since.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub updates: bool,
    /// What the user should know about the options themselves.
    #[serde(default, skip_serializing_if = "Warnings::is_empty")]
    pub warnings: Warnings,
}

/// Twice as many threads as processors use the time that inputs on a network take to arrive. More only take each other's cache: 64
/// threads on two processors take an eighth more processor time than two.
const MOST_PER_PROCESSOR: usize = 2;

/// About how many points a part has of a job with `--update`: about those of one file of a survey. A change takes the parts that it
/// touches; smaller parts take more time for what is between them.
const POINTS_PER_PART_OF_UPDATES: MaxPointsPerPart = MaxPointsPerPart(1_000_000);

impl JobOptions {
    /// Tells whether vertices are found among the points: those on the ground, or few of them.
    pub fn leaves_points_out(&self) -> bool {
        self.input.finds_ground() || self.output.selects()
    }

    /// Returns the options of a job that keeps what a later run needs that does only what has changed: its mesh, in small parts.
    #[must_use]
    pub fn with_updates(mut self) -> JobOptions {
        self.updates = true;
        self.limits.keep_steps = KeepSteps::Always;
        if self.triangulation.max_points_per_part == MaxPointsPerPart::default() {
            self.triangulation.max_points_per_part = POINTS_PER_PART_OF_UPDATES;
        }
        self
    }

    /// The number of worker threads, at most two for each processor.
    pub fn threads(&self) -> usize {
        match self.limits.threads.0 {
            0 => available(),
            n => n.min(MOST_PER_PROCESSOR * available()),
        }
    }
}

/// How a job is run. Neither the mesh nor the files depend on it.
#[derive(Clone, Copy, Debug)]
pub struct RunOptions {
    /// Where progress goes.
    pub progress: ProgressOutput,
    /// Whether to run though the disk or the memory seems too small.
    pub force: bool,
    /// Whether to start over instead of continuing an interrupted run.
    pub restart: bool,
    /// Whether to do only what has changed since the last run, and to keep what the next one needs for that.
    pub update: bool,
    /// The submission that starts the job over: what tasks did before it does not count. 0 if there is none.
    pub submission: u64,
}

impl From<ProgressOutput> for RunOptions {
    fn from(progress: ProgressOutput) -> RunOptions {
        RunOptions { progress, force: false, restart: false, update: false, submission: 0 }
    }
}

/// `[limits]`: what the job may use of the machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Peak resident memory.
    pub memory: MemoryLimit,
    /// Worker threads; 0: one per core.
    pub threads: Threads,
    /// Whether the mesh stays on the disk until the end of the job.
    pub keep_steps: KeepSteps,
}

/// Whether the mesh of a job stays on the disk until it is done, though no later phase needs all of it. If it does, an interrupted job can go
/// on with another style; if not, the job takes less of the disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum KeepSteps {
    /// In jobs that take little of the disk.
    #[default]
    Auto,
    /// Yes.
    Always,
    /// No.
    Never,
}

impl KeepSteps {
    /// With "auto", jobs of so many points or fewer keep their mesh. They take about a gigabyte for it.
    const FEW_POINTS: u64 = 30_000_000;

    /// Tells whether a job of `points` points keeps its mesh.
    pub fn keeps(self, points: u64) -> bool {
        match self {
            KeepSteps::Auto => points <= KeepSteps::FEW_POINTS,
            KeepSteps::Always => true,
            KeepSteps::Never => false,
        }
    }
}

impl TryFrom<toml::Value> for KeepSteps {
    type Error = String;

    fn try_from(value: toml::Value) -> std::result::Result<KeepSteps, String> {
        match value {
            toml::Value::String(s) if s == "auto" => Ok(KeepSteps::Auto),
            toml::Value::Boolean(true) => Ok(KeepSteps::Always),
            toml::Value::Boolean(false) => Ok(KeepSteps::Never),
            _ => Err("keep_steps is \"auto\", true or false".into()),
        }
    }
}

impl From<KeepSteps> for toml::Value {
    fn from(keep: KeepSteps) -> toml::Value {
        match keep {
            KeepSteps::Auto => toml::Value::String("auto".into()),
            KeepSteps::Always => toml::Value::Boolean(true),
            KeepSteps::Never => toml::Value::Boolean(false),
        }
    }
}

/// How many worker threads; 0: one per core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "i64")]
pub struct Threads(pub usize);

impl TryFrom<i64> for Threads {
    type Error = String;

    fn try_from(threads: i64) -> std::result::Result<Threads, String> {
        match threads {
            0..=1024 => Ok(Threads(threads as usize)),
            _ => Err(format!("threads is a number from 0 (one per core) to 1024, not {threads}")),
        }
    }
}

/// An amount of memory in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct MemoryLimit(pub u64);

impl MemoryLimit {
    /// Below this not even the buffers of one tile are sure to fit.
    const LEAST: u64 = 128 << 20;
}

impl Default for MemoryLimit {
    fn default() -> MemoryLimit {
        MemoryLimit(4 << 30)
    }
}

impl TryFrom<String> for MemoryLimit {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<MemoryLimit, String> {
        let bytes = parse_memory(&text).ok_or_else(|| {
            format!(
                "memory is a text such as \"4 GiB\", \"4G\" (the same) or \"800 MB\" (800 million bytes), not {text:?}"
            )
        })?;
        if bytes < MemoryLimit::LEAST {
            return Err(format!("memory must be at least {}", MemoryLimit(MemoryLimit::LEAST)));
        }
        Ok(MemoryLimit(bytes))
    }
}

impl From<MemoryLimit> for String {
    /// Returns the exact number of bytes; what is displayed is rounded.
    fn from(memory: MemoryLimit) -> String {
        format!("{} B", memory.0)
    }
}

impl std::fmt::Display for MemoryLimit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (value, unit) = match self.0 {
            b if b >= 1 << 30 => (b as f64 / (1u64 << 30) as f64, "GiB"),
            b if b >= 1 << 20 => (b as f64 / (1u64 << 20) as f64, "MiB"),
            b => (b as f64 / 1024.0, "KiB"),
        };
        let decimals = if value.fract() == 0.0 { 0 } else { 1 };
        write!(f, "{value:.decimals$} {unit}")
    }
}

/// Returns the bytes of a text. A letter alone is a power of 1024, as for `java -Xmx`, Docker and Slurm; with a B it is a power of
/// 1000.
fn parse_memory(text: &str) -> Option<u64> {
    let text = text.trim();
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let value: f64 = text[..split].parse().ok()?;
    let unit: f64 = match text[split..].trim().to_ascii_lowercase().as_str() {
        "b" => 1.0,
        "kib" | "k" => 1024.0,
        "mib" | "m" => 1024.0 * 1024.0,
        "gib" | "g" => 1024.0 * 1024.0 * 1024.0,
        "tib" | "t" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return None,
    };
    Some((value * unit) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_of_memory() {
        assert_eq!(parse_memory("4 GiB"), Some(4 << 30));
        assert_eq!(parse_memory("1.5GB"), Some(1_500_000_000));
        assert_eq!(parse_memory("4G"), Some(4 << 30));
        assert_eq!(parse_memory("4 g"), parse_memory("4GiB"));
        assert_eq!((parse_memory("800M"), parse_memory("800 MiB")), (Some(800 << 20), Some(800 << 20)));
        assert_eq!((parse_memory("800MB"), parse_memory("4GB")), (Some(800_000_000), Some(4_000_000_000)));
        assert_eq!(parse_memory("4 Gi"), None);
        assert_eq!(parse_memory("12"), None);
        assert_eq!(parse_memory("GiB"), None);
        assert_eq!(MemoryLimit(1 << 30).to_string(), "1 GiB");
        assert_eq!(MemoryLimit(1_500_000_000).to_string(), "1.4 GiB");
    }
}
