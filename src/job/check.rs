//! Preflight: what a job would read and need, without writing anything.

use super::choose::Coarser;
use super::partition::Skipped;
use super::report::{grouped, write_skipped};
use super::scan::{self, Plan};
use super::{BYTES_PER_LEAF_SITE, MOST_TRIANGLES_IN_ONE_FILE, partition, workers};
use crate::Result;
use crate::config::Config;
use crate::input::Point;
use crate::output::preview::Texel;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Bytes of job directory a site, beside the spill: its place, colour, class and two triangles.
const TEMPORARY_PER_SITE: u64 = 12 + 6 + 1 + 2 * 12;
/// Bytes of results a site, at the most: position, normal, colour and two triangles with 16-bit corners.
const RESULT_PER_SITE: u64 = 12 + 12 + 8 + 2 * 6;

/// Bytes of job directory a site of a tile's frontier, in all the files that it is in.
const TEMPORARY_PER_RIM: u64 = 500;
/// Bytes of a GLB beside its arrays.
const RESULT_PER_TILE: u64 = 6000;
/// Pixels of the preview at the most.
const PIXELS: u64 = 1600 * 1600;

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
    /// Bytes of temporary files, at the most.
    pub temporary: u64,
    /// Bytes of results, at the most.
    pub results: u64,
    /// Bytes free on the disk of the output directory; `None` where the system does not tell.
    pub disk_free: Option<u64>,
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
pub fn run(config: &Config) -> Result<Preflight> {
    let plan = scan::run(config, Coarser::default())?;
    let threads = workers(config, plan.records)?;
    Ok(preflight(&plan, config, threads))
}

fn preflight(plan: &Plan, config: &Config, threads: usize) -> Preflight {
    let per_tile = config.triangulation.sites_per_tile.0;
    let points = plan.records;
    let steps = |axis: usize| plan.extent[1][axis] as f64 - plan.extent[0][axis] as f64;
    let resolution = plan.frame.extras().resolution;
    // Tiles come out between half full and full.
    let tiles = (points * 4).div_ceil(per_tile * 3);
    let leaves = per_tile.min(points) * BYTES_PER_LEAF_SITE * threads as u64;
    Preflight {
        files: plan.sources.iter().map(|(s, _)| (s.path.clone(), format!("{:?}", s.format), s.records)).collect(),
        records: points,
        tiles,
        resolution: [plan.lattice.resolution.to_string(), plan.lattice.resolution_z.to_string()],
        size: [steps(0) * resolution, steps(1) * resolution],
        unit: plan.unit.into(),
        crs: plan.crs.name.clone(),
        threads,
        memory: (64 << 20) + leaves.max(partition::buffer_bytes(points, per_tile, config.limits.memory.0 / 6)),
        memory_limit: config.limits.memory.0,
        temporary: temporary_bytes(points, per_tile, tiles),
        results: result_bytes(points, tiles),
        disk_free: disk_free(&config.output.directory),
        backend: format!("{:?}", config.triangulation.backend).to_lowercase(),
        warnings: plan.warnings.clone(),
        skipped: plan.skipped.clone(),
    }
}

fn temporary_bytes(points: u64, per_tile: u64, tiles: u64) -> u64 {
    // A tile of n sites has about 2.2 sqrt(n) on its frontier.
    let rims = (2.2 * (per_tile.min(points) as f64).sqrt()) as u64 * tiles;
    points * (size_of::<Point>() as u64 + TEMPORARY_PER_SITE)
        + rims * TEMPORARY_PER_RIM
        + PIXELS * size_of::<Texel>() as u64
}

fn result_bytes(points: u64, tiles: u64) -> u64 {
    let in_tiles = points * RESULT_PER_SITE + tiles * RESULT_PER_TILE;
    let copies = if 2 * points <= MOST_TRIANGLES_IN_ONE_FILE { 2 } else { 1 };
    copies * in_tiles + 4 * PIXELS
}

/// The free bytes where `directory` is, or will be.
fn disk_free(directory: &Path) -> Option<u64> {
    let existing = directory.ancestors().find(|d| d.is_dir()).unwrap_or(Path::new("."));
    fs4::available_space(existing).ok()
}

impl fmt::Display for Preflight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (path, format, records) in &self.files {
            writeln!(f, "{:<8} {:>14} points  {}", format, grouped(*records), path.display())?;
        }
        let mebibytes = |bytes: u64| format!("{} MiB", grouped(bytes >> 20));
        let mut row = |name: &str, value: String| writeln!(f, "{name:<18} {value}");
        row("points", grouped(self.records))?;
        row("tiles", format!("about {}", grouped(self.tiles)))?;
        row("area", format!("{:.1} x {:.1} {}", self.size[0], self.size[1], self.unit))?;
        row("lattice step", format!("{} (z {})", self.resolution[0], self.resolution[1]))?;
        row("crs", self.crs.clone().unwrap_or_else(|| "none".into()))?;
        row("backend", format!("{} on {} threads", self.backend, self.threads))?;
        row("memory", format!("about {} of {}", mebibytes(self.memory), mebibytes(self.memory_limit)))?;
        row("temporary files", format!("at most {}", mebibytes(self.temporary)))?;
        row("results", format!("at most {}", mebibytes(self.results)))?;
        let free = self.disk_free.map_or("unknown".into(), mebibytes);
        row("free disk", free)?;
        if self.disk_free.is_some_and(|free| free < self.temporary + self.results) {
            writeln!(
                f,
                "warning: the disk may not hold the temporary files and the results: make room or choose another disk"
            )?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        write_skipped(f, self.files.len(), &self.skipped)
    }
}
