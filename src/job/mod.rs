//! A job, from the configuration to the report: scan, partition, triangulate the leaves and merge the inner nodes, stitch,
//! export, report. Every step leaves its result in the job directory and finds there what it needs, so that each can be
//! called on its own, the ones by tile or by node in any order that puts children before parents.

mod area;
pub mod check;
pub mod choose;
pub mod closing;
pub mod columns;
pub mod cut;
pub mod directory;
pub mod export;
mod forecast;
pub mod grid;
pub mod leaf;
pub mod levels;
mod machine;
pub mod merge;
pub mod partition;
pub mod placement;
pub mod progress;
pub mod pyramid;
pub mod records;
pub mod report;
pub mod scan;
pub mod sites;
pub mod span;
pub mod spill;
pub mod stitch;
pub mod store;
pub mod tileset;
pub mod tree;

use crate::config::{ColorChoice, Config, Format};
use crate::output::Compression;
use crate::output::color::Coloring;
use crate::output::georeference::Georeference;
use crate::output::picture::Picture;
use crate::output::preview::{Canvas, Texel};
use crate::output::terrain::write_terrain;
use crate::triangulation::Triangulator;
use crate::{Error, Result};
use choose::Coarser;
use columns::ColumnReader;
use cut::Cut;
use directory::Directory;
use export::{Look, TileFigures};
use leaf::LeafFigures;
use levels::LevelFigures;
use partition::{Partition, Summary, Task};
use placement::Placement;
use progress::{Progress, Schedule, Stage, StageFigures};
use pyramid::{Pyramid, Sizes};
use rayon::prelude::*;
use report::{Parts, Report};
use scan::Plan;
use span::Longest;
use spill::Spill;
use std::io::Write;
use std::time::Instant;
use store::{Key, Store};
use tree::{Kind, Tree};

/// Bytes that one site of a leaf takes while the leaf is triangulated: points, sort keys, sites, mesh and marks.
const BYTES_PER_LEAF_SITE: u64 = 500;
/// Bytes that a thread takes at least: a decoder with its chunk, a slice of points and their order.
const BYTES_PER_THREAD: u64 = 8 << 20;
/// Ten times coarser as often as this is no terrain any more.
const MOST_TENS: u32 = 6;
/// A mesh of more triangles than this is not written as one file: viewers would not open it.
const MOST_TRIANGLES_IN_ONE_FILE: u64 = 20_000_000;
/// Nor one of more tiles: each is a node with a mesh of its own, and their description would fill the memory.
const MOST_TILES_IN_ONE_FILE: u64 = 4096;

/// How a job is run, beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Where progress goes.
    pub progress: Progress,
    /// Whether to go on where the disk or the memory does not seem to suffice.
    pub force: bool,
}

impl From<Progress> for Options {
    fn from(progress: Progress) -> Options {
        Options { progress, force: false }
    }
}

/// Runs the whole job of `config`.
///
/// # Errors
/// Whatever stops a step; see [`Error`]. A job that fails leaves no temporary files.
pub fn run(config: &Config, options: impl Into<Options>) -> Result<Report> {
    let (options, start) = (options.into(), Instant::now());
    // First of all, so that a job that must have a GPU fails at once where there is none.
    let triangulator = Triangulator::new(&config.triangulation, config.limits.memory.0, config.threads())?;
    let mut coarser = Coarser::default();
    loop {
        match attempt(config, &triangulator, coarser, options, start) {
            // Only the finished mesh knows its longest triangle, so that a second try is the price of not rounding in vain.
            Err(Error::TooFine { vertical: true, what }) if coarser.vertical < MOST_TENS => {
                options.progress.note(&format!("{what}; starting again with a coarser step in z"));
                coarser.vertical += 1;
            }
            Err(Error::TooFine { vertical: false, what })
                if config.input.resolution.0.is_none() && coarser.horizontal < MOST_TENS =>
            {
                options.progress.note(&format!("{what}; starting again with a coarser step in x and y"));
                coarser.horizontal += 1;
            }
            outcome => return outcome,
        }
    }
}

