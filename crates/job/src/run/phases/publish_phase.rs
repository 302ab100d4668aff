//! Step 8: the coarser tiles above the parts, what is beside the tiles, and the report.

use crate::durable::atomic_file::write_pending;
use crate::durable::journal::listed;
use crate::index::{PartIndex, TileIndex};
use crate::levels::hierarchy::Hierarchy;
use crate::levels::make_level::{Child, LevelStats};
use crate::progress::stage::Stage;
use crate::publish::classified::{ClassifiedInputs, write_all};
use crate::publish::contours::write_contours::ContourWork;
use crate::publish::exports::write_exports::{ExportWork, Exports};
use crate::publish::map_tiles::write_map_tiles::MapTileWork;
use crate::publish::published::Published;
use crate::publish::raster::write_raster::RasterWork;
use crate::publish::side_files::{EachTile, write_side_files};
use crate::publish::terrain_tiles::write_terrain::{TerrainStats, TerrainWork};
use crate::publish::tileset_tree::TilesOfTree;
use crate::publish::written_tiles::{WrittenTiles, check_some_triangles, wants_tileset};
use crate::records::{JobStep, Store};
use crate::report::job_report::{PartFigures, Report, ReportParts, SlowestPart};
use crate::run::job::Job;
use crate::run::meshed_part::MeshedPart;
use crate::run::part_entries::{Done, PartEntries};
use crate::run::phases::join::JoinedParts;
use crate::run::phases::level_phase::{hierarchy_of, levels_over};
use crate::run::phases::outdated_levels::level_sizes;
use crate::run::phases::read_phase::sum_up;
use crate::run::phases::select_phase::{SelectedPart, found_ground};
use crate::run::update::changes::write_changes;
use crate::run::whole_run::WholeRun;
use serde::de::IgnoredAny;
use sys::{Error, Result};
use tiles::checksums::list_text;
use tiles::tiles3d::tileset::TilesetNode;

/// Makes the coarser tiles above the parts, writes what is beside the tiles, and the report.
///
/// # Errors
/// Those of the steps.
pub(crate) fn publish_job(run: &WholeRun, job: &Job, joined: &JoinedParts) -> crate::Result<Report> {
    let (plan, directory) = (job.plan, job.directory);
    let (figures, points) = figures_of(job)?;
    check_some_triangles(&figures.tiles, plan)?;
    let (summary, bounds) = sum_up(job)?;
    let above = Hierarchy::above_parts(&job.parts.tree, &points, level_sizes(plan));
    let has_tileset = wants_tileset(plan, &figures.tiles);
    let mut levels = figures.levels;
    if !above.tiles.is_empty() {
        let top_of = |part: PartIndex| {
            let open = job.open(part)?;
            Child::top(job.directory, &open.store, &open.partition.tree)
        };
        levels += levels_over(job, joined, job.above(), &above, has_tileset, &top_of)?;
    }
    add_stages(run, job)?;
    let root = has_tileset.then(|| root_of_all(job, &above)).transpose()?;
    let written = WrittenTiles {
        stats: figures.tiles,
        bounds,
        vertices: figures.leaves.bounds.unwrap_or(bounds),
        hull: joined.hull_count(job)?,
        appearance: &joined.appearance,
        tiles: &TilesOfParts(job),
    };
    let mut published = publish(run, job, &written, root, levels)?;
    published.warnings.extend(plan.grown_parts_warning(&points));
    let of_parts = PartEntries::of_all(directory, job.id)?;
    let of_parts = of_parts.iter().flat_map(|part| part.files(None)).cloned();
    let list = listed(directory, run.journal.files().into_iter().chain(of_parts).collect());
    let update = match plan.options.updates {
        true => write_changes(directory, &plan.lattice, written.tiles, &list)?,
        false => None,
    };
    let list = write_pending(&directory.output().checksums(), list_text(&list).as_bytes())?;
    let parts = ReportParts {
        points: summary.counts,
        figures,
        published,
        triangulator: job.triangulator,
        update,
        wall_s: run.wall_s(),
        stages: run.stages.take(),
        threads: job.threads,
        resumed: run.resumed,
        clock: job.clock,
        identity: run.identity.clone(),
        list: list.clone(),
    };
    let (report, text) = Report::new(plan, parts).sealed()?;
    // The report comes last: it says that all results are there.
    run.journal.step(JobStep::Report, || {
        let report = write_pending(&directory.output().report(), &text)?;
        Ok::<_, Error>(((), vec![list, report]))
    })?;
    Ok(report)
}

