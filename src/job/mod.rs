//! A job, from the configuration to the report: scan, partition, triangulate the leaves and merge the inner nodes, stitch,
//! export, report. Every step leaves its result in the job directory and finds there what it needs, so that each can be
//! called on its own, the ones by tile or by node in any order that puts children before parents.

pub mod check;
pub mod closing;
pub mod columns;
pub mod directory;
pub mod export;
pub mod grid;
pub mod leaf;
pub mod merge;
pub mod partition;
pub mod progress;
pub mod records;
pub mod report;
pub mod scan;
pub mod sites;
pub mod spill;
pub mod stitch;
pub mod tree;

use crate::config::{ColorChoice, Config};
use crate::output::color::Coloring;
use crate::output::georeference::Georeference;
use crate::output::picture::Picture;
use crate::output::preview::{Canvas, Texel};
use crate::output::terrain::write_terrain;
use crate::triangulation::Triangulator;
use crate::{Error, Result};
use columns::ColumnReader;
use directory::Directory;
use export::{Look, TileFigures};
use leaf::LeafFigures;
use partition::{Partition, Summary, Task};
use progress::{Progress, Stage};
use rayon::prelude::*;
use report::{Parts, Report};
use scan::Plan;
use spill::Spill;
use std::io::Write;
use std::time::Instant;
use tree::Kind;

/// Bytes that one site of a leaf takes while the leaf is triangulated: points, sort keys, sites, mesh and marks.
const BYTES_PER_LEAF_SITE: u64 = 500;
/// A mesh of more triangles than this is not written as one file: viewers would not open it.
const MOST_TRIANGLES_IN_ONE_FILE: u64 = 20_000_000;

/// Runs the whole job of `config`.
///
/// # Errors
/// Whatever stops a step; see [`Error`].
pub fn run(config: &Config, progress: Progress) -> Result<Report> {
    let start = Instant::now();
    let threads = workers(config)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Memory(format!("cannot start {threads} threads: {e}")))?;
    pool.install(|| run_steps(config, progress, threads, start))
}

/// As many threads as are wanted, and as have room for a leaf each.
fn workers(config: &Config) -> Result<usize> {
    let per_leaf = config.triangulation.sites_per_tile.0.saturating_mul(BYTES_PER_LEAF_SITE);
    // The rest is for code, stacks, decoders and what the allocator keeps.
    let room = config.limits.memory.0 / 4 * 3;
    match room / per_leaf {
        0 => Err(Error::Config(format!(
            "[triangulation] sites_per_tile = {} takes about {} MiB a thread, more than [limits] memory = \"{}\" has room for: \
             lower the one or raise the other",
            config.triangulation.sites_per_tile.0,
            per_leaf >> 20,
            config.limits.memory
        ))),
        leaves => Ok(config.threads().min(leaves as usize)),
    }
}

fn run_steps(config: &Config, progress: Progress, threads: usize, start: Instant) -> Result<Report> {
    let memory = config.limits.memory.0;
    let directory = Directory::new(&config.output.directory);
    // First of all, so that a job that must have a GPU fails at once where there is none.
    let triangulator = Triangulator::new(&config.triangulation, memory, threads)?;

    let stage = progress.stage("scan", config.input.files.len() as u64, "patterns");
    let plan = scan::run(config)?;
    stage.advance(config.input.files.len() as u64);
    let mut stages = vec![stage.finish()];
    directory.create()?;

    let stage = progress.stage("read", plan.records, "points");
    let partition = partition::run(&task(&plan, config), &directory, &stage)?;
    stages.push(stage.finish());
    let bounds = enough_points(&partition.summary)?;

    let stage = progress.stage("triangulate", partition.summary.tally.kept, "points");
    let leaves = triangulate(config, &triangulator, &directory, &partition, &stage)?;
    // From here on the leaves' own files are enough.
    directory::remove_file(&directory.spill())?;
    stages.push(stage.finish());
    let temporary = partition.spilled + leaves.bytes;

    let look = look(config, &plan, &partition.summary, bounds);
    let tiles = partition.tree.leaves.len();
    let stage = progress.stage("stitch", tiles as u64, "tiles");
    (0..tiles).into_par_iter().try_for_each(|tile| {
        stitch::run(&directory, &partition.tree, tile, &look.frame)?;
        stage.advance(1);
        Ok::<(), Error>(())
    })?;
    stages.push(stage.finish());

    let stage = progress.stage("write", leaves.sites, "sites");
    let canvas = Canvas::new(&look.frame, bounds);
    let written = export_all(&directory, &partition, &look, &canvas, &stage)?;
    enough_triangles(written.triangles)?;
    stages.push(stage.finish());

    let stage = progress.stage("finish", 1, "scene");
    let other_bytes = finish(&directory, &plan, &written, &canvas, tiles, bounds)?;
    directory.clean_up()?;
    stage.advance(1);
    stages.push(stage.finish());

    let points = partition.summary.tally;
    let wall_s = start.elapsed().as_secs_f64();
    let gpu = triangulator.gpu().map(str::to_owned);
    let parts = Parts { points, leaves, gpu, tiles: written, other_bytes, temporary, stages, threads, memory, wall_s };
    let report = Report::new(&plan, parts);
    directory::write_json(&directory.report(), &report)?;
    Ok(report)
}

