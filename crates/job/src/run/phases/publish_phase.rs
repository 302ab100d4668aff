//! Step 8: the coarser tiles above the parts, what is beside the tiles, and the report.

use crate::durable::atomic_file::{PendingFile, write_pending};
use crate::durable::file_list::listed;
use crate::index::{PartIndex, TileIndex};
use crate::levels::hierarchy::Hierarchy;
use crate::levels::make_level::{Child, LevelStats};
use crate::merge_records::HullCount;
use crate::mesh::leaf::LeafStats;
use crate::plan::job_plan::Plan;
use crate::plan::no_points::no_triangle;
use crate::progress::number_text::grouped;
use crate::publish::classified::{ClassifiedInputs, write_all};
use crate::publish::contours::write_contours::{ContourStats, ContourWork, drawing_warning};
use crate::publish::exports::write_exports::{ExportWork, ExportedFile, Exports};
use crate::publish::flat_tile::FlatScene;
use crate::publish::height_offset_check::unused_height_offset;
use crate::publish::map_tiles::write_map_tiles::{MapTileStats, MapTileWork};
use crate::publish::one_file_limits::{fits_one_file, too_large_for_one_file};
use crate::publish::placement::{height_unit_warning, heights_warning, place, placement_warning};
use crate::publish::raster::write_raster::{RasterStats, RasterWork};
use crate::publish::side_files::{EachTile, SideFiles, StoredTiles, write_side_files};
use crate::publish::terrain_tiles::write_terrain::{TerrainStats, TerrainWork};
use crate::publish::tileset_tree::TilesOfTree;
use crate::records::{JobStep, Store};
use crate::report::change_counts::ChangeCounts;
use crate::report::job_report::{Report, ReportParts, SlowestPart};
use crate::report::selection_report::SelectionReport;
use crate::run::done::Done;
use crate::run::folder::{Folder, done_with};
use crate::run::job::Job;
use crate::run::part_entries::PartJournals;
use crate::run::phases::join::JoinedParts;
use crate::run::phases::level_phase::{hierarchy_of, left_out_warning, make_levels};
use crate::run::phases::outdated_levels::{forget_outdated_levels, key_of_tiles, level_sizes};
use crate::run::phases::part_progress::PartProgress;
use crate::run::phases::part_store::PartStores;
use crate::run::phases::read_phase::sum_up;
use crate::run::phases::select_phase::{SelectedPart, found_ground};
use crate::run::phases::tile_queue::TileAppearance;
use crate::run::update::changes::write_changes;
use crate::run::whole_run::WholeRun;
use crate::tiles::style::TileStyle;
use crate::tiles::vertex_colors::{ColorSource, VertexColors, check_photo, without_pixel_warning};
use crate::tiles::write_tile::TileStats;
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use points::PointCounts;
use serde::de::IgnoredAny;
use sys::{Error, Result, Warnings};
use tiles::checksums::{Checksum, list_text};
use tiles::color::Coloring;
use tiles::frame::Frame;
use tiles::options::{Hull, MaxError, OutputFormat};
use tiles::tiles3d::division::divide;
use tiles::tiles3d::georeference::Georeference;
use tiles::tiles3d::globe::NotPlaced;
use tiles::tiles3d::tileset::TilesetNode;

