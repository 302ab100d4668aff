//! A job, from the configuration to the report: scan, partition, triangulate the leaves and merge the inner nodes, beside that
//! stitch and export, then levels and report. Every step leaves its result in the job directory and finds there what it needs, so
//! that each can be called on its own, the ones by tile or by node in any order that puts children before parents; and a job that
//! was interrupted goes on from the steps that its journal has.

pub mod durable;
pub mod levels;
pub mod mesh;
pub mod options;
pub mod partition;
pub mod plan;
pub mod preflight;
pub mod progress;
pub mod publish;
pub mod records;
pub mod report;
pub mod run;
pub mod tiles;

use crate::job::durable::directory::{self, Directory};
use crate::job::durable::journal;
use crate::job::durable::journal::{Done, Journal, Mark, Step};
use crate::job::durable::store::Store;
use crate::job::levels::hierarchy::{Pyramid, Sizes};
use crate::job::levels::level::LevelFigures;
use crate::job::mesh::precision_limit::Longest;
use crate::job::options::JobOptions;
use crate::job::partition::read::{Partition, Summary, Task};
use crate::job::plan::fingerprint::{Fingerprint, Head};
use crate::job::plan::lattice_choice::Coarser;
use crate::job::plan::scan;
use crate::job::plan::scan::Plan;
use crate::job::preflight::check;
use crate::job::progress::stage::{Clock, Progress, Schedule, Stage, StageFigures};
use crate::job::progress::time_left;
use crate::job::publish::placement::Placement;
use crate::job::publish::{finish, placement, tileset};
use crate::job::report::{Parts, Report};
use crate::job::run::local_run::Mesh;
use crate::job::run::resume;
use crate::job::run::tile_queue::WrittenTiles;
use crate::job::tiles::max_edge::Cut;
use crate::job::tiles::write::{Look, TileFigures};
use crate::output::Compression;
use crate::output::color::Coloring;
use crate::output::options::{ColorChoice, OutputFormat};
use crate::output::tiles3d::georeference::Georeference;
use crate::triangulation::Triangulator;
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

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
    /// Whether to start over where an interrupted run could be gone on with.
    pub fresh: bool,
}

impl From<Progress> for Options {
    fn from(progress: Progress) -> Options {
        Options { progress, force: false, fresh: false }
    }
}

/// Runs the whole job of `config`, or what an interrupted run has left of it.
///
/// # Errors
/// Whatever stops a step; see [`Error`]. [`Error::Resumable`] if the finished steps are kept, else no temporary files are left.
pub fn run(config: &JobOptions, options: impl Into<Options>) -> Result<Report> {
    let (options, clock) = (options.into(), Clock::start());
    // First of all, so that a job that must have a GPU fails at once where there is none.
    let triangulator = Triangulator::new(&config.triangulation, &config.gpu, config.limits.memory.0, config.threads())?;
    let directory = Directory::new(&config.output.directory);
    directory.nothing_is_in_the_way()?;
    let fingerprint = on_threads(workers(config, 0)?, || Fingerprint::of(config))?;
    let coarser = if options.fresh { Coarser::default() } else { resume::coarser(&directory, &fingerprint)? };
    let mut head = Head { fingerprint, coarser };
    loop {
        match attempt(config, &triangulator, &head, options, clock) {
            // Only the finished mesh knows its longest triangle, so that a second try is the price of not rounding in vain.
            Err(Error::TooFine { vertical: true, what }) if head.coarser.vertical < MOST_TENS => {
                options.progress.note(&format!("{what}; starting again with a coarser step in z"));
                head.coarser.vertical += 1;
            }
            Err(Error::TooFine { vertical: false, what })
                if config.input.resolution.step().is_none() && head.coarser.horizontal < MOST_TENS =>
            {
                options.progress.note(&format!("{what}; starting again with a coarser step in x and y"));
                head.coarser.horizontal += 1;
            }
            outcome => return outcome,
        }
    }
}

