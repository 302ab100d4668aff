//! The result of the preflight, for people and for machines.

use crate::durable::directory::JobDirectory;
use crate::durable::obstacles::{check_nothing_in_the_way, check_results_are_ours};
use crate::machine;
use crate::options::JobOptions;
use crate::plan::budget::workers;
use crate::plan::job_plan::{Plan, SkippedInput};
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::plan::make_plan::make_plan;
use crate::plan::no_points::nothing_will_be_left;
use crate::preflight::contour_estimate::{ContourEstimate, ContourSample};
use crate::preflight::estimate;
use crate::preflight::estimate::DiskEstimate;
use crate::preflight::input_places::check_inputs_are_no_results;
use crate::preflight::kept_points::{KeptPoints, has_filter};
use crate::preflight::selection_estimate::estimated_vertices;
use crate::progress::number_text::{grouped, mebibytes, rough};
use crate::publish::contours::check::check_contours;
use crate::publish::height_offset_check::{check_height_offset, unused_height_offset};
use crate::publish::map_tiles::check::check_map_tiles;
use crate::publish::one_file_limits::MAX_TRIANGLES_IN_ONE_FILE;
use crate::publish::raster::check::{check_raster, planned_raster};
use crate::publish::terrain_tiles::check::check_terrain;
use crate::report::skipped_inputs::write_skipped;
use crate::tiles::vertex_colors::check_photo;
use points::Source;
use points::surface::SurfaceShares;
use points::surface_warnings::{no_ground, unclear_returns};
use points::transformation::{Transformation, transformations};
use serde::Serialize;
use std::path::PathBuf;
use std::{fmt, io};
use sys::terminal::one_line;
use sys::{Error, Result, ShownWarning, Warnings, address_space};
use tiles::options::{ExportFormat, MaxError};

/// A file with the exact mesh for other programs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ExportEstimate {
    /// Its name.
    pub file: String,
    /// About how many bytes it takes.
    pub bytes: u64,
}

/// What a job would do.
#[derive(Clone, Debug, Serialize)]
pub struct Preflight {
    /// Every input: path, format, records.
    pub files: Vec<(String, String, u64)>,
    /// Records in all inputs.
    pub records: u64,
    /// How many points the job keeps at most, as far as headers and a sample of the points tell.
    pub kept: u64,
    /// About how many of these points `max_error` selects as vertices; `None` without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<u64>,
    /// About how many tiles.
    pub tiles: u64,
    /// About how many columns and rows of the raster, if there is to be one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raster: Option<[u32; 2]>,
    /// The files with the exact mesh for other programs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub exports: Vec<ExportEstimate>,
    /// About how large the contour lines are, if there are to be some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contours: Option<ContourEstimate>,
    /// About how many bytes the terrain tiles for globes take, if there are to be some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terrain: Option<u64>,
    /// Edges along breaklines; `None` without any.
    pub breaklines: Option<u64>,
    /// Steps of the lattice in x and y, and in z.
    pub resolution: [String; 2],
    /// Width and height in source units.
    pub size: [f64; 2],
    /// Unit of x and y.
    pub unit: String,
    /// Name of the CRS.
    pub crs: Option<String>,
    /// What the job would transform, from what into what.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transformations: Vec<Transformation>,
    /// Worker threads.
    pub threads: usize,
    /// About how many bytes of memory the job needs.
    pub memory: u64,
    /// The memory limit of the job in bytes.
    pub memory_limit: u64,
    /// Bytes of memory free on this machine; `None` if the system does not tell.
    pub memory_free: Option<u64>,
    /// About how many bytes the temporary files take at most at one time.
    pub temporary: u64,
    /// About how many bytes the results take.
    pub results: u64,
    /// The least number of bytes that the disk must have.
    pub disk: u64,
    /// Bytes free on the disk of the output directory, including what an interrupted run takes there; `None` if the system does not
    /// tell.
    pub disk_free: Option<u64>,
    /// Bytes that the results of an earlier job take in the output directory. They are kept until the new ones are complete.
    pub disk_earlier: u64,
    /// The output directory.
    #[serde(serialize_with = "sys::path_text::shown")]
    pub output: PathBuf,
    /// The backend that triangulates.
    pub backend: String,
    /// What the mesh will be, by the classes of a sample of the points.
    pub surface: Option<String>,
    /// The points of this sample that the job keeps.
    pub surface_sample: SurfaceShares,
    /// What the user should know.
    pub warnings: Warnings,
    /// Why no point is left, if that is sure.
    #[serde(skip)]
    pub nothing_is_left: Option<String>,
    /// A sentence about a few points that stretch the area, if there are some.
    #[serde(skip)]
    pub stretch: Option<String>,
    /// The longest triangle in metres that the lattice allows, if the area is longer: with a longer one, the job takes a coarser lattice.
    #[serde(skip)]
    pub longest_triangle: Option<f64>,
    /// The inputs that would be left out because they are bad. More may prove bad when they are read.
    pub skipped: Vec<SkippedInput>,
}