/// Makes the coarser tiles above the parts, writes what is beside the tiles, and the report.
///
/// # Errors
/// Those of the steps.
pub(crate) fn publish_job(
    run: &WholeRun,
    job: &Job,
    stores: &PartStores,
    joined: &JoinedParts,
) -> crate::Result<Report> {
    let parts = job.parts.all().map(|part| PartProgress::of(&job.directory.part(part), job.header(part)));
    let parts = parts.collect::<Result<Vec<PartProgress>>>()?;
    let figures = PartFigures::of(&parts)?;
    some_triangles(&figures.tiles, job.plan)?;
    let (summary, bounds) = sum_up(job, parts.iter().filter_map(|part| part.read.as_ref()))?;
    add_stages(run, joined, &parts);
    let wants_tileset = wants_tileset(job.plan, &figures.tiles);
    if !wants_tileset && parts.len() > 1 {
        // A run before may have had one.
        let hierarchy = Hierarchy::above_parts(&job.parts.tree, &figures.points, level_sizes(job.plan));
        forget_outdated_levels(job, &job.directory.join(), job.above(), &hierarchy, false)?;
    }
    let tileset = wants_tileset.then(|| levels_and_root(run, job, stores, joined, &figures));
    let (tiles, hull) = (&TilesOfParts { job, stores }, joined.hull_count(job, stores)?);
    let written = WrittenFiles { stats: figures.tiles, vertices: figures.leaves.bounds.unwrap_or(bounds), hull, tiles };
    let mut published = publish(run, job, bounds, &written, &joined.appearance, tileset.transpose()?)?;
    published.warnings.extend(grown_parts(job.plan, &figures.points));
    let peak_memory = parts.iter().map(PartProgress::peak_memory).max().flatten().max(joined.peak_memory);
    let costs = CostsOfParts {
        slowest: (parts.len() > 1).then(|| slowest(&parts)).flatten(),
        peak_memory,
        cpu_s: if figures.by_tasks { processor_seconds(&parts) } else { 0.0 },
    };
    let list = list_of_files(run)?;
    let update = match job.plan.options.updates {
        true => write_changes(run.directory, &job.plan.lattice, tiles, &list)?,
        false => None,
    };
    let list = write_pending(&run.directory.output().checksums(), list_text(&list).as_bytes())?;
    Ok(write_report(run, job, summary.counts, figures, costs, published, (list, update))?)
}

/// Returns what the user should know if parts have grown since the first run of a job that is updated.
fn grown_parts(plan: &Plan, points: &[u64]) -> Option<String> {
    let most = plan.points_per_part().saturating_mul(2);
    let grown = points.iter().filter(|points| **points > most).count();
    (plan.cut.is_some() && grown > 0).then(|| {
        format!(
            "{} more than twice the {} points that a part is to have, so updates of them take longer; fix: run once with --restart, which cuts \
             all parts anew",
            if grown == 1 { "1 part has".into() } else { format!("{grown} parts have") },
            grouped(plan.points_per_part())
        )
    })
}

/// What the phases of parts took.
struct CostsOfParts {
    slowest: Option<SlowestPart>,
    /// The largest resident set of the processes that did them, in bytes.
    peak_memory: Option<u64>,
    /// Seconds of processor time, if tasks did them.
    cpu_s: f64,
}

/// What all parts hold together.
struct PartFigures {
    leaves: LeafStats,
    tiles: TileStats,
    levels: LevelStats,
    /// The points of each part.
    points: Vec<u64>,
    temporary: u64,
    /// How vertices were selected from the points of all parts, by each part.
    selected: Vec<SelectedPart>,
    /// Whether tasks meshed the parts.
    by_tasks: bool,
}

impl PartFigures {
    fn of(parts: &[PartProgress]) -> Result<PartFigures> {
        fn figures<T>(part: usize, done: &Option<T>) -> Result<&T> {
            done.as_ref().ok_or_else(|| Error::Broken(format!("part {part} is not complete")))
        }
        let (mut leaves, mut tiles, mut levels) = (LeafStats::default(), TileStats::default(), LevelStats::default());
        let mut meshed = Vec::with_capacity(parts.len());
        for (part, progress) in parts.iter().enumerate() {
            let mesh = figures(part, &progress.mesh)?;
            leaves += mesh.leaves;
            tiles += progress.tiles.stats;
            levels += *figures(part, &progress.levels)?;
            meshed.push(mesh);
        }
        let temporary = meshed.iter().map(|mesh| mesh.temporary);
        // All tasks together may have had as much at the same time.
        let by_tasks = meshed.iter().any(|mesh| mesh.by_task);
        let meshing: u64 = if by_tasks { temporary.sum() } else { temporary.max().unwrap_or(0) };
        // Most tiles may have been written after the last part was meshed.
        let temporary = meshing.max(parts.iter().map(|part| part.stored).sum());
        let selected: Vec<SelectedPart> = parts.iter().filter_map(|part| part.selected.clone()).collect();
        let temporary = selected.iter().map(|part| part.temporary).fold(temporary, u64::max);
        let points = meshed.iter().map(|mesh| mesh.points).collect();
        Ok(PartFigures { leaves, tiles, levels, points, temporary, selected, by_tasks })
    }
}

