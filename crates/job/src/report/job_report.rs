//! The report of a finished job, as `report.json` holds it for machines.

use crate::durable::atomic_file::PendingFile;
use crate::levels::make_level::LevelStats;
use crate::machine;
use crate::mesh::hull_rule::HullRule;
use crate::mesh::leaf::LeafStats;
use crate::plan::fingerprint::JobIdentity;
use crate::plan::job_plan::{Plan, SkippedInput};
use crate::plan::text_inputs::text_reading;
use crate::progress::clock::JobClock;
use crate::progress::number_text::grouped;
use crate::progress::stats::StageStats;
use crate::publish::contours::write_contours::ContourStats;
use crate::publish::exports::write_exports::ExportedFile;
use crate::publish::map_tiles::write_map_tiles::MapTileStats;
use crate::publish::published::Published;
use crate::publish::raster::write_raster::RasterStats;
use crate::publish::terrain_tiles::write_terrain::TerrainStats;
use crate::report::breakline_report::BreaklineReport;
use crate::report::change_counts::ChangeCounts;
use crate::report::clip_report::ClipReport;
use crate::report::covered_share::covered_share;
use crate::report::extent::Extent;
use crate::report::selection_report::SelectionReport;
use crate::tiles::vertex_colors::ColorSource;
use crate::tiles::write_tile::TileStats;
use delaunay::voronoi::counts::STEP_NAMES;
use delaunay_gpu::figures::GpuFigures;
use delaunay_gpu::triangulator::Triangulator;
use lattice::Lattice;
use lattice::VertexDigest;
use points::options::InputOptions;
use points::surface::{SurfaceShares, percent};
use points::surface_warnings::unclear_returns;
use points::transformation::{Transformation, transformations};
use points::{NetworkTraffic, PlausiblePoints, PointCounts, TextReading};
use rust_decimal::prelude::ToPrimitive;
use selection::Figures;
use serde::{Deserialize, Serialize};
use sys::Warnings;
use sys::{Error, Result};
use tiles::checksums::{Checksum, seal};
use tiles::options::MaxError;

