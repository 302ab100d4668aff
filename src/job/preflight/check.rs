//! Preflight: what a job would read and need, without writing anything.

use crate::input::Point;
use crate::job::durable::directory::Directory;
use crate::job::levels::hierarchy::{BYTES_PER_LEVEL_SITE, Sizes};
use crate::job::options::JobOptions;
use crate::job::partition::read as partition;
use crate::job::partition::read::Skipped;
use crate::job::plan::lattice_choice::Coarser;
use crate::job::plan::scan::{self, Plan};
use crate::job::progress::machine;
use crate::job::report::{grouped, write_skipped};
use crate::job::{BYTES_PER_LEAF_SITE, MOST_TRIANGLES_IN_ONE_FILE, workers};
use crate::output::Compression;
use crate::output::preview::canvas::{self, Texel};
use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::{fmt, io};

/// Bytes of job directory a site, beside the spill: its place, colour, class and two triangles.
const TEMPORARY_PER_SITE: u64 = 12 + 6 + 1 + 2 * 12;
/// Bytes of results a site: position, normal, colour and two triangles with 16-bit corners.
fn result_per_site(compression: Compression) -> u64 {
    match compression {
        Compression::None => 12 + 12 + 8 + 2 * 6,
        Compression::Quantized => 8 + 4 + 4 + 2 * 6,
        // As it packs dense clouds, and half as much again for others.
        Compression::Meshopt => 15,
    }
}

/// Bytes of job directory a site of a tile's frontier, in all the files that it is in.
const TEMPORARY_PER_RIM: u64 = 500;
/// Bytes of a GLB beside its arrays.
const RESULT_PER_TILE: u64 = 6000;
/// Pixels of the preview at the most.
const PIXELS: u64 = canvas::LONGER_SIDE * canvas::LONGER_SIDE;

/// What a job would do.
#[derive(Clone, Debug, Serialize)]
pub struct Preflight {
    /// Every input: path, format, records.
    pub files: Vec<(PathBuf, String, u64)>,
    /// Records in all inputs.
    pub records: u64,
    /// Tiles, about.
    pub tiles: u64,
    /// Steps of the lattice in x and y, and z.
    pub resolution: [String; 2],
    /// Width and height in source units.
    pub size: [f64; 2],
    /// Unit of x and y.
    pub unit: String,
    /// Name of the CRS.
    pub crs: Option<String>,
    /// Worker threads.
    pub threads: usize,
    /// Bytes of memory that the job will need at the most, about.
    pub memory: u64,
    /// The memory it was given.
    pub memory_limit: u64,
    /// Bytes of memory free on this machine; `None` where the system does not tell.
    pub memory_free: Option<u64>,
    /// Bytes of temporary files, about.
    pub temporary: u64,
    /// Bytes of results, about.
    pub results: u64,
    /// Bytes that there must be room for. Where there is room for both, results come while all temporary files are there; else some
    /// of these are gone before.
    pub disk: u64,
    /// Bytes free on the disk of the output directory, with those that an earlier job takes there; `None` where the system does
    /// not tell.
    pub disk_free: Option<u64>,
    /// The output directory.
    pub output: PathBuf,
    /// Who will triangulate.
    pub backend: String,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// The inputs that would be left out because they are bad; more may prove bad when they are read.
    pub skipped: Vec<Skipped>,
}

/// Looks at the inputs of `config`.
///
/// # Errors
/// Whatever would stop the job before its first point; see [`scan::run`].
pub fn run(config: &JobOptions) -> Result<Preflight> {
    let directory = Directory::new(&config.output.directory);
    directory.nothing_is_in_the_way()?;
    directory.is_not_somebody_elses()?;
    let plan = scan::run(config, Coarser::default())?;
    let threads = workers(config, plan.records)?;
    Ok(preflight(&plan, config, threads))
}

/// What the job of `plan` would do.
pub(crate) fn preflight(plan: &Plan, config: &JobOptions, threads: usize) -> Preflight {
    let per_tile = config.triangulation.max_points_per_tile.0;
    let points = points(plan);
    let steps = |axis: usize| plan.extent[1][axis] as f64 - plan.extent[0][axis] as f64;
    let resolution = plan.frame.extras().resolution;
    let leaves = per_tile.min(points) * BYTES_PER_LEAF_SITE * threads as u64;
    let output = &config.output.directory;
    let OnDisk { spill, steps: left_by_steps, results } = OnDisk::of(plan, config);
    Preflight {
        files: plan.sources.iter().map(|(s, _)| (s.path.clone(), format!("{:?}", s.format), s.records)).collect(),
        records: plan.records,
        tiles: tiles(points, config),
        resolution: [plan.lattice.resolution.to_string(), plan.lattice.resolution_z.to_string()],
        size: [steps(0) * resolution, steps(1) * resolution],
        unit: plan.unit.into(),
        crs: plan.crs.name.clone(),
        threads,
        memory: (64 << 20)
            + leaves.max(level_bytes(config, points, threads)).max(partition::buffer_bytes(
                points,
                per_tile,
                config.limits.memory.0 / 6,
            )),
        memory_limit: config.limits.memory.0,
        memory_free: machine::free_memory(),
        temporary: spill + left_by_steps,
        results,
        // The spill may go before the results come.
        disk: left_by_steps + spill.max(results),
        disk_free: machine::free_disk(output).map(|free| free + taken(output)),
        output: output.clone(),
        backend: format!("{:?}", config.triangulation.backend).to_lowercase(),
        warnings: plan.warnings.clone(),
        skipped: plan.skipped.clone(),
    }
}