/// Adds the stages of all parts to the report, in the order of the phases.
fn add_stages(run: &WholeRun, joined: &JoinedParts, parts: &[PartProgress]) {
    let of = |step| parts.iter().flat_map(move |part| part.stages_of(step)).cloned();
    let first =
        of(JobStep::Read).chain(of(JobStep::Select)).chain(of(JobStep::Mesh)).chain(joined.stages.iter().cloned());
    first.chain(of(JobStep::Tiles)).chain(of(JobStep::Levels)).for_each(|stage| run.add_stage(stage));
}

/// Returns the seconds of processor time of all phases of parts. The stages of meshing are kinds of work that go on at the same time.
fn processor_seconds(parts: &[PartProgress]) -> f64 {
    let steps = [JobStep::Read, JobStep::Select, JobStep::Mesh, JobStep::Tiles, JobStep::Levels];
    let stages =
        |part: &PartProgress| steps.iter().flat_map(|&step| part.stages_of(step)).map(|stage| stage.cpu_s).sum::<f64>();
    parts.iter().map(stages).sum()
}

fn slowest(parts: &[PartProgress]) -> Option<SlowestPart> {
    let (part, slowest) = parts.iter().enumerate().max_by(|(_, a), (_, b)| a.seconds().total_cmp(&b.seconds()))?;
    let points = slowest.mesh.as_ref()?.points;
    Some(SlowestPart { part: part as u64, seconds: slowest.seconds(), points })
}

/// Makes the coarser tiles above the parts, and returns the root of all.
fn levels_and_root(
    run: &WholeRun,
    job: &Job,
    stores: &PartStores,
    joined: &JoinedParts,
    figures: &PartFigures,
) -> crate::Result<TilesetContent> {
    let (tree, mut levels) = (&job.parts.tree, figures.levels);
    let hierarchy = Hierarchy::above_parts(tree, &figures.points, level_sizes(job.plan));
    let root = if hierarchy.tiles.is_empty() {
        root_of_part(job, stores, PartIndex::FIRST)?
    } else {
        let directory = &job.directory.join();
        let key = key_of_tiles(job, &job.parts.all().collect::<Vec<PartIndex>>(), true)?;
        let done = done_with(job, directory, job.above(), JobStep::Levels, key)?;
        if done.is_none() {
            forget_outdated_levels(job, directory, job.above(), &hierarchy, true)?;
        }
        let folder = Folder::open(job, directory, job.above())?.with_key(key);
        let top_of = |part: PartIndex| {
            let open = stores.open(part)?;
            Child::top(job.directory, &open.store, &open.partition.tree)
        };
        levels += match done {
            Some(done) => done,
            None => make_levels(job, &folder, tree.part, &hierarchy, &joined.appearance.style, &top_of)?,
        };
        let done = folder.journal.figures_of::<Done<IgnoredAny>>(JobStep::Levels)?;
        done.into_iter().flat_map(|done| done.stages).for_each(|stage| run.add_stage(stage));
        let part_root = &|part: PartIndex| root_of_part(job, stores, part);
        TilesOfTree { store: &folder.store, tree, hierarchy: &hierarchy, part_root }.root()?
    };
    let root = root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))?;
    Ok(TilesetContent { root, levels })
}