/// The phases of parts and of the nodes above them, in their order.
const STEPS: [JobStep; 6] =
    [JobStep::Read, JobStep::Select, JobStep::Mesh, JobStep::Join, JobStep::Tiles, JobStep::Levels];

/// Adds the stages of these phases to the report.
fn add_stages(run: &WholeRun, job: &Job) -> Result<()> {
    let mut costs = Vec::new();
    for part in job.parts.all().chain([job.above()]) {
        costs.extend(job.entries(part)?.costs()?);
    }
    let stages = STEPS.iter().flat_map(|step| costs.iter().filter(move |(of, _)| of == step));
    stages.flat_map(|(_, done)| &done.stages).for_each(|stage| run.add_stage(stage.clone()));
    Ok(())
}

/// Returns what all parts hold together, and the number of points of each.
fn figures_of(job: &Job) -> Result<(PartFigures, Vec<u64>)> {
    let count = job.parts.all().len();
    let (mut all, mut counts) = (PartFigures { parts: count as u64, ..PartFigures::default() }, Vec::new());
    let (mut together, mut stored, mut selecting, mut cpu_s, mut by_tasks) = (0, 0, 0, 0.0, false);
    for part in job.parts.all() {
        let entries = job.entries(part)?;
        let (mesh, costs) = (entries.figures::<MeshedPart>(JobStep::Mesh)?, entries.costs()?);
        all.leaves += mesh.leaves;
        all.tiles += entries.tiles()?.stats;
        all.levels += entries.figures::<LevelStats>(JobStep::Levels)?;
        all.peak_memory = costs.iter().map(|(_, done)| done.peak_memory).fold(all.peak_memory, Ord::max);
        cpu_s += costs.iter().flat_map(|(_, done)| &done.stages).map(|stage| stage.cpu_s).sum::<f64>();
        all.temporary = all.temporary.max(mesh.temporary);
        (together, stored) = (together + mesh.temporary, stored + entries.stored());
        by_tasks |= mesh.by_task;
        let (seconds, points) = (entries.seconds()?, mesh.points);
        counts.push(points);
        if count > 1 && all.slowest.is_none_or(|slowest| slowest.seconds <= seconds) {
            all.slowest = Some(SlowestPart { part: part.get() as u64, seconds, points });
        }
        if let Some(selected) = entries.known::<SelectedPart>(JobStep::Select)? {
            all.selection = all.selection.or(selected.all);
            all.wanted += selected.wanted;
            all.duplicates += selected.duplicates;
            selecting = selected.temporary.max(selecting);
        }
    }
    let join: Option<Done<IgnoredAny>> = job.entries(job.above())?.done(JobStep::Join)?;
    all.peak_memory = all.peak_memory.max(join.and_then(|join| join.peak_memory));
    if by_tasks {
        // All tasks together may have had as much at the same time.
        all.temporary = together;
        // The stages of meshing are kinds of work that go on at the same time.
        all.cpu_s_of_tasks = cpu_s;
    }
    // Most tiles may have been written after the last part was meshed.
    all.temporary = all.temporary.max(stored).max(selecting);
    Ok((all, counts))
}

/// Returns the root of all tiles. `hierarchy` has the coarser ones above the parts.
fn root_of_all(job: &Job, hierarchy: &Hierarchy) -> Result<TilesetNode> {
    let root = if hierarchy.tiles.is_empty() {
        root_of_part(job, PartIndex::FIRST)?
    } else {
        let (store, part_root) = (&job.entries(job.above())?.store()?, &|part: PartIndex| root_of_part(job, part));
        TilesOfTree { store, tree: &job.parts.tree, hierarchy, part_root }.root()?
    };
    root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))
}