fn attempt(
    config: &Config,
    triangulator: &Triangulator,
    coarser: Coarser,
    options: Options,
    start: Instant,
) -> Result<Report> {
    let progress = options.progress;
    let stage = progress.stage("scan", 1, "job");
    let plan = on_threads(workers(config, 0)?, || scan::run(config, coarser))?;
    stage.advance(1);
    let scanned = stage.finish();
    let progress = &Schedule::new(progress, forecast::costs(&plan));
    report::note_skipped(&plan.skipped, progress);
    let threads = workers(config, plan.records)?;
    if !options.force {
        check::preflight(&plan, config, threads).passes()?;
    }
    let directory = Directory::new(&config.output.directory);
    let _lock = directory.create()?;
    let job = Job { config, triangulator, coarser, directory: &directory, progress, threads, start };
    let outcome = on_threads(threads, || job.run(plan, scanned));
    if outcome.is_err() {
        // The first error is the one to report.
        let _ = directory.clean_up();
    }
    outcome
}

/// What `work` returns, its rayon tasks on `threads` threads.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Memory(format!("cannot start {threads} threads: {e}")))?;
    pool.install(work)
}

/// As many threads as are wanted, and as have room for a leaf each.
fn workers(config: &Config, points: u64) -> Result<usize> {
    let per_tile = config.triangulation.sites_per_tile.0.min(points).max(1);
    let per_leaf = per_tile.saturating_mul(BYTES_PER_LEAF_SITE).max(BYTES_PER_THREAD);
    // The rest is for code, stacks, decoders and what the allocator keeps.
    let room = config.limits.memory.0 / 4 * 3;
    match room / per_leaf {
        0 => Err(Error::Config(format!(
            "tiles of {per_tile} points take about {} MiB a thread, more than [limits] memory = \"{}\" has room for: lower \
             [triangulation] sites_per_tile or raise memory",
            per_leaf >> 20,
            config.limits.memory
        ))),
        leaves => Ok(config.threads().min(leaves as usize)),
    }
}

/// A job whose inputs have been looked at and whose directory is its own.
struct Job<'a> {
    config: &'a Config,
    triangulator: &'a Triangulator,
    coarser: Coarser,
    directory: &'a Directory,
    progress: &'a Schedule,
    threads: usize,
    start: Instant,
}