fn root_of_part(job: &Job, stores: &PartStores, part: PartIndex) -> Result<Option<TilesetNode>> {
    let open = stores.open(part)?;
    let hierarchy = &hierarchy_of(job.plan, &open.partition);
    let (store, tree) = (&open.store, &open.partition.tree);
    TilesOfTree { store, tree, hierarchy, part_root: &|_| Ok(None) }.root()
}

/// The tiles of all parts.
struct TilesOfParts<'a> {
    job: &'a Job<'a>,
    stores: &'a PartStores,
}

impl EachTile for TilesOfParts<'_> {
    fn visit(&self, visit: &mut dyn FnMut(&Store, TileIndex) -> Result<()>) -> Result<()> {
        self.job.parts.all().try_for_each(|part| {
            let open = self.stores.open(part)?;
            StoredTiles { store: &open.store, tree: &open.partition.tree }.visit(visit)
        })
    }
}

/// Tells whether viewers get 3D Tiles: where the user wants them, or where one file would be too large.
pub(crate) fn wants_tileset(plan: &Plan, written: &TileStats) -> bool {
    plan.options.output.format != OutputFormat::Glb || !fits_one_file(written)
}

/// The tiles that are written.
struct WrittenFiles<'a> {
    stats: TileStats,
    /// The lattice box of all vertices.
    vertices: Bounds<3>,
    /// How many slivers along the hull the whole mesh has.
    hull: HullCount,
    tiles: &'a dyn EachTile,
}

/// What viewers of 3D Tiles get.
struct TilesetContent {
    root: TilesetNode,
    levels: LevelStats,
}

/// Checks that there is a terrain to look at.
fn some_triangles(written: &TileStats, plan: &Plan) -> crate::Result<()> {
    if written.triangles > 0 {
        return Ok(());
    }
    if written.cut_triangles > 0 {
        let slivers = match written.slivers {
            0 => String::new(),
            slivers => format!(" besides {slivers} slivers along the hull"),
        };
        // The rule for the hull never leaves out more than half of the mesh.
        let by_length = written.cut_triangles - written.slivers;
        if plan.clip.is_some() && plan.options.output.max_edge == tiles::options::MaxEdge::None {
            return Err(crate::Error::NoTerrain(format!(
                "all {by_length} triangles{slivers} lie outside the polygons of [input] clip, which hold only a few points"
            )));
        }
        return Err(Error::Config(format!(
            "[output] max_edge leaves out all {by_length} triangles{slivers}: give a greater one"
        ))
        .into());
    }
    Err(no_triangle(plan))
}

/// What step 8 gives back.
struct Published {
    /// Bytes of the results besides the tiles.
    bytes: u64,
    levels: LevelStats,
    raster: Option<RasterStats>,
    map_tiles: Option<MapTileStats>,
    contours: Option<ContourStats>,
    exports: Vec<ExportedFile>,
    terrain: Option<TerrainStats>,
    vertex_colors: ColorSource,
    warnings: Warnings,
}

/// Returns how the tiles of a scene that is bent become flat.
fn flat_scene<'a>(plan: &Plan, style: &'a TileStyle, bounds: Bounds<3>) -> Option<FlatScene<'a>> {
    let (flat, compression) = (style.flat_frame(plan, bounds), style.compression);
    plan.curvature.is_some().then_some(FlatScene { bent: &style.frame, flat, compression })
}

/// Says that the slivers along the hull stay although the user wants them left out.
fn hull_warning(plan: &Plan, hull: HullCount) -> Option<String> {
    let HullCount { slivers, triangles } = hull;
    (plan.options.output.hull == Hull::Trimmed && hull.is_most()).then(|| {
        format!(
            "no slivers are left out along the hull, because most of the mesh is slivers there ({} of {} triangles); fix: [output] hull \
             = \"whole\" does the same without this warning",
            grouped(slivers),
            grouped(triangles)
        )
    })
}