fn root_of_part(job: &Job, part: PartIndex) -> Result<Option<TilesetNode>> {
    let open = job.open(part)?;
    let hierarchy = &hierarchy_of(job.plan, &open.partition);
    let (store, tree) = (&open.store, &open.partition.tree);
    TilesOfTree { store, tree, hierarchy, part_root: &|_| Ok(None) }.root()
}

/// The tiles of all parts.
struct TilesOfParts<'a>(&'a Job<'a>);

impl EachTile for TilesOfParts<'_> {
    fn visit(&self, visit: &mut dyn FnMut(&Store, TileIndex) -> Result<()>) -> Result<()> {
        self.0.parts.all().try_for_each(|part| {
            let open = self.0.open(part)?;
            open.partition.tree.tiles().try_for_each(|tile| visit(&open.store, tile))
        })
    }
}

/// Writes what is beside the tiles. The `root` of the tileset is there if viewers get 3D Tiles.
///
/// # Errors
/// Those of the functions in [`crate::publish`].
fn publish(
    run: &WholeRun,
    job: &Job,
    written: &WrittenTiles,
    root: Option<TilesetNode>,
    levels: LevelStats,
) -> Result<Published> {
    let (plan, directory, tiles) = (job.plan, job.directory, written.tiles);
    let style = &written.appearance.style;
    let mut published = Published { vertex_colors: style.colors.source(), ..Published::default() };
    if let Some(work) = RasterWork::of(plan, &style.frame, tiles)? {
        let stage = ("raster", work.blocks(), "blocks");
        let stats = run.write(JobStep::Raster, stage, |stage| work.write(directory, &|| stage.advance(1)))?;
        published.warnings.extend(work.warnings(directory, &stats)?);
        published.bytes += stats.bytes;
        published.raster = Some(stats);
        if let Some(work) = MapTileWork::of(plan, work.grid())? {
            let stage = ("map tiles", work.tiles(), "tiles");
            let write = |stage: &Stage| work.write(directory, &|| stage.advance(1));
            let stats = run.write(JobStep::MapTiles, stage, write)?;
            published.bytes += stats.bytes;
            published.map_tiles = Some(stats);
        }
    }
    if let Some(work) = ContourWork::of(plan, &style.frame, tiles)? {
        let stage = ("contours", work.steps(), "steps");
        let write = |stage: &Stage| work.write(directory, &|steps| stage.advance(steps));
        let stats = run.write(JobStep::Contours, stage, write)?;
        published.warnings.extend(stats.warning());
        published.bytes += stats.bytes;
        published.contours = Some(stats);
    }
    if let Some(work) = ExportWork::of(plan, &style.frame, tiles, &written.stats)? {
        let stage = ("export", work.reads(), "triangles read");
        let write = |stage: &Stage| work.write(directory, &|triangles| stage.advance(triangles));
        let exports: Exports = run.write(JobStep::Exports, stage, write)?;
        published.warnings.extend(exports.warnings);
        published.bytes += exports.files.iter().map(|file| file.bytes).sum::<u64>();
        published.exports = exports.files;
    }
    if let Some(work) = TerrainWork::of(plan, &style.frame, tiles, &written.stats)? {
        let stage = ("terrain", work.steps(), "tiles");
        let write = |stage: &Stage| work.write(directory, &|steps| stage.advance(steps));
        let stats: TerrainStats = run.write(JobStep::Terrain, stage, write)?;
        published.bytes += stats.bytes;
        published.terrain = Some(stats);
    }
    if plan.options.output.classified {
        let (stage, ground) = (("classify", plan.records, "points"), found_ground(job)?);
        let write = |stage: &Stage| write_all(plan, &ground, directory, &|records| stage.advance(records));
        let classified: ClassifiedInputs = run.write(JobStep::Classified, stage, write)?;
        published.warnings.extend(classified.warnings);
        published.bytes += classified.bytes;
    }
    published.levels = levels;
    published.warnings.extend(levels.left_out_warning(plan));
    let content = written.side_files(plan, directory, root, &mut published.warnings)?;
    published.bytes += run.write(JobStep::Publish, ("publish", 1, "job"), |stage| {
        let files = write_side_files(directory, &content, &written.appearance.canvas, tiles)?;
        stage.advance(1);
        Ok(files)
    })?;
    Ok(published)
}