impl Job<'_> {
    /// Step 2 and all after it.
    fn run(&self, plan: Plan, scanned: StageFigures) -> Result<Report> {
        let Job { config, triangulator, directory, progress, .. } = *self;

        let (plan, partition, read) = self.read(plan)?;
        let plan = &plan;
        let bounds = enough_points(&partition.summary)?;
        let longest = Longest::of(&plan.frame);
        longest.check_heights(bounds[0][2], bounds[1][2])?;

        let stage = progress.stage("triangulate", partition.summary.tally.kept, "points");
        let store = Store::create(&directory.store())?;
        let leaves = triangulate(config, triangulator, &store, directory, &partition, longest, &stage)?;
        // From here on what is in the store is enough.
        directory::remove_file(&directory.spill())?;
        let triangulated = stage.finish();

        let tiles = partition.tree.leaves.len();
        let cut = Cut::new(config.output.max_edge, &plan.frame, &store, [tiles as u64, leaves.sites], bounds)?;
        let look = look(config, plan, &partition.summary, bounds, cut);
        let stage = progress.stage("stitch", tiles as u64, "tiles");
        stitch_all(&store, &partition.tree, &look, &stage)?;
        let stitched = stage.finish();

        let stage = progress.stage("write", leaves.sites, "sites");
        let canvas = Canvas::new(&look.frame, bounds);
        let written = export_all(directory, &store, &partition, &look, &canvas, &stage)?;
        enough_triangles(&written, plan)?;
        let exported = stage.finish();

        let one_file = fits_one_file(&written);
        let mut warnings = Vec::new();
        let (mut coarser, mut levelled) = (LevelFigures::default(), None);
        let (mut other_bytes, mut placement) = (0, None);
        if config.output.format != Format::Glb || !one_file {
            let (sizes, pyramid) = pyramid(config, &partition);
            let stage = progress.stage("levels", pyramid.inner.len() as u64, "tiles");
            coarser = self.make_levels(&store, &pyramid, sizes, &look, &stage)?;
            let placed = placement::place(plan, &look.frame, bounds, config.output.height_offset);
            warnings.extend(placement::remark(&placed));
            placement = placed.ok();
            let transform = placement.as_ref().map(|placement| placement.transform);
            other_bytes += tileset::write(directory, &store, &pyramid, &look, transform)?;
            levelled = Some(stage.finish());
            warnings.extend(levels_left_out(config, &pyramid));
        }

        let stage = progress.stage("finish", 1, "job");
        other_bytes += finish(directory, &store, plan, placement, &canvas, tiles, bounds)?;
        if one_file && config.output.format != Format::Tiles {
            other_bytes += write_one_file(directory, tiles)?;
        } else if config.output.format == Format::Glb {
            warnings.push(too_large_for_one_file(&written));
        }
        directory.clean_up()?;
        stage.advance(1);
        let stages = [Some(scanned), Some(read), Some(triangulated), Some(stitched), Some(exported), levelled];
        let stages = stages.into_iter().flatten().chain([stage.finish()]).collect();

        let report = Report::new(
            plan,
            Parts {
                points: partition.summary.tally,
                leaves,
                gpu: triangulator.gpu().map(str::to_owned),
                gpu_steps: triangulator.gpu_steps(),
                tiles: written,
                levels: coarser,
                warnings,
                other_bytes,
                temporary: partition.spilled + store.bytes(),
                stages,
                threads: self.threads,
                memory: config.limits.memory.0,
                wall_s: self.start.elapsed().as_secs_f64(),
            },
        );
        directory::write_json(&directory.report(), &report)?;
        Ok(report)
    }

    /// Makes the coarser tiles, those of one height side by side, as many at once as have room.
    fn make_levels(
        &self,
        store: &Store,
        pyramid: &Pyramid,
        sizes: Sizes,
        look: &Look,
        stage: &Stage,
    ) -> Result<LevelFigures> {
        let content = self.config.output.levels;
        let lanes = match pyramid.largest() {
            largest if content && largest > 0 => (sizes.memory / largest).clamp(1, self.threads as u64) as usize,
            _ => self.threads,
        };
        let make = |at: usize| {
            let figures = levels::run(self.directory, store, pyramid, at, look, sizes, content)?;
            stage.advance(1);
            Ok(figures)
        };
        on_threads(lanes, || {
            let mut all = LevelFigures::default();
            for height in pyramid.by_height() {
                let sum = |mut a: LevelFigures, b| {
                    a += b;
                    Ok(a)
                };
                all += height.into_par_iter().with_max_len(1).map(make).try_reduce(LevelFigures::default, sum)?;
            }
            Ok(all)
        })
    }

    /// Step 2. An input that proves bad only now is left out as if it had never been named: if without it the job would have
    /// another lattice, all is read again.
    fn read(&self, mut plan: Plan) -> Result<(Plan, Partition, StageFigures)> {
        let Job { config, directory, progress, coarser, .. } = *self;
        loop {
            let stage = progress.stage("read", plan.records, "points");
            let mut partition = partition::run(&task(&plan, config), directory, &stage)?;
            let figures = stage.finish();
            let lattice = plan.lattice.clone();
            if !partition.skipped.is_empty() {
                report::note_skipped(&partition.skipped, progress);
                plan = scan::without(plan, &partition.skipped, config, coarser)?;
            }
            if plan.lattice == lattice {
                partition.skipped.clone_from(&plan.skipped);
                return Ok((plan, partition, figures));
            }
        }
    }
}