/// Writes what is beside the tiles. `levels` is there if viewers get 3D Tiles.
///
/// # Errors
/// Those of the functions in [`crate::publish`].
fn publish(
    run: &WholeRun,
    job: &Job,
    bounds: Bounds<3>,
    written: &WrittenFiles,
    appearance: &TileAppearance,
    tileset: Option<TilesetContent>,
) -> Result<Published> {
    let plan = job.plan;
    let raster_work = RasterWork::of(plan, &appearance.style.frame, written.tiles)?;
    let raster = raster_work.as_ref().map(|work| write_raster(run, work)).transpose()?;
    let map_tiles = raster_work.as_ref().map(|work| write_map_tiles(run, plan, work)).transpose()?.flatten();
    drop(raster_work);
    let contours = write_contours(run, plan, &appearance.style.frame, written.tiles)?;
    let exports = write_exports(run, plan, &appearance.style.frame, written)?;
    let terrain = write_terrain(run, plan, &appearance.style.frame, &written)?;
    let classified = write_classified(run, job)?;
    let stage = run.progress.stage("publish", 1, "job");
    let output = &plan.options.output;
    let (mut warnings, mut text, mut placement, mut stats) = (Warnings::default(), None, None, LevelStats::default());
    if let Some(TilesetContent { mut root, levels }) = tileset {
        let geoid = Geoid::open(output.height_offset.as_ref())?;
        let placed = match place(&plan.crs, &appearance.style.frame, geoid, &mut root) {
            Err(NotPlaced::Height(error)) => return Err(error),
            placed => placed,
        };
        warnings.extend(placement_warning(&placed));
        warnings.extend(unused_height_offset(plan));
        if placed.is_ok() {
            warnings.extend(heights_warning(&plan.crs, output.height_offset.as_ref()));
        }
        warnings.extend(left_out_warning(plan, &levels));
        divide(&mut root);
        text = Some((&appearance.style.frame, root));
        (placement, stats) = (placed.ok(), levels);
    }
    warnings.extend(height_unit_warning(&plan.crs));
    warnings.extend(contours.and_then(|contours| contours.warning()));
    warnings.extend(drawing_warning(plan));
    warnings.extend(hull_warning(plan, written.hull));
    warnings.extend(check_photo(plan)?);
    warnings.extend(without_pixel_warning(plan, written.stats.without_pixel));
    let raster = raster.map(|raster| {
        warnings.extend(raster.warnings);
        raster.stats
    });
    let georeference = Georeference::new(
        &appearance.style.frame,
        &plan.lattice,
        written.vertices,
        &plan.unit,
        plan.crs.undisputed_code(),
    );
    let tiles = &written.stats;
    let fits = fits_one_file(tiles);
    if output.imagery.is_some() && !output.page {
        warnings.push("[output] imagery has no effect: the page shows it; fix: [output] page = true".to_string());
    } else if output.imagery.is_some() && placement.is_none() {
        warnings.push("the page shows no imagery, because the terrain is not on the globe".to_string());
    }
    let page_of_others = output.page && run.directory.has_page_of_others()?;
    if page_of_others {
        let page = run.directory.results().page();
        warnings.push(format!(
            "the page is not written: {} appeared during the job, and is not a page of gdt-batch; fix: remove it, and \
         run the job again",
            page.display()
        ));
    }
    let lines = plan.built_breaklines()?;
    let content = SideFiles {
        georeference: georeference.to_json(placement.as_ref())?,
        tileset: text,
        one_file: fits && output.format != OutputFormat::Tiles3d,
        flat: flat_scene(plan, &appearance.style, bounds),
        page: output.page && !page_of_others,
        imagery: output.imagery.as_ref(),
        copyright: output.copyright(),
        has_ramp: matches!(
            appearance.style.colors,
            VertexColors::None | VertexColors::OfPoints(Coloring::Elevation(_))
        ),
        breaklines: lines.as_deref().map(|lines| (lines, &plan.lattice)),
    };
    let write = || write_side_files(run.directory, &content, &appearance.canvas, written.tiles);
    let bytes = run.journal.step(JobStep::Publish, write)?;
    if !fits && output.format == OutputFormat::Glb {
        warnings.push(too_large_for_one_file(tiles));
    }
    stage.advance(1);
    run.add_stage(stage.finish());
    let exported: u64 = exports.files.iter().map(|file| file.bytes).sum();
    let rasters = raster.map_or(0, |raster| raster.bytes) + map_tiles.map_or(0, |tiles| tiles.bytes);
    let rasters_and_lines = rasters + contours.map_or(0, |lines| lines.bytes);
    let bytes =
        bytes + rasters_and_lines + exported + classified.bytes + terrain.as_ref().map_or(0, |tiles| tiles.bytes);
    warnings.extend(exports.warnings);
    warnings.extend(classified.warnings);
    Ok(Published {
        bytes,
        levels: stats,
        raster,
        map_tiles,
        contours,
        exports: exports.files,
        terrain,
        vertex_colors: appearance.style.colors.source(),
        warnings,
    })
}