/// Looks at the inputs of a job and says what it would do.
///
/// # Errors
/// Every error that would stop the job before its first point; see [`make_plan`].
pub fn check(options: &JobOptions) -> crate::Result<Preflight> {
    inspect(options).map(|(preflight, _)| preflight)
}

/// As [`check`]. Also returns the plan of the job.
///
/// # Errors
/// As [`check`].
pub fn inspect(options: &JobOptions) -> crate::Result<(Preflight, Plan)> {
    let directory = JobDirectory::new(&options.output.directory);
    check_nothing_in_the_way(&directory)?;
    check_results_are_ours(&directory, options.output.page)?;
    let plan = make_plan(options, LatticeCoarsening::default())?;
    check_plan(&plan)?;
    let threads = workers(options, plan.records)?;
    let contours = ContourSample::of(&plan)?;
    let mut preflight = if has_filter(&plan) {
        inspect_closely(&plan, threads, contours.as_ref())?
    } else {
        Preflight::of(&plan, threads, KeptPoints::by_headers(&plan), contours.as_ref())
    };
    if let Some(why) = nothing_will_be_left(&plan)? {
        (preflight.kept, preflight.nothing_is_left) = (0, Some(why.to_string()));
    }
    if let MaxError::Units(units) = plan.options.output.max_error {
        let vertices = estimated_vertices(&plan, preflight.kept, &[units])?.first().copied();
        preflight.vertices = vertices;
        preflight.tiles = vertices.map_or(preflight.tiles, |vertices| estimate::tiles(&plan, KeptPoints(vertices)));
        preflight.exports = exports(options, vertices.unwrap_or(preflight.kept));
        preflight.terrain = estimate::terrain(vertices.unwrap_or(preflight.kept), &options.output);
    }
    Ok((preflight, plan))
}

/// Checks that no input would be overwritten, and that the results that the user wants can be made, as far as the plan tells.
///
/// # Errors
/// [`Error::Config`] names the option that is wrong; [`Error::Io`] or [`Error::Input`] on a file that it names.
pub(crate) fn check_plan(plan: &Plan) -> crate::Result<()> {
    check_inputs_are_no_results(plan)?;
    check_height_offset(plan)?;
    check_photo(plan)?;
    check_raster(plan)?;
    check_map_tiles(plan)?;
    check_contours(plan)?;
    Ok(check_terrain(plan).map(|_| ())?)
}

/// Checks that the machine has what the job of `plan` needs. Reads a sample of the points, on the threads of the current rayon pool,
/// only if the headers leave it in doubt. `contours` are a sample of contour lines, if the job writes some.
///
/// # Errors
/// As [`Preflight::passes`].
pub(crate) fn require_memory_and_disk(
    plan: &Plan,
    threads: usize,
    contours: Option<&ContourSample>,
) -> crate::Result<()> {
    let mut preflight = Preflight::of(plan, threads, KeptPoints::by_headers(plan), contours);
    let memory_is_short = preflight.memory_free.is_some_and(|free| free < preflight.memory);
    if has_filter(plan) && (preflight.disk_is_short() || memory_is_short) {
        preflight = inspect_closely(plan, threads, contours)?;
    }
    preflight.passes()
}

/// Looks at as many points as it takes to know whether the disk suffices.
fn inspect_closely(plan: &Plan, threads: usize, contours: Option<&ContourSample>) -> Result<Preflight> {
    let is_short = |kept| Preflight::of(plan, threads, kept, contours).disk_is_short();
    let kept = KeptPoints::by_sample(plan, |least, most| is_short(least) || !is_short(most))?;
    Ok(Preflight::of(plan, threads, kept, contours))
}

/// Returns the files with the exact mesh of so many points.
fn exports(options: &JobOptions, points: u64) -> Vec<ExportEstimate> {
    let file = |(format, bytes): (ExportFormat, u64)| ExportEstimate { file: format.file_name().into(), bytes };
    estimate::exports(points, &options.output).map(file).collect()
}