fn task<'a>(plan: &'a Plan, config: &Config) -> Task<'a> {
    Task {
        sources: &plan.sources,
        extent: plan.extent,
        points_per_tile: config.triangulation.sites_per_tile.0,
        memory: config.limits.memory.0 / 6,
        malformed_share: config.input.malformed_share.0,
    }
}

/// The box around the points, if there are any.
fn enough_points(summary: &Summary) -> Result<[[i32; 3]; 2]> {
    summary.bounds.ok_or_else(|| {
        let tally = &summary.tally;
        Error::NoTerrain(format!(
            "no point is left to triangulate: of {} read, {} are withheld, {} of other classes, {} out of bounds; check [input] classes and bounds",
            tally.read, tally.withheld, tally.other_class, tally.out_of_bounds
        ))
    })
}

fn enough_triangles(triangles: u64) -> Result<()> {
    if triangles > 0 {
        return Ok(());
    }
    Err(Error::NoTerrain(
        "the points make no triangle: it takes at least three different places in x and y that are not on one line"
            .into(),
    ))
}

/// Triangulates all leaves and merges every inner node as soon as its children are done.
fn triangulate(
    config: &Config,
    triangulator: &Triangulator,
    directory: &Directory,
    partition: &Partition,
    stage: &Stage,
) -> Result<LeafFigures> {
    let spill = Spill::open(&directory.spill())?;
    let grower = Grower { config, triangulator, directory, partition, spill: &spill, stage };
    grower.grow(0)
}

struct Grower<'a> {
    config: &'a Config,
    triangulator: &'a Triangulator,
    directory: &'a Directory,
    partition: &'a Partition,
    spill: &'a Spill,
    stage: &'a Stage,
}

impl Grower<'_> {
    fn grow(&self, node: usize) -> Result<LeafFigures> {
        match self.partition.tree.nodes[node].kind {
            Kind::Leaf(tile) => {
                let task = leaf::Task { duplicates: self.config.input.duplicates, triangulator: self.triangulator };
                let figures = leaf::run(self.directory, self.partition, self.spill, tile, task)?;
                self.stage.advance(figures.sites + figures.duplicates);
                Ok(figures)
            }
            Kind::Inner([low, high]) => {
                let (low, high) = rayon::join(|| self.grow(low), || self.grow(high));
                let (mut figures, high) = (low?, high?);
                figures += high;
                merge::run(self.directory, &self.partition.tree, node, self.config.limits.memory.0 / 2)?;
                Ok(figures)
            }
        }
    }
}

/// How the tiles are to look.
fn look(config: &Config, plan: &Plan, summary: &Summary, bounds: [[i32; 3]; 2]) -> Look {
    let elevation = Coloring::Elevation { low: bounds[0][2], high: bounds[1][2] };
    let coloring = match config.output.color {
        ColorChoice::None => None,
        ColorChoice::Class => Some(Coloring::Class),
        ColorChoice::Elevation => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb if summary.tally.max_rgb == 0 => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb => Some(Coloring::Rgb { eight_bit: summary.tally.max_rgb <= 255 }),
    };
    Look { frame: plan.frame.clone(), coloring, normals: config.output.normals }
}

fn export_all(
    directory: &Directory,
    partition: &Partition,
    look: &Look,
    canvas: &Canvas,
    stage: &Stage,
) -> Result<TileFigures> {
    (0..partition.tree.leaves.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|tile| {
            let figures = export::run(directory, &partition.tree, tile, look, canvas)?;
            stage.advance(partition.blocks[tile].iter().map(|block| block.points as u64).sum());
            Ok(figures)
        })
        .try_reduce(TileFigures::default, |mut a, b| {
            a += b;
            Ok(a)
        })
}

/// Writes what stands beside the tiles; returns its bytes.
fn finish(
    directory: &Directory,
    plan: &Plan,
    written: &TileFigures,
    canvas: &Canvas,
    tiles: usize,
    bounds: [[i32; 3]; 2],
) -> Result<u64> {
    let georeference = Georeference::new(&plan.frame, &plan.lattice, bounds, plan.unit, plan.crs.epsg);
    let text = georeference.to_json();
    directory::write_whole(&directory.georeference(), |file| file.write_all(text.as_bytes()))?;
    let picture = draw_picture(directory, canvas, tiles)?;
    directory::write_whole(&directory.preview(), |file| file.write_all(&picture))?;
    let mut bytes = (text.len() + picture.len()) as u64;
    if written.triangles <= MOST_TRIANGLES_IN_ONE_FILE {
        let paths: Vec<_> = (0..tiles).map(|tile| directory.tile(tile)).filter(|path| path.exists()).collect();
        write_terrain(&directory.terrain(), &paths)?;
        bytes += std::fs::metadata(directory.terrain()).map_err(Error::io("read", directory.terrain()))?.len();
    }
    Ok(bytes)
}

fn draw_picture(directory: &Directory, canvas: &Canvas, tiles: usize) -> Result<Vec<u8>> {
    let mut picture = Picture::new(canvas);
    for tile in 0..tiles {
        picture.add(tile as u32, &ColumnReader::open(&directory.preview_fragment(tile))?.column::<Texel>()?);
    }
    Ok(picture.png())
}