/// The raster of a job.
struct WrittenRaster {
    stats: RasterStats,
    /// What the user should know of it.
    warnings: Vec<String>,
}

/// Writes the raster.
///
/// # Errors
/// Those of [`RasterWork`].
fn write_raster(run: &WholeRun, work: &RasterWork) -> Result<WrittenRaster> {
    let stage = run.progress.stage("raster", work.blocks(), "blocks");
    let stats = run.journal.step(JobStep::Raster, || work.write(run.directory, &|| stage.advance(1)))?;
    run.add_stage(stage.finish());
    Ok(WrittenRaster { warnings: work.warnings(run.directory, &stats)?, stats })
}

/// Writes map tiles from the raster, if the user wants some.
///
/// # Errors
/// Those of [`MapTileWork`].
fn write_map_tiles(run: &WholeRun, plan: &Plan, raster: &RasterWork) -> Result<Option<MapTileStats>> {
    let Some(work) = MapTileWork::of(plan, raster.grid())? else { return Ok(None) };
    let stage = run.progress.stage("map tiles", work.tiles(), "tiles");
    let stats = run.journal.step(JobStep::MapTiles, || work.write(run.directory, &|| stage.advance(1)))?;
    run.add_stage(stage.finish());
    Ok(Some(stats))
}

/// Writes contour lines, if the user wants some. The scene of the tiles is that of `frame`.
///
/// # Errors
/// Those of [`ContourWork`].
fn write_contours(run: &WholeRun, plan: &Plan, frame: &Frame, tiles: &dyn EachTile) -> Result<Option<ContourStats>> {
    let Some(work) = ContourWork::of(plan, frame, tiles)? else { return Ok(None) };
    let stage = run.progress.stage("contours", work.steps(), "steps");
    let stats = run.journal.step(JobStep::Contours, || work.write(run.directory, &|steps| stage.advance(steps)))?;
    run.add_stage(stage.finish());
    Ok(Some(stats))
}

/// Writes the mesh for other programs, if the user wants that. The scene of the tiles is that of `frame`.
///
/// # Errors
/// Those of [`ExportWork`].
fn write_exports(run: &WholeRun, plan: &Plan, frame: &Frame, written: &WrittenFiles) -> Result<Exports> {
    let Some(work) = ExportWork::of(plan, frame, written.tiles, &written.stats)? else { return Ok(Exports::default()) };
    let stage = run.progress.stage("export", work.reads(), "triangles read");
    let advance = |triangles| stage.advance(triangles);
    let exports = run.journal.step(JobStep::Exports, || work.write(run.directory, &advance))?;
    run.add_stage(stage.finish());
    Ok(exports)
}