impl Preflight {
    /// Returns what the job of `plan` would do on `threads` threads if it keeps `kept` points.
    fn of(plan: &Plan, threads: usize, kept: KeptPoints, contours: Option<&ContourSample>) -> Preflight {
        let options = &plan.options;
        let resolution = plan.frame.extras().resolution;
        let surface_sample = SurfaceShares::of_kept(&plan.sample);
        let mut warnings = plan.all_warnings();
        warnings.extend(unused_height_offset(plan));
        // That it can be read was checked before.
        warnings.extend(check_photo(plan).unwrap_or_default());
        let of_sample = |warning: String| format!("in a sample of the points: {warning}");
        warnings.extend(no_ground(&options.input, &plan.sample).map(of_sample));
        warnings.extend(plan.sample.notes.iter().cloned().map(of_sample));
        warnings.extend(unclear_returns(&options.input, &plan.sample).map(of_sample));
        let contours = contours.map(|sample| sample.estimate(kept));
        warnings.extend(contours.as_ref().and_then(|contours| contours.warning(plan)));
        warnings.extend(plan.ground_cells.and_then(|cells| cells.warning(options)));
        warnings.extend(plan.terrain_crowd.and_then(|crowd| crowd.warning(options)));
        let disk = DiskEstimate::of(plan, kept, MAX_TRIANGLES_IN_ONE_FILE, contours.as_ref());
        let describe =
            |source: &Source| (source.path.display().to_string(), format!("{:?}", source.format), source.records);
        Preflight {
            files: plan.inputs.iter().map(|input| describe(&input.source)).collect(),
            records: plan.records,
            kept: kept.0,
            vertices: None,
            tiles: estimate::tiles(plan, kept),
            raster: planned_raster(plan).map(|grid| grid.size()),
            exports: exports(options, kept.0),
            contours,
            terrain: estimate::terrain(kept.0, &options.output),
            breaklines: plan.breaklines.as_ref().map(|lines| lines.findings.subsegments),
            resolution: [plan.lattice.resolution.to_string(), plan.lattice.resolution_z.to_string()],
            size: [0, 1].map(|axis| plan.extent.extent(axis) as f64 * resolution),
            unit: plan.unit.clone(),
            crs: plan.crs.name.clone(),
            transformations: transformations(plan.inputs.iter().map(|input| &input.source)),
            threads,
            memory: estimate::memory(plan, kept, threads),
            memory_limit: options.limits.memory.0,
            memory_free: machine::free_memory(),
            temporary: disk.temporary,
            results: disk.results,
            disk: disk.least,
            disk_free: machine::free_disk(&options.output.directory).map(|free| free + estimate::own_bytes(plan)),
            disk_earlier: estimate::earlier_bytes(plan),
            output: options.output.directory.clone(),
            backend: format!("{:?}", options.triangulation.backend).to_lowercase(),
            surface: surface_sample.estimate(options.input.mesh_of()),
            surface_sample,
            warnings,
            nothing_is_left: None,
            stretch: plan.stretch.clone(),
            longest_triangle: longest_triangle(plan),
            skipped: plan.skipped.clone(),
        }
    }

    fn disk_is_short(&self) -> bool {
        self.disk_free.is_some_and(|free| free < self.disk)
    }

    /// Checks that the machine has what the job needs.
    ///
    /// # Errors
    /// [`crate::Error::NoTerrain`] if no point will be left, [`Error::Io`] if nothing can be written to the output directory or its disk is
    /// too small, [`Error::Memory`] if too little memory is free.
    pub fn passes(&self) -> crate::Result<()> {
        if let Some(why) = &self.nothing_is_left {
            return Err(crate::Error::NoTerrain(why.clone()));
        }
        machine::check_writable(&self.output)?;
        if let Some(free) = self.disk_free.filter(|free| *free < self.disk) {
            let what = format!(
                "the job takes about {} there, and {} are free or its own already{}{} (--force runs it anyway)",
                mebibytes(self.disk),
                mebibytes(free),
                self.earlier_results(),
                self.because_of_stretch()
            );
            return Err(Error::io("write to", &self.output)(io::Error::new(io::ErrorKind::StorageFull, what)).into());
        }
        address_space::require(self.memory, address_space::at_start(), || "the job".into())?;
        match self.memory_free.filter(|free| *free < self.memory) {
            Some(free) => Err(Error::Memory(format!(
                "the job takes about {}, and this machine has {} free; end other programs, or lower [limits] threads or \
                 [triangulation] max_points_per_tile{} (--force runs it anyway)",
                mebibytes(self.memory),
                mebibytes(free),
                self.because_of_stretch()
            ))
            .into()),
            None => Ok(()),
        }
    }