/// Records but for those that are known to be missing.
fn points(plan: &Plan) -> u64 {
    plan.records - plan.sources.iter().map(|(source, _)| source.missing).sum::<u64>()
}

/// Tiles come out between half full and full.
fn tiles(points: u64, config: &JobOptions) -> u64 {
    (points * 4).div_ceil(config.triangulation.max_points_per_tile.0 * 3)
}

/// Bytes of a job's files, about.
struct OnDisk {
    spill: u64,
    /// What steps leave for later steps.
    steps: u64,
    results: u64,
}

impl OnDisk {
    fn of(plan: &Plan, config: &JobOptions) -> OnDisk {
        let points = points(plan);
        let tiles = tiles(points, config);
        OnDisk {
            spill: points * size_of::<Point>() as u64,
            steps: step_bytes(points, config.triangulation.max_points_per_tile.0, tiles),
            results: result_bytes(points, tiles, config.output.packing()),
        }
    }
}

/// Whether the disk has ample room for all other files beside the points, which are there already.
pub(crate) fn has_room_beside_points(plan: &Plan, config: &JobOptions) -> bool {
    let OnDisk { steps, results, .. } = OnDisk::of(plan, config);
    machine::free_disk(&config.output.directory).is_some_and(|free| (steps + results) / 4 * 5 <= free)
}

/// Bytes that steps leave for later steps.
fn step_bytes(points: u64, per_tile: u64, tiles: u64) -> u64 {
    // A tile of n sites has about 2.2 sqrt(n) on its frontier.
    let rims = (2.2 * (per_tile.min(points) as f64).sqrt()) as u64 * tiles;
    points * TEMPORARY_PER_SITE + rims * TEMPORARY_PER_RIM + PIXELS * size_of::<Texel>() as u64
}

/// Bytes of memory that making coarser tiles takes.
fn level_bytes(config: &JobOptions, points: u64, threads: usize) -> u64 {
    let sizes = Sizes::new(config.output.max_points_per_level_tile.0, config.limits.memory.0);
    let one = (4 * sizes.sites).min(points) * BYTES_PER_LEVEL_SITE;
    if config.output.levels { (one * threads as u64).min(sizes.memory) } else { 0 }
}

fn result_bytes(points: u64, tiles: u64, compression: Compression) -> u64 {
    let in_tiles = points * result_per_site(compression) + tiles * RESULT_PER_TILE;
    // One file is never packed with meshopt.
    let unpacked = if compression == Compression::None { Compression::None } else { Compression::Quantized };
    let in_one = if 2 * points <= MOST_TRIANGLES_IN_ONE_FILE { points * result_per_site(unpacked) } else { 0 };
    // Levels add about a third.
    in_tiles + in_one + in_tiles / 2 + 4 * PIXELS
}

/// Bytes of what an earlier job has left in `output` and the next one replaces.
fn taken(output: &Path) -> u64 {
    let folders = ["", "tiles", "levels", "cut", "job"].map(|name| output.join(name));
    let entries = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok());
    let files = entries.flatten().flatten().filter_map(|entry| entry.metadata().ok()).filter(|meta| meta.is_file());
    files.map(|meta| meta.len()).sum()
}

impl Preflight {
    /// Whether the machine has what the job needs.
    ///
    /// # Errors
    /// [`Error::Io`] if nothing can be written to the output directory or its disk is too small, [`Error::Memory`] if too little
    /// memory is free.
    pub fn passes(&self) -> Result<()> {
        machine::check_writable(&self.output)?;
        if let Some(free) = self.disk_free.filter(|free| *free < self.disk) {
            let what = format!(
                "the job takes about {} there, and {} are free or its own already (--force goes on all the same)",
                mebibytes(self.disk),
                mebibytes(free)
            );
            return Err(Error::io("write to", &self.output)(io::Error::new(io::ErrorKind::StorageFull, what)));
        }
        match self.memory_free.filter(|free| *free < self.memory) {
            Some(free) => Err(Error::Memory(format!(
                "the job takes about {}, and this machine has {} free; end other programs, or lower [limits] threads or \
                 [triangulation] max_points_per_tile (--force goes on all the same)",
                mebibytes(self.memory),
                mebibytes(free)
            ))),
            None => Ok(()),
        }
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", grouped(bytes >> 20))
}

impl fmt::Display for Preflight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (path, format, records) in &self.files {
            writeln!(f, "{:<8} {:>14} points  {}", format, grouped(*records), path.display())?;
        }
        let mut row = |name: &str, value: String| writeln!(f, "{name:<18} {value}");
        row("points", grouped(self.records))?;
        row("tiles", format!("about {}", grouped(self.tiles)))?;
        row("area", format!("{:.1} x {:.1} {}", self.size[0], self.size[1], self.unit))?;
        row("lattice step", format!("{} (z {})", self.resolution[0], self.resolution[1]))?;
        row("crs", self.crs.clone().unwrap_or_else(|| "none".into()))?;
        row("backend", format!("{} on {} threads", self.backend, self.threads))?;
        let free = |bytes: Option<u64>| bytes.map_or("unknown".into(), mebibytes);
        let (memory, limit) = (mebibytes(self.memory), mebibytes(self.memory_limit));
        row("memory", format!("about {memory} of {limit}, {} free", free(self.memory_free)))?;
        row("temporary files", format!("about {}", mebibytes(self.temporary)))?;
        row("results", format!("about {}", mebibytes(self.results)))?;
        row("disk", format!("about {} at least, {} free", mebibytes(self.disk), free(self.disk_free)))?;
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        write_skipped(f, self.files.len(), &self.skipped)
    }
}