/// Writes terrain tiles for globes, if the user wants some. The scene of the tiles is that of `frame`.
///
/// # Errors
/// Those of [`TerrainWork`].
fn write_terrain(run: &WholeRun, plan: &Plan, frame: &Frame, written: &WrittenFiles) -> Result<Option<TerrainStats>> {
    let Some(work) = TerrainWork::of(plan, frame, written.tiles, &written.stats)? else { return Ok(None) };
    let stage = run.progress.stage("terrain", work.steps(), "tiles");
    let stats = run.journal.step(JobStep::Terrain, || work.write(run.directory, &|steps| stage.advance(steps)))?;
    run.add_stage(stage.finish());
    Ok(Some(stats))
}

/// Writes the inputs with the classes that the job has found, if the user wants that.
///
/// # Errors
/// [`sys::Error::Io`] on files.
fn write_classified(run: &WholeRun, job: &Job) -> Result<ClassifiedInputs> {
    if !job.plan.options.output.classified {
        return Ok(ClassifiedInputs::default());
    }
    let stage = run.progress.stage("classify", job.plan.records, "points");
    let advance = |records| stage.advance(records);
    let ground = found_ground(job)?;
    let write = || write_all(job.plan, &ground, run.directory, &advance);
    let classified = run.journal.step(JobStep::Classified, write)?;
    run.add_stage(stage.finish());
    Ok(classified)
}

/// Writes the report, which completes the job.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be written.
fn write_report(
    run: &WholeRun,
    job: &Job,
    points: PointCounts,
    figures: PartFigures,
    costs: CostsOfParts,
    published: Published,
    (list, update): (PendingFile, Option<ChangeCounts>),
) -> Result<Report> {
    let of_all = figures.selected.first().and_then(|part| part.all);
    let selection = match (of_all, job.plan.options.output.max_error) {
        (Some(selected), MaxError::Units(bound)) => Some(SelectionReport::new(job.plan, bound, &selected)),
        _ => None,
    };
    let finds_ground = job.plan.options.input.finds_ground();
    let parts = ReportParts {
        selection,
        ground: finds_ground.then(|| figures.selected.iter().map(|part| part.wanted).sum()),
        duplicates: figures.selected.iter().map(|part| part.duplicates).sum(),
        parts: job.parts.all().len() as u64,
        slowest_part: costs.slowest,
        peak_memory: costs.peak_memory,
        wall_s: run.wall_s(),
        cpu_s_of_tasks: costs.cpu_s,
        points,
        leaves: figures.leaves,
        gpu: run.triangulator.gpu().map(str::to_owned),
        gpu_figures: run.triangulator.gpu_figures(),
        gpu_steps: run.triangulator.gpu_steps(),
        tiles: figures.tiles,
        levels: published.levels,
        raster: published.raster,
        pmtiles: published.map_tiles,
        contours: published.contours,
        exports: published.exports,
        terrain: published.terrain,
        vertex_colors: published.vertex_colors,
        update,
        warnings: published.warnings,
        other_bytes: published.bytes + list.bytes,
        temporary: figures.temporary,
        stages: std::mem::take(&mut *run.stages()),
        threads: run.threads,
        memory: job.plan.options.limits.memory.0,
        resumed: run.resumed,
        clock: run.clock,
        identity: run.identity.clone(),
        file_list: list.checksum,
    };
    let (report, text) = Report::new(job.plan, parts).sealed()?;
    // The report comes last: it says that all results are there.
    run.journal.step(JobStep::Report, || {
        let report = write_pending(&run.directory.output().report(), &text)?;
        Ok::<_, Error>(((), vec![list, report]))
    })?;
    Ok(report)
}

/// Returns the names and checksums of all results so far, in the order of their names.
fn list_of_files(run: &WholeRun) -> Result<Vec<(String, Checksum)>> {
    let directory = run.directory;
    let of_parts = PartJournals::of(directory, run.job_id)?;
    Ok(listed(directory, run.journal.files().into_iter().chain(of_parts.files().cloned()).collect()))
}
