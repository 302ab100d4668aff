//! What a job came to: a table for people, the same as `report.json` for machines.

use crate::geometry::lattice::Lattice;
use crate::input::PointCounts;
use crate::job::levels::level::LevelFigures;
use crate::job::mesh::leaf::LeafFigures;
use crate::job::partition::read::Skipped;
use crate::job::plan::scan::Plan;
use crate::job::progress::machine;
use crate::job::progress::stage::{Clock, Schedule, StageFigures};
use crate::job::tiles::write::TileFigures;
use crate::triangulation::Outcome;
use crate::voronoi::STEPS;
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
    /// Triangles that `max_edge` leaves out; they are in `cut`.
    #[serde(default)]
    pub cut_triangles: u64,
    /// GLB files in `tiles`.
    pub tiles: u64,
    /// The coarser tiles in `levels`.
    pub levels: LevelFigures,
    /// The share of the triangles that cross a border between tiles.
    pub seam_share: f64,
    /// Points dropped because another has the same x and y.
    pub duplicates: u64,
    /// The inputs that were read.
    pub files: usize,
    /// The inputs that were left out because they are bad; no other figure counts them.
    pub skipped: Vec<Skipped>,
    /// Records by what became of them.
    pub points: PointCounts,
    /// How the leaves came to be.
    pub leaves: LeafFigures,
    /// The GPU that helped.
    pub gpu: Option<String>,
    /// What the pipeline's steps took of all leaves together: on the workers, and on the GPU itself where it tells.
    pub steps: Steps,
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
    /// How many steps were taken over from a run that was interrupted; their times are not in the stages.
    pub resumed: u64,
    /// Seconds from start to end.
    pub wall_s: f64,
    /// Seconds of processor time of all threads, those among them that belong to no stage.
    #[serde(default)]
    pub cpu_s: f64,
    /// The stages in the order in which they begin; some go on side by side.
    pub stages: Vec<StageFigures>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Seconds by step of the pipeline.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Steps {
    /// On the workers, all of them together.
    pub cpu: Vec<StepSeconds>,
    /// On the GPU.
    pub gpu: Vec<StepSeconds>,
}

/// One step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StepSeconds {
    /// Its name in the paper.
    pub step: String,
    /// Seconds.
    pub seconds: f64,
}