/// Which tiles viewers see.
fn pyramid(config: &Config, partition: &Partition) -> (Sizes, Pyramid) {
    let points = |blocks: &Vec<spill::Block>| blocks.iter().map(|block| block.points as u64).sum();
    let points: Vec<u64> = partition.blocks.iter().map(points).collect();
    let sizes = Sizes::new(config.output.level_sites.0, config.limits.memory.0 / 4 * 3);
    (sizes, Pyramid::new(&partition.tree, &points, sizes))
}

fn levels_left_out(config: &Config, pyramid: &Pyramid) -> Option<String> {
    let without = pyramid.inner.iter().filter(|inner| !inner.content).count();
    (config.output.levels && without > 0).then(|| {
        format!(
            "{without} of {} coarser tiles are left out, because the tiles below them are too large for [limits] memory = \"{}\": \
             viewers load the finer ones at once; lower [triangulation] sites_per_tile or raise memory",
            pyramid.inner.len(),
            config.limits.memory
        )
    })
}

fn fits_one_file(written: &TileFigures) -> bool {
    written.triangles <= MOST_TRIANGLES_IN_ONE_FILE && written.files <= MOST_TILES_IN_ONE_FILE
}

fn too_large_for_one_file(written: &TileFigures) -> String {
    format!(
        "{} triangles in {} tiles are more than viewers open as one file: terrain.glb is left out and tileset.json written in its \
         place; set [input] bounds or classes for a smaller terrain",
        report::grouped(written.triangles),
        report::grouped(written.files)
    )
}

fn task<'a>(plan: &'a Plan, config: &Config) -> Task<'a> {
    Task {
        sources: &plan.sources,
        extent: plan.extent,
        points_per_tile: config.triangulation.sites_per_tile.0,
        memory: config.limits.memory.0 / 6,
        malformed_share: config.input.malformed_share.0,
        on_bad_file: config.input.on_bad_file,
    }
}

/// The box around the points, if there are any.
fn enough_points(summary: &Summary) -> Result<[[i32; 3]; 2]> {
    summary.bounds.ok_or_else(|| {
        let tally = &summary.tally;
        Error::NoTerrain(format!(
            "no point is left to triangulate: of {} read, {} are malformed, {} withheld, {} of other classes, {} out of bounds; check \
             [input] classes and bounds",
            tally.read, tally.malformed, tally.withheld, tally.other_class, tally.out_of_bounds
        ))
    })
}

fn enough_triangles(written: &TileFigures, plan: &Plan) -> Result<()> {
    if written.triangles > 0 {
        return Ok(());
    }
    if written.cut_triangles > 0 {
        return Err(Error::Config(format!(
            "[output] max_edge leaves out all {} triangles: give a greater one",
            written.cut_triangles
        )));
    }
    Err(Error::NoTerrain(format!(
        "the points make no triangle in steps of {}: it takes at least three different places in x and y that are not on one line",
        plan.lattice.resolution
    )))
}

/// Triangulates all leaves and merges every merge node as soon as all below it is done.
fn triangulate(
    config: &Config,
    triangulator: &Triangulator,
    store: &Store,
    directory: &Directory,
    partition: &Partition,
    longest: Longest,
    stage: &Stage,
) -> Result<LeafFigures> {
    let spill = Spill::open(&directory.spill())?;
    let grower = Grower { config, triangulator, store, partition, spill: &spill, longest, stage };
    grower.grow(0)
}

struct Grower<'a> {
    config: &'a Config,
    triangulator: &'a Triangulator,
    store: &'a Store,
    partition: &'a Partition,
    spill: &'a Spill,
    longest: Longest,
    stage: &'a Stage,
}