/// The report of a finished job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// Program and version.
    pub generator: String,
    /// Distinct sites in the mesh.
    pub sites: u64,
    /// How the sites were selected from all points; `None` without `max_error`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selection: Option<SelectionReport>,
    /// The points on the ground, which vertices are taken from; `None` unless `surface = "bare-earth"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground: Option<u64>,
    /// The box around the vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extent: Option<Extent>,
    /// Triangles in all tiles.
    pub triangles: u64,
    /// Triangles that `hull`, `max_edge` or `clip` left out. They are in `cut`.
    #[serde(default)]
    pub cut_triangles: u64,
    /// Those of them that `hull` left out: slivers along the hull.
    #[serde(default)]
    pub hull_triangles: u64,
    /// Slivers have an edge longer than this, in source units; `None` if `hull` leaves nothing out.
    #[serde(default)]
    pub hull_length: Option<f64>,
    /// GLB files in `tiles`.
    pub tiles: u64,
    /// The coarser tiles in `levels`.
    pub levels: LevelStats,
    /// The raster of heights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raster: Option<RasterStats>,
    /// The map tiles of heights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pmtiles: Option<MapTileStats>,
    /// The files with the mesh for CAD and other programs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exports: Vec<ExportedFile>,
    /// How much an update has changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub update: Option<ChangeCounts>,
    /// The contour lines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contours: Option<ContourStats>,
    /// The terrain tiles for globes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<TerrainStats>,
    /// How much of the clip or the bounds the triangles cover, from 0 to 1; `None` without either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covered_share: Option<f64>,
    /// What gives vertices their colours.
    #[serde(default)]
    pub vertex_colors: ColorSource,
    /// The share of the triangles that cross a border between tiles.
    pub seam_share: f64,
    /// Points that were dropped because another has the same x and y.
    pub duplicates: u64,
    /// The number of inputs that were read.
    pub files: usize,
    /// The inputs that were left out because they are bad. No other figure counts them.
    pub skipped: Vec<SkippedInput>,
    /// Numbers of records by what became of them.
    pub points: PointCounts,
    /// What the mesh is, by the classes of the points that were kept: bare earth, or what else is in it.
    #[serde(default)]
    pub surface: Option<String>,
    /// What came of the breaklines; `None` without any.
    #[serde(default)]
    pub breaklines: Option<BreaklineReport>,
    /// The area that points were kept in; `None` for everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clip: Option<ClipReport>,
    /// How the leaves were triangulated.
    pub leaves: LeafStats,
    /// The GPU that helped; `None` without one.
    pub gpu: Option<String>,
    /// What it did.
    #[serde(default)]
    pub gpu_figures: Option<GpuFigures>,
    /// What each step of the pipeline took for all leaves together.
    pub steps: PipelineTimes,
    /// The number of parts.
    #[serde(default)]
    pub parts: u64,
    /// The part that took the longest, in a job of several.
    #[serde(default)]
    pub slowest_part: Option<SlowestPart>,
    /// The lattice.
    pub lattice: Lattice,
    /// Unit of x and y.
    pub unit: String,
    /// Name of the CRS.
    pub crs: Option<String>,
    /// What was transformed, from what into what, and how exactly.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub transformations: Vec<Transformation>,
    /// What the process that wrote the report has asked of other machines; `None` without inputs by URL.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<NetworkTraffic>,
    /// Bytes of all results.
    pub bytes_written: u64,
    /// The most bytes that temporary files took.
    pub bytes_temporary: u64,
    /// The largest resident set of a process of the job, in bytes; `None` where the system does not tell. Of tasks that did the phase
    /// `plan` nothing is known.
    pub peak_memory: Option<u64>,
    /// The memory the job was given, in bytes.
    pub memory_limit: u64,
    /// Worker threads.
    pub threads: usize,
    /// The number of phases that an interrupted run had completed. The stages include their times.
    pub resumed: u64,
    /// Seconds from start to end, of the process that wrote the report. If tasks did the job, from the end of their plan.
    pub wall_s: f64,
    /// Seconds of processor time of all threads, including those of no stage.
    #[serde(default)]
    pub cpu_s: f64,
    /// The stages in the order in which they begin. Some run at the same time. Those of several parts are summed up.
    pub stages: Vec<StageStats>,
    /// What the user should know.
    pub warnings: Warnings,
    /// What the user wants of the inputs; the files themselves are not listed.
    pub input: InputOptions,
    /// How texts were read.
    pub texts: TextReading,
    /// The points of binary files of which some were left out because they lie far from all others, by file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plausible_points: Vec<PlausiblePoints>,
    /// Tells the content of all inputs from that of others, whatever their names and their order: a hash of sizes and samples.
    pub inputs_fingerprint: String,
    /// Tells the options, as far as results depend on them, and the version of the program from others.
    #[serde(default)]
    pub options_fingerprint: Option<Checksum>,
    /// Tells the job from others: by its options, and by the sizes, times and samples of its inputs in their order.
    #[serde(default)]
    pub job_fingerprint: Option<Checksum>,
    /// The number of the submission that started the job over (`gdt-batch submit --restart`); 0 if none did.
    #[serde(default)]
    pub submission: u64,
    /// The digest of all vertices with their heights, on the lattice.
    pub vertex_digest: VertexDigest,
    /// The checksum of `XXH128SUMS`, which has those of all other results.
    pub file_list: Checksum,
    /// The checksum of this report, with zeros in place of it.
    pub checksum: Checksum,
}

/// The part of a job whose phases took the longest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SlowestPart {
    /// Its number, from 0 on.
    pub part: u64,
    /// Seconds that its phases took together.
    pub seconds: f64,
    /// Points that it has.
    pub points: u64,
}

/// Seconds by step of the pipeline.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PipelineTimes {
    /// Processor time of all worker threads together.
    pub cpu: Vec<StepSeconds>,
    /// Time on the GPU, if it tells.
    pub gpu: Vec<StepSeconds>,
}

/// The time of one step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StepSeconds {
    /// Its name in the paper.
    pub step: String,
    /// Seconds.
    pub seconds: f64,
}