    /// Returns what makes the area large, or nothing.
    fn because_of_stretch(&self) -> String {
        self.stretch.as_ref().map_or(String::new(), |stretch| format!("; {stretch}"))
    }

    /// Returns what a small disk would gain without the results of an earlier job, or nothing.
    fn earlier_results(&self) -> String {
        match self.disk_earlier {
            0 => String::new(),
            bytes => format!(
                "; the results of an earlier job, {}, are kept until the new ones are complete: without them there is more space",
                mebibytes(bytes)
            ),
        }
    }
}

/// Returns the longest triangle in metres that glTF holds in steps of the lattice, if the area is longer.
fn longest_triangle(plan: &Plan) -> Option<f64> {
    let (longest, step) = (plan.frame.longest_triangle()[0], plan.frame.resolution_metres()[0]);
    let is_longer = (0..2).any(|axis| plan.extent.extent(axis) as f64 * step > longest);
    (is_longer && plan.options.input.resolution.step().is_none()).then_some(longest)
}

impl fmt::Display for Preflight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (path, format, records) in &self.files {
            writeln!(f, "{:<8} {:>14} points  {}", format, grouped(*records), one_line(path))?;
        }
        let mut row = |name: &str, value: String| writeln!(f, "{name:<18} {value}");
        row("points", grouped(self.records))?;
        if self.kept < self.records {
            row("points kept", format!("about {}", grouped(self.kept)))?;
        }
        if let Some(surface) = &self.surface {
            row("surface", surface.clone())?;
        }
        if let Some(edges) = self.breaklines {
            row("breaklines", format!("{} edges", grouped(edges)))?;
        }
        if let Some(vertices) = self.vertices {
            let triangles = grouped(2 * vertices);
            row("selected", format!("about {} vertices, {triangles} triangles (max_error)", grouped(vertices)))?;
        }
        row("tiles", format!("about {}", grouped(self.tiles)))?;
        if let Some([columns, rows]) = self.raster {
            row("raster", format!("about {} x {} cells", grouped(columns.into()), grouped(rows.into())))?;
        }
        for ExportEstimate { file, bytes } in &self.exports {
            row("export", format!("{file}, about {}", mebibytes(*bytes)))?;
        }
        if let Some(ContourEstimate { points, bytes, .. }) = &self.contours {
            row("contours", format!("about {} points of lines, {}", grouped(rough(*points)), mebibytes(*bytes)))?;
        }
        if let Some(bytes) = self.terrain {
            row("terrain tiles", format!("about {}", mebibytes(bytes)))?;
        }
        row("area", format!("{:.1} x {:.1} {}", self.size[0], self.size[1], self.unit))?;
        let coarser = self.longest_triangle.map_or(String::new(), |longest| {
            format!(", coarser in x and y if the mesh has a triangle longer than {longest:.0} m")
        });
        row("lattice step", format!("{} (z {}){coarser}", self.resolution[0], self.resolution[1]))?;
        row("crs", self.crs.clone().unwrap_or_else(|| "none".into()))?;
        for transformation in &self.transformations {
            row("transformed", transformation.to_string())?;
        }
        row("backend", format!("{} on {} threads", self.backend, self.threads))?;
        let free = |bytes: Option<u64>| bytes.map_or("unknown".into(), mebibytes);
        let (memory, limit) = (mebibytes(self.memory), mebibytes(self.memory_limit));
        row("memory", format!("about {memory} of {limit}, {} free", free(self.memory_free)))?;
        row("temporary files", format!("about {}", mebibytes(self.temporary)))?;
        row("results", format!("about {}", mebibytes(self.results)))?;
        row("disk", format!("at least about {}, {} free", mebibytes(self.disk), free(self.disk_free)))?;
        if self.disk_earlier > 0 {
            row(
                "earlier results",
                format!("{}, which are kept until the new ones are complete", mebibytes(self.disk_earlier)),
            )?;
        }
        for warning in self.warnings.iter() {
            writeln!(f, "{}", ShownWarning(warning))?;
        }
        write_skipped(f, self.files.len(), &self.skipped)
    }
}