fn attempt(
    config: &JobOptions,
    triangulator: &Triangulator,
    head: &Head,
    options: Options,
    clock: Clock,
) -> Result<Report> {
    let progress = options.progress;
    let stage = Schedule::new(progress, clock, Vec::new()).stage("scan", 1, "job");
    let plan = on_threads(workers(config, 0)?, || scan::run(config, head.coarser))?;
    stage.advance(1);
    let scanned = stage.finish();
    let progress = &Schedule::new(progress, clock, time_left::costs(&plan));
    report::note_skipped(&plan.skipped, progress);
    let threads = workers(config, plan.records)?;
    if !options.force {
        check::preflight(&plan, config, threads).passes()?;
    }
    let directory = Directory::new(&config.output.directory);
    directory.is_not_somebody_elses()?;
    let _lock = directory.lock()?;
    if let Some(report) = resume::complete(&directory, head)?.filter(|_| !options.fresh) {
        progress.note("the interrupted run had written all its results");
        on_threads(threads, || directory.clean_up())?;
        return Ok(report);
    }
    on_threads(threads, || {
        let resume::Start { store, journal, partition, files, parts } =
            resume::start(&directory, head, config, options)?;
        let job = Job {
            config,
            triangulator,
            coarser: head.coarser,
            directory: &directory,
            store: &store,
            journal: &journal,
            progress,
            threads,
            clock,
            kept: files,
            parts: AtomicBool::new(parts),
        };
        let outcome = job.run(plan, scanned, partition);
        let parts = job.parts.load(Ordering::Relaxed);
        // What is finished is on the disk before the message says so, if it gets there.
        drop(journal);
        // An open file cannot be freed by whoever removes it.
        drop(store);
        let steps = if outcome.is_err() { steps_kept(&directory) } else { 0 };
        match outcome {
            Err(why) if why.exit_code() == 1 && steps > 0 => {
                Err(Error::Resumable { why: Box::new(why), steps, job: directory.job().into() })
            }
            outcome => {
                let withdrawn = if outcome.is_err() && parts { directory.withdraw() } else { Ok(()) };
                // The first error is the one to report.
                let cleaned = withdrawn.and_then(|()| directory.clean_up());
                outcome.and_then(|report| cleaned.map(|()| report))
            }
        }
    })
}

/// How many finished steps the journal of a run that has failed holds.
fn steps_kept(directory: &Directory) -> u64 {
    journal::read(directory).ok().flatten().map_or(0, |(_, entries)| entries.len() as u64)
}

/// What `work` returns, its rayon tasks on `threads` threads.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Memory(format!("cannot start {threads} threads: {e}")))?;
    pool.install(work)
}

/// As many threads as are wanted, and as have room for a leaf each.
fn workers(config: &JobOptions, points: u64) -> Result<usize> {
    let per_tile = config.triangulation.max_points_per_tile.0.min(points).max(1);
    let per_leaf = per_tile.saturating_mul(BYTES_PER_LEAF_SITE).max(BYTES_PER_THREAD);
    // The rest is for code, stacks, decoders and what the allocator keeps.
    let room = config.limits.memory.0 / 4 * 3;
    match room / per_leaf {
        0 => Err(Error::Config(format!(
            "tiles of {per_tile} points take about {} MiB a thread, more than [limits] memory = \"{}\" has room for: lower \
             [triangulation] max_points_per_tile or raise memory",
            per_leaf >> 20,
            config.limits.memory
        ))),
        leaves => Ok(config.threads().min(leaves as usize)),
    }
}

/// A job whose inputs have been looked at and whose directory is its own.
pub(crate) struct Job<'a> {
    config: &'a JobOptions,
    triangulator: &'a Triangulator,
    coarser: Coarser,
    directory: &'a Directory,
    store: &'a Store,
    journal: &'a Journal<'a>,
    progress: &'a Schedule,
    threads: usize,
    clock: Clock,
    /// Results of an earlier run that stay.
    kept: HashSet<PathBuf>,
    /// Whether results may be there that are only a part of this job's.
    parts: AtomicBool,
}