impl PipelineTimes {
    fn new(leaves: &LeafStats, gpu: &[(&'static str, f64)]) -> PipelineTimes {
        let named = |(step, seconds): (&str, f64)| StepSeconds { step: step.into(), seconds };
        let nanoseconds = leaves.outcome.counts.nanoseconds;
        let cpu =
            STEP_NAMES.into_iter().zip(nanoseconds.map(|ns| ns as f64 / 1e9)).filter(|(_, seconds)| *seconds > 0.0);
        PipelineTimes { cpu: cpu.map(named).collect(), gpu: gpu.iter().copied().map(named).collect() }
    }
}

/// What all parts hold together, and what their phases took.
#[derive(Default)]
pub(crate) struct PartFigures {
    /// The number of parts.
    pub parts: u64,
    /// The sum over all leaves.
    pub leaves: LeafStats,
    /// The sum over all tiles.
    pub tiles: TileStats,
    /// The sum over all coarser tiles of parts.
    pub levels: LevelStats,
    /// How vertices were selected; `None` if all points are.
    pub selection: Option<Figures>,
    /// The points that they were selected from: all, or those on the ground.
    pub wanted: u64,
    /// Points that were not selected from, because another has the same x and y.
    pub duplicates: u64,
    /// Bytes of temporary files.
    pub temporary: u64,
    /// The part that took the longest.
    pub slowest: Option<SlowestPart>,
    /// The largest resident set of the processes that did the phases, in bytes.
    pub peak_memory: Option<u64>,
    /// Seconds of processor time of the tasks that did them.
    pub cpu_s_of_tasks: f64,
}

/// What a report is put together from.
pub(crate) struct ReportParts<'a> {
    /// What was read.
    pub points: PointCounts,
    /// What all parts hold.
    pub figures: PartFigures,
    /// What is beside the tiles.
    pub published: Published,
    /// Knows the GPU.
    pub triangulator: &'a Triangulator,
    /// How much an update has changed.
    pub update: Option<ChangeCounts>,
    /// Seconds from start to end.
    pub wall_s: f64,
    /// The stages.
    pub stages: Vec<StageStats>,
    /// Worker threads.
    pub threads: usize,
    /// Steps that an interrupted run had finished.
    pub resumed: u64,
    /// The start of the job.
    pub clock: JobClock,
    /// What tells the job from others.
    pub identity: JobIdentity,
    /// The list of the other results.
    pub list: PendingFile,
}

/// More notes than this, one for each of thousands of files, would hide other warnings.
const MAX_NOTES: usize = 50;

/// Returns the length of the edges that slivers have at least, in source units.
fn hull_length(plan: &Plan) -> f64 {
    HullRule::of_lengths(plan).length() * plan.lattice.resolution.to_f64().unwrap_or(f64::NAN)
}

impl Report {
    /// Puts the report together.
    pub(crate) fn new(plan: &Plan, mut parts: ReportParts) -> Report {
        let ReportParts { figures, published, triangulator, .. } = parts;
        let (mut warnings, mut notes) = (plan.all_warnings(), Warnings::default());
        notes.extend(std::mem::take(&mut parts.points.notes));
        notes.shorten(MAX_NOTES);
        let rounded = |count: u64, what: &str, step| {
            format!("{} points were rounded in {what} to steps of {step}", grouped(count))
        };
        if parts.points.rounded_xy > 0 {
            warnings.push(rounded(parts.points.rounded_xy, "x or y", plan.lattice.resolution));
        }
        if parts.points.rounded_z > 0 {
            warnings.push(rounded(parts.points.rounded_z, "z", plan.lattice.resolution_z));
        }
        warnings.extend(unclear_returns(&plan.options.input, &parts.points));
        warnings.extend(notes);
        warnings.extend(parts.points.examples.iter().cloned());
        warnings.extend(published.warnings);
        let ground = plan.options.input.finds_ground().then_some(figures.wanted);
        let selection = match (figures.selection, plan.options.output.max_error) {
            (Some(selected), MaxError::Units(bound)) => Some(SelectionReport::new(plan, bound, &selected)),
            _ => None,
        };
        Report {
            generator: concat!("gdt-batch ", env!("CARGO_PKG_VERSION")).into(),
            sites: figures.leaves.sites,
            selection,
            ground,
            extent: figures.leaves.bounds.map(|bounds| Extent::of(plan, bounds)),
            triangles: figures.tiles.triangles,
            cut_triangles: figures.tiles.cut_triangles,
            hull_triangles: figures.tiles.slivers,
            hull_length: (figures.tiles.slivers > 0).then(|| hull_length(plan)),
            tiles: figures.tiles.files,
            levels: published.levels,
            raster: published.raster,
            pmtiles: published.map_tiles,
            exports: published.exports,
            update: parts.update,
            contours: published.contours,
            terrain: published.terrain,
            covered_share: covered_share(plan, figures.tiles.double_area),
            vertex_colors: published.vertex_colors,
            seam_share: figures.tiles.seam_triangles as f64 / figures.tiles.triangles.max(1) as f64,
            duplicates: figures.leaves.duplicates + figures.duplicates,
            files: plan.inputs.len(),
            skipped: plan.skipped.clone(),
            surface: match ground {
                Some(ground) => {
                    let [found, kept] = [ground, parts.points.kept].map(grouped);
                    let share = percent(ground, parts.points.kept);
                    Some(format!("bare earth: {found} of {kept} points are on the ground ({share})"))
                }
                None => SurfaceShares::of_kept(&parts.points).sentence(plan.options.input.mesh_of()),
            },
            points: parts.points,
            breaklines: plan.breaklines.as_ref().map(BreaklineReport::of),
            clip: plan.clip.as_ref().map(|clip| ClipReport::of(clip, &plan.lattice)),
            leaves: LeafStats { bounds: None, ..figures.leaves },
            gpu: triangulator.gpu().map(str::to_owned),
            gpu_figures: triangulator.gpu_figures(),
            steps: PipelineTimes::new(&figures.leaves, &triangulator.gpu_steps()),
            parts: figures.parts,
            slowest_part: figures.slowest,
            lattice: plan.lattice.clone(),
            unit: plan.unit.clone(),
            crs: plan.crs.name.clone(),
            transformations: transformations(plan.inputs.iter().map(|input| &input.source)),
            network: Some(NetworkTraffic::so_far()).filter(|traffic| traffic.requests > 0),
            bytes_written: figures.tiles.bytes + published.levels.bytes + published.bytes + parts.list.bytes,
            bytes_temporary: figures.temporary,
            peak_memory: machine::peak_memory().max(figures.peak_memory),
            memory_limit: plan.options.limits.memory.0,
            threads: parts.threads,
            resumed: parts.resumed,
            wall_s: parts.wall_s,
            cpu_s: parts.clock.cpu_s() + figures.cpu_s_of_tasks,
            stages: parts.stages,
            warnings,
            input: InputOptions { files: Vec::new(), ..plan.options.input.clone() },
            texts: text_reading(plan),
            plausible_points: plan.inputs.iter().filter_map(|input| input.source.plausible_points()).collect(),
            inputs_fingerprint: parts.identity.inputs,
            options_fingerprint: Some(parts.identity.options),
            job_fingerprint: Some(parts.identity.job),
            submission: parts.identity.submission,
            vertex_digest: figures.leaves.vertices,
            file_list: parts.list.checksum,
            checksum: Checksum::default(),
        }
    }

    /// Returns the report with its checksum, and its text.
    ///
    /// # Errors
    /// [`Error::Broken`] if it cannot be written as JSON.
    pub fn sealed(mut self) -> Result<(Report, Vec<u8>)> {
        let seal = seal(&self.text()?).ok_or_else(|| Error::Broken("the report has no checksum".into()))?;
        self.checksum = seal.0;
        let text = self.text()?;
        Ok((self, text))
    }

    fn text(&self) -> Result<Vec<u8>> {
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::Broken(format!("the report: {e}")))?;
        Ok((text + "\n").into_bytes())
    }
}