impl Grower<'_> {
    fn grow(&self, node: usize) -> Result<LeafFigures> {
        match self.partition.tree.nodes[node].kind {
            Kind::Leaf(tile) => {
                let task = leaf::Task {
                    duplicates: self.config.input.duplicates,
                    triangulator: self.triangulator,
                    longest: self.longest,
                };
                let figures = leaf::run(self.store, self.partition, self.spill, tile, task)?;
                self.stage.advance(figures.sites + figures.duplicates);
                Ok(figures)
            }
            Kind::Inner([low, high]) => {
                let (low, high) = rayon::join(|| self.grow(low), || self.grow(high));
                let (mut figures, high) = (low?, high?);
                figures += high;
                if self.partition.tree.is_merge(node) {
                    // Nodes below the root may be merged at once on all threads.
                    let share = if node == 0 { 1 } else { rayon::current_num_threads() as u64 };
                    let memory = self.config.limits.memory.0 / 4 * 3 / share;
                    merge::run(self.store, &self.partition.tree, node, memory, self.longest)?;
                }
                Ok(figures)
            }
        }
    }
}

/// How the tiles are to look.
fn look(config: &Config, plan: &Plan, summary: &Summary, bounds: [[i32; 3]; 2], cut: Cut) -> Look {
    let elevation = Coloring::Elevation { low: bounds[0][2], high: bounds[1][2] };
    let coloring = match config.output.color {
        ColorChoice::None => None,
        ColorChoice::Class => Some(Coloring::Class),
        ColorChoice::Elevation => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb if summary.tally.max_rgb == 0 => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb => Some(Coloring::Rgb { eight_bit: summary.tally.max_rgb <= 255 }),
    };
    let compression = config.output.compression;
    let frame = match compression {
        Compression::None => plan.frame.clone().refined(bounds),
        _ => plan.frame.clone().packed(),
    };
    Look { frame, coloring, normals: config.output.normals, compression, cut }
}

fn stitch_all(store: &Store, tree: &Tree, look: &Look, stage: &Stage) -> Result<()> {
    (0..tree.leaves.len()).into_par_iter().try_for_each(|tile| {
        stitch::run(store, tree, tile, look)?;
        stage.advance(1);
        Ok(())
    })
}

fn export_all(
    directory: &Directory,
    store: &Store,
    partition: &Partition,
    look: &Look,
    canvas: &Canvas,
    stage: &Stage,
) -> Result<TileFigures> {
    (0..partition.tree.leaves.len())
        .into_par_iter()
        .with_max_len(1)
        .map(|tile| {
            let figures = export::run(directory, store, &partition.tree, tile, look, canvas)?;
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
    store: &Store,
    plan: &Plan,
    placement: Option<Placement>,
    canvas: &Canvas,
    tiles: usize,
    bounds: [[i32; 3]; 2],
) -> Result<u64> {
    let georeference = Georeference::new(&plan.frame, &plan.lattice, bounds, plan.unit, plan.crs.epsg);
    let text = georeference.to_json(placement.as_ref());
    directory::write_whole(&directory.georeference(), |file| file.write_all(text.as_bytes()))?;
    let picture = draw_picture(store, canvas, tiles)?;
    directory::write_whole(&directory.preview(), |file| file.write_all(&picture))?;
    Ok((text.len() + picture.len()) as u64)
}

/// Writes `terrain.glb`; returns its bytes.
fn write_one_file(directory: &Directory, tiles: usize) -> Result<u64> {
    let paths: Vec<_> = (0..tiles).map(|tile| directory.tile(tile)).filter(|path| path.exists()).collect();
    write_terrain(&directory.terrain(), &paths)?;
    Ok(std::fs::metadata(directory.terrain()).map_err(Error::io("read", directory.terrain()))?.len())
}

fn draw_picture(store: &Store, canvas: &Canvas, tiles: usize) -> Result<Vec<u8>> {
    let mut picture = Picture::new(canvas);
    for tile in 0..tiles {
        picture.add(tile as u32, &ColumnReader::open(store, Key::Pixels(tile))?.column::<Texel>()?);
    }
    Ok(picture.png())
}