impl Job<'_> {
    /// Step 2 and all after it, but for what an earlier run has done of them.
    fn run(&self, plan: Plan, scanned: StageFigures, partition: Option<Partition>) -> Result<Report> {
        let (plan, partition, read) = match partition {
            Some(partition) => self.take_over(plan, partition)?,
            None => self.read(plan)?,
        };
        let plan = &plan;
        let bounds = enough_points(&partition.summary)?;
        let longest = Longest::of(&plan.frame);
        longest.check_heights(bounds[0][2], bounds[1][2])?;

        let mesh = self.weave(plan, &partition, bounds, longest)?;
        enough_triangles(&mesh.tiles.figures, plan)?;
        // What is in the store is enough now.
        let grown = mesh.grown;
        beside(|| self.give_up_points(grown), || self.publish(plan, &partition, bounds, mesh, [scanned, read]))
    }

    /// Steps 7 and 8.
    fn publish(
        &self,
        plan: &Plan,
        partition: &Partition,
        bounds: [[i32; 3]; 2],
        mesh: Mesh,
        before: [StageFigures; 2],
    ) -> Result<Report> {
        let Job { config, triangulator, directory, store, journal, progress, .. } = *self;
        let Mesh {
            leaves, tiles: WrittenTiles { style: (look, canvas), figures: written, stages }, triangulated, ..
        } = mesh;
        let tiles = partition.tree.leaves.len();

        let one_file = fits_one_file(&written);
        let with_tileset = config.output.format != OutputFormat::Glb || !one_file;
        let for_viewers = with_tileset.then(|| self.tileset(plan, partition, &look)).transpose()?;
        let Levelled { figures: coarser, tileset, placement, mut warnings, stage: levelled } =
            for_viewers.unwrap_or_default();

        let stage = progress.stage("finish", 1, "job");
        let georeference = Georeference::new(&plan.frame, &plan.lattice, bounds, plan.unit, plan.crs.epsg);
        let georeference = georeference.to_json(placement.as_ref());
        let viewers = finish::Viewers { tileset, one_file: one_file && config.output.format != OutputFormat::Tiles3d };
        if viewers.one_file {
            // It is made of the tiles under their names.
            journal.commit()?;
        }
        let finish = || finish::run(directory, store, &georeference, &viewers, &canvas, tiles);
        // The tiles are on the disk before the report says how long that took.
        let other_bytes = beside(|| journal.commit(), || journal.step(Step::Finish, finish))?;
        if !one_file && config.output.format == OutputFormat::Glb {
            warnings.push(too_large_for_one_file(&written));
        }
        stage.advance(1);
        let mesh = std::iter::once(triangulated).chain(stages);
        let stages = before.into_iter().chain(mesh).chain(levelled).chain([stage.finish()]).collect();

        let report = Report::new(
            plan,
            Parts {
                points: partition.summary.tally.clone(),
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
                resumed: journal.taken_over(),
                clock: self.clock,
            },
        );
        let results = vec![directory::write_json(&directory.report(), &report)?];
        journal.record(Step::Report, Done { results, ..Done::new((), Vec::new()) })?;
        journal.commit()?;
        Ok(report)
    }

    /// What `tileset.json` needs and says.
    fn tileset(&self, plan: &Plan, partition: &Partition, look: &Look) -> Result<Levelled> {
        let (sizes, pyramid) = pyramid(self.config, partition);
        let stage = self.progress.stage("levels", pyramid.inner.len() as u64, "tiles");
        let figures = self.make_levels(&pyramid, sizes, look, &stage)?;
        let mut root = tileset::root(self.store, &partition.tree, &pyramid)?;
        let placed = placement::place(plan, &look.frame, self.config.output.height_offset, &mut root);
        let mut warnings = Vec::from_iter(placement::remark(&placed));
        warnings.extend(levels_left_out(self.config, &pyramid));
        let tileset = Some(tileset::text(look, &root));
        Ok(Levelled { figures, tileset, placement: placed.ok(), warnings, stage: Some(stage.finish()) })
    }

    /// Makes the coarser tiles, those of one height side by side, as many at once as have room.
    fn make_levels(&self, pyramid: &Pyramid, sizes: Sizes, look: &Look, stage: &Stage) -> Result<LevelFigures> {
        let content = self.config.output.levels;
        let lanes = match pyramid.largest() {
            largest if content && largest > 0 => (sizes.memory / largest).clamp(1, self.threads as u64) as usize,
            _ => self.threads,
        };
        let make = |at: usize| {
            let run = || levels::level::run(self.directory, self.store, pyramid, at, look, sizes, content);
            let figures = self.journal.step(Step::Level(pyramid.inner[at].node), run)?;
            stage.advance(1);
            Ok(figures)
        };
        on_threads(lanes, || {
            let mut all = LevelFigures::default();
            for height in pyramid.by_height() {
                if content {
                    // The tiles below are read under their names.
                    self.journal.commit()?;
                }
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
            let mut partition = partition::read::run(&task(&plan, config), directory, &stage)?;
            let figures = stage.finish();
            let lattice = plan.lattice.clone();
            if !partition.skipped.is_empty() {
                report::note_skipped(&partition.skipped, progress);
                plan = scan::without(plan, &partition.skipped, config, coarser)?;
            }
            if plan.lattice == lattice {
                partition.skipped.clone_from(&plan.skipped);
                self.journal.record(Step::Partition, Done::new((), vec![partition.save(self.store)?]))?;
                return Ok((plan, partition, figures));
            }
        }
    }

    /// What [`Job::read`] came to in an earlier run.
    fn take_over(&self, mut plan: Plan, partition: Partition) -> Result<(Plan, Partition, StageFigures)> {
        let stage = self.progress.stage("read", plan.records, "points");
        if partition.skipped != plan.skipped {
            plan = scan::without(plan, &partition.skipped, self.config, self.coarser)?;
        }
        stage.take_over(partition.summary.tally.read);
        Ok((plan, partition, stage.finish()))
    }

    /// Removes the points: once all leaves are in the journal, which they are at `grown`, what is in the store is enough.
    fn give_up_points(&self, grown: Mark) -> Result<()> {
        self.journal.commit_to(grown)?;
        if self.journal.is_worth_syncing() {
            self.store.sync()?;
        }
        directory::remove_file(&self.directory.spill())
    }

    /// Shows that `step` is done, by this run or an earlier one.
    fn count(&self, stage: &Stage, step: Step, amount: u64) {
        if self.journal.has(step) { stage.take_over(amount) } else { stage.advance(amount) }
    }
}

/// Does `work`, and beside it, on a thread of its own if there is one, what waits for the disk.
fn beside<T>(waiting: impl Fn() -> Result<()> + Sync, work: impl FnOnce() -> Result<T>) -> Result<T> {
    std::thread::scope(|scope| match std::thread::Builder::new().spawn_scoped(scope, &waiting) {
        Ok(thread) => {
            let outcome = work();
            let waited = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            outcome.and_then(|outcome| waited.map(|()| outcome))
        }
        Err(_) => waiting().and_then(|()| work()),
    })
}

/// What comes of a tileset, if there is one.
#[derive(Default)]
struct Levelled {
    figures: LevelFigures,
    /// The text of `tileset.json`.
    tileset: Option<String>,
    placement: Option<Placement>,
    warnings: Vec<String>,
    stage: Option<StageFigures>,
}

/// Which tiles viewers see.
fn pyramid(config: &JobOptions, partition: &Partition) -> (Sizes, Pyramid) {
    let points: Vec<u64> = (0..partition.blocks.len()).map(|tile| partition.points(tile)).collect();
    let sizes = Sizes::new(config.output.max_points_per_level_tile.0, config.limits.memory.0);
    (sizes, Pyramid::new(&partition.tree, &points, sizes))
}

fn levels_left_out(config: &JobOptions, pyramid: &Pyramid) -> Option<String> {
    let without = pyramid.inner.iter().filter(|inner| !inner.content).count();
    (config.output.levels && without > 0).then(|| {
        format!(
            "{without} of {} coarser tiles are left out, because the tiles below them are too large for [limits] memory = \"{}\": \
             viewers load the finer ones at once; lower [triangulation] max_points_per_tile or raise memory",
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
         place; set {}",
        report::grouped(written.triangles),
        report::grouped(written.files),
        match written.triangles > MOST_TRIANGLES_IN_ONE_FILE {
            true => "[input] bounds or classes for a smaller terrain",
            false => "a greater [triangulation] max_points_per_tile for fewer tiles",
        }
    )
}

fn task<'a>(plan: &'a Plan, config: &JobOptions) -> Task<'a> {
    Task {
        sources: &plan.sources,
        extent: plan.extent,
        points_per_tile: config.triangulation.max_points_per_tile.0,
        memory: config.limits.memory.0 / 6,
        max_malformed_fraction: config.input.max_malformed_fraction.0,
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

/// How the tiles are to look.
fn look(config: &JobOptions, plan: &Plan, summary: &Summary, bounds: [[i32; 3]; 2], cut: Cut) -> Look {
    let elevation = Coloring::Elevation { low: bounds[0][2], high: bounds[1][2] };
    let coloring = match config.output.color {
        ColorChoice::None => None,
        ColorChoice::Class => Some(Coloring::Class),
        ColorChoice::Elevation => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb if summary.tally.max_rgb == 0 => Some(elevation),
        ColorChoice::Auto | ColorChoice::Rgb => Some(Coloring::Rgb { eight_bit: summary.tally.max_rgb <= 255 }),
    };
    let compression = config.output.packing();
    let frame = match compression {
        Compression::None => plan.frame.clone().refined(bounds),
        _ => plan.frame.clone().packed(),
    };
    Look { frame, coloring, normals: config.output.normals, compression, cut }
}
