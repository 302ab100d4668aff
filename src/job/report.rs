//! What a job came to: a table for people, the same as `report.json` for machines.

use super::export::TileFigures;
use super::leaf::LeafFigures;
use super::levels::LevelFigures;
use super::progress::StageFigures;
use super::scan::Plan;
use crate::geometry::lattice::Lattice;
use crate::input::Tally;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The report of a finished job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// Program and version.
    pub generator: String,
    /// Distinct sites in the mesh.
    pub sites: u64,
    /// Triangles in all tiles.
    pub triangles: u64,
    /// GLB files in `tiles`.
    pub tiles: u64,
    /// The coarser tiles in `levels`.
    pub levels: LevelFigures,
    /// The share of the triangles that cross a border between tiles.
    pub seam_share: f64,
    /// Points dropped because another has the same x and y.
    pub duplicates: u64,
    /// The inputs.
    pub files: usize,
    /// Records by what became of them.
    pub points: Tally,
    /// How the leaves came to be.
    pub leaves: LeafFigures,
    /// The GPU that helped.
    pub gpu: Option<String>,
    /// The lattice.
    pub lattice: Lattice,
    /// Unit of x and y.
    pub unit: String,
    /// Name of the CRS.
    pub crs: Option<String>,
    /// Bytes of all results.
    pub bytes_written: u64,
    /// Bytes of temporary files at their most.
    pub bytes_temporary: u64,
    /// The largest resident set of the process, in bytes; `None` where the system does not tell.
    pub peak_memory: Option<u64>,
    /// The memory the job was given, in bytes.
    pub memory_limit: u64,
    /// Worker threads.
    pub threads: usize,
    /// Seconds from start to end.
    pub wall_s: f64,
    /// The stages in order.
    pub stages: Vec<StageFigures>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The figures of the stages, before they become a report.
pub struct Parts {
    /// What was read.
    pub points: Tally,
    /// What the leaves came to.
    pub leaves: LeafFigures,
    /// The GPU that helped.
    pub gpu: Option<String>,
    /// What the tiles came to.
    pub tiles: TileFigures,
    /// What the coarser tiles came to.
    pub levels: LevelFigures,
    /// What the user should know of the results.
    pub warnings: Vec<String>,
    /// Bytes of results beside the tiles.
    pub other_bytes: u64,
    /// Bytes of temporary files.
    pub temporary: u64,
    /// The stages.
    pub stages: Vec<StageFigures>,
    /// Worker threads.
    pub threads: usize,
    /// The memory limit in bytes.
    pub memory: u64,
    /// Seconds since the start.
    pub wall_s: f64,
}

impl Report {
    /// Puts the report together.
    pub fn new(plan: &Plan, parts: Parts) -> Report {
        let mut warnings = plan.warnings.clone();
        let rounded = |count: u64, what: &str, step| {
            format!("{} points were rounded in {what} to steps of {step}", grouped(count))
        };
        if parts.points.rounded_xy > 0 {
            warnings.push(rounded(parts.points.rounded_xy, "x or y", plan.lattice.resolution));
        }
        if parts.points.rounded_z > 0 {
            warnings.push(rounded(parts.points.rounded_z, "z", plan.lattice.resolution_z));
        }
        warnings.extend_from_slice(&parts.points.examples);
        warnings.extend(parts.warnings);
        Report {
            generator: concat!("gdt-batch ", env!("CARGO_PKG_VERSION")).into(),
            sites: parts.leaves.sites,
            triangles: parts.tiles.triangles,
            tiles: parts.tiles.files,
            levels: parts.levels,
            seam_share: parts.tiles.seam_triangles as f64 / parts.tiles.triangles.max(1) as f64,
            duplicates: parts.leaves.duplicates,
            files: plan.sources.len(),
            points: parts.points,
            leaves: parts.leaves,
            gpu: parts.gpu,
            lattice: plan.lattice.clone(),
            unit: plan.unit.into(),
            crs: plan.crs.name.clone(),
            bytes_written: parts.tiles.bytes + parts.levels.bytes + parts.other_bytes,
            bytes_temporary: parts.temporary,
            peak_memory: peak_memory(),
            memory_limit: parts.memory,
            threads: parts.threads,
            wall_s: parts.wall_s,
            stages: parts.stages,
            warnings,
        }
    }
}

/// The largest resident set of this process so far, in bytes, where the system tells.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<12} {:>9} {:>9} {:>14}  rate", "stage", "wall s", "cpu s", "done")?;
        for stage in &self.stages {
            let rate = stage.done as f64 / stage.wall_s.max(1e-9);
            writeln!(
                f,
                "{:<12} {:>9.2} {:>9.2} {:>14}  {} {}/s",
                stage.stage,
                stage.wall_s,
                stage.cpu_s,
                grouped(stage.done),
                grouped(rate as u64),
                stage.unit
            )?;
        }
        writeln!(f, "{:<12} {:>9.2}\n", "all", self.wall_s)?;
        let mut row = |name: &str, value: String| writeln!(f, "{name:<28} {value}");
        row("points read", grouped(self.points.read))?;
        row("  withheld", grouped(self.points.withheld))?;
        row("  of other classes", grouped(self.points.other_class))?;
        row("  out of bounds", grouped(self.points.out_of_bounds))?;
        row("  malformed", grouped(self.points.malformed))?;
        row("  duplicates in x, y", grouped(self.duplicates))?;
        row("sites", grouped(self.sites))?;
        row("triangles", grouped(self.triangles))?;
        row("  crossing tile borders", format!("{:.3} %", self.seam_share * 100.0))?;
        row("tiles", grouped(self.tiles))?;
        if self.levels.files > 0 {
            let levels = &self.levels;
            row("coarser tiles", format!("{}, at most {:.2} m off", grouped(levels.files), levels.error_m))?;
        }
        if let Some(gpu) = &self.gpu {
            row("  with the help of a GPU", format!("{} ({gpu})", grouped(self.leaves.outcome.counts.on_gpu)))?;
        }
        row("lattice step", format!("{} (z {}) {}", self.lattice.resolution, self.lattice.resolution_z, self.unit))?;
        row("written", megabytes(self.bytes_written))?;
        row("temporary files", megabytes(self.bytes_temporary))?;
        let peak = self.peak_memory.map_or("unknown".into(), megabytes);
        row("peak memory", format!("{peak} of {}", megabytes(self.memory_limit)))?;
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        Ok(())
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / (1 << 20) as f64)
}

/// `value` with its digits in groups of three.
pub fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn digits_in_groups() {
        assert_eq!([0, 999, 1000, 10_653_336].map(super::grouped), ["0", "999", "1 000", "10 653 336"]);
    }
}