impl Steps {
    fn new(leaves: &LeafFigures, gpu: &[(&'static str, f64)]) -> Steps {
        let named = |(step, seconds): (&str, f64)| StepSeconds { step: step.into(), seconds };
        let nanoseconds = leaves.outcome.counts.nanoseconds;
        let cpu = STEPS.into_iter().zip(nanoseconds.map(|ns| ns as f64 / 1e9)).filter(|(_, seconds)| *seconds > 0.0);
        Steps { cpu: cpu.map(named).collect(), gpu: gpu.iter().copied().map(named).collect() }
    }
}

/// The figures of the stages, before they become a report.
pub struct Parts {
    /// What was read.
    pub points: PointCounts,
    /// What the leaves came to.
    pub leaves: LeafFigures,
    /// The GPU that helped.
    pub gpu: Option<String>,
    /// Seconds by step on that GPU.
    pub gpu_steps: Vec<(&'static str, f64)>,
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
    /// Steps taken over from a run that was interrupted.
    pub resumed: u64,
    /// Since the start.
    pub clock: Clock,
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
            cut_triangles: parts.tiles.cut_triangles,
            tiles: parts.tiles.files,
            levels: parts.levels,
            seam_share: parts.tiles.seam_triangles as f64 / parts.tiles.triangles.max(1) as f64,
            duplicates: parts.leaves.duplicates,
            files: plan.sources.len(),
            skipped: plan.skipped.clone(),
            points: parts.points,
            leaves: parts.leaves,
            gpu: parts.gpu,
            steps: Steps::new(&parts.leaves, &parts.gpu_steps),
            lattice: plan.lattice.clone(),
            unit: plan.unit.into(),
            crs: plan.crs.name.clone(),
            bytes_written: parts.tiles.bytes + parts.levels.bytes + parts.other_bytes,
            bytes_temporary: parts.temporary,
            peak_memory: machine::peak_memory(),
            memory_limit: parts.memory,
            threads: parts.threads,
            resumed: parts.resumed,
            wall_s: parts.clock.wall_s(),
            cpu_s: parts.clock.cpu_s(),
            stages: parts.stages,
            warnings,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<12} {:>9} {:>9} {:>9} {:>14}  rate", "stage", "from s", "wall s", "cpu s", "done")?;
        for stage in &self.stages {
            let rate = if stage.done > 0 { stage.done as f64 / stage.wall_s.max(1e-9) } else { 0.0 };
            writeln!(
                f,
                "{:<12} {:>9.2} {:>9.2} {:>9.2} {:>14}  {} {}/s",
                stage.stage,
                stage.start_s,
                stage.wall_s,
                stage.cpu_s,
                grouped(stage.done),
                grouped(rate as u64),
                stage.unit
            )?;
        }
        writeln!(f, "{:<12} {:>9} {:>9.2} {:>9.2}\n", "all", "", self.wall_s, self.cpu_s)?;
        for (unit, steps) in [("cpu s", &self.steps.cpu), ("gpu s", &self.steps.gpu)] {
            for (i, StepSeconds { step, seconds }) in steps.iter().enumerate() {
                let head = if i == 0 { format!("triangulate by step, {unit}") } else { String::new() };
                writeln!(f, "{head:<28} {step:<40} {seconds:>9.2}")?;
            }
        }
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
        if self.cut_triangles > 0 {
            row("  left out (max_edge)", grouped(self.cut_triangles))?;
        }
        row("tiles", grouped(self.tiles))?;
        if self.levels.files > 0 {
            let levels = &self.levels;
            row("coarser tiles", format!("{}, at most {:.2} m off", grouped(levels.files), levels.error_m))?;
        }
        let Outcome { pipeline, reference, crowded, not_accepted, counts } = &self.leaves.outcome;
        let leaves = pipeline + reference + crowded + not_accepted;
        row(
            "leaves",
            format!(
                "{}, of them by spade {} ({crowded} crowded, {not_accepted} not accepted, {reference} other)",
                grouped(leaves),
                grouped(leaves - pipeline)
            ),
        )?;
        row("  sites moved to other pixels", grouped(counts.moved))?;
        row("  sites missing, inserted", grouped(counts.missing))?;
        row(
            "  inverted triangles",
            format!("{}, sites taken out {}", grouped(counts.inverted), grouped(counts.removed)),
        )?;
        row("  edges flipped", grouped(counts.flips))?;
        if let Some(gpu) = &self.gpu {
            row("  with the help of a GPU", format!("{} ({gpu})", grouped(self.leaves.outcome.counts.on_gpu)))?;
        }
        row("lattice step", format!("{} (z {}) {}", self.lattice.resolution, self.lattice.resolution_z, self.unit))?;
        row("written", megabytes(self.bytes_written))?;
        row("temporary files", megabytes(self.bytes_temporary))?;
        if self.resumed > 0 {
            row("steps taken over", format!("{} of the run that was interrupted", grouped(self.resumed)))?;
        }
        let peak = self.peak_memory.map_or("unknown".into(), megabytes);
        row("peak memory", format!("{peak} of {}", megabytes(self.memory_limit)))?;
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        write_skipped(f, self.files, &self.skipped)
    }
}

/// Says how many of all inputs are left out, and each of them with its reason; nothing where none is.
pub(crate) fn write_skipped(f: &mut fmt::Formatter<'_>, used: usize, skipped: &[Skipped]) -> fmt::Result {
    if let Some(summary) = skipped_summary(used, skipped) {
        writeln!(f, "\n{summary}:")?;
    }
    skipped.iter().try_for_each(|bad| writeln!(f, "  {}: {}", bad.file.display(), bad.why))
}

/// A sentence on the inputs that are left out; `None` where none is.
pub fn skipped_summary(used: usize, skipped: &[Skipped]) -> Option<String> {
    let (bad, all) = (skipped.len(), used + skipped.len());
    (bad > 0).then(|| format!("LEFT OUT: {bad} of {all} input files, because they are bad and on_bad_file = \"skip\""))
}

/// Says so when an input is left out.
pub(crate) fn note_skipped(skipped: &[Skipped], progress: &Schedule) {
    for bad in skipped {
        progress.note(&format!("left out: {}: {}", bad.file.display(), bad.why));
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
