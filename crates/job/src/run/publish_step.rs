//! Running step 8 and writing the report.

use crate::durable::atomic_file::{PendingFile, write_pending};
use crate::durable::journal::PublishedFile;
use crate::levels::make_level::LevelStats;
use crate::merge_records::HullCount;
use crate::mesh::leaf::LeafStats;
use crate::plan::job_plan::Plan;
use crate::plan::no_points::no_triangle;
use crate::progress::number_text::grouped;
use crate::publish::flat_tile::FlatScene;
use crate::publish::one_file_limits::{fits_one_file, too_large_for_one_file};
use crate::publish::placement::{heights_warning, place, placement_warning};
use crate::publish::raster::write_raster::RasterStats;
use crate::publish::side_files::{EachTile, SideFiles, write_side_files};
use crate::records::{JobStep, StepOutput};
use crate::report::job_report::{Report, ReportParts, SlowestPart};
use crate::run::levels_step::left_out_warning;
use crate::run::raster_step::write_raster;
use crate::run::run_context::RunContext;
use crate::run::tile_queue::TileAppearance;
use crate::tiles::style::TileStyle;
use crate::tiles::write_tile::TileStats;
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use points::PointCounts;
use std::path::Path;
use sys::threads::run_concurrently;
use sys::{Error, Result, Warnings};
use tiles::checksums::list_text;
use tiles::color::Coloring;
use tiles::options::{Hull, OutputFormat};
use tiles::tiles3d::division::divide;
use tiles::tiles3d::georeference::Georeference;
use tiles::tiles3d::globe::NotPlaced;
use tiles::tiles3d::tileset::TilesetNode;

/// Tells whether viewers get 3D Tiles: where the user wants them, or where one file would be too large.
pub(crate) fn wants_tileset(plan: &Plan, written: &TileStats) -> bool {
    plan.options.output.format != OutputFormat::Glb || !fits_one_file(written)
}

/// The tiles that are written.
pub(crate) struct WrittenFiles<'a> {
    pub(crate) stats: TileStats,
    /// How many slivers along the hull the whole mesh has.
    pub(crate) hull: HullCount,
    pub(crate) tiles: &'a dyn EachTile,
}

/// What viewers of 3D Tiles get.
pub(crate) struct TilesetContent {
    pub(crate) root: TilesetNode,
    pub(crate) levels: LevelStats,
}

impl TilesetContent {
    /// Returns the content with this root.
    ///
    /// # Errors
    /// [`Error::Broken`] if there is none.
    pub(crate) fn new(root: Option<TilesetNode>, levels: LevelStats) -> Result<TilesetContent> {
        let root = root.ok_or_else(|| Error::Broken("there is no tile to list in tileset.json".into()))?;
        Ok(TilesetContent { root, levels })
    }
}

/// What the report says of the mesh.
pub(crate) struct MeshFigures {
    pub(crate) points: PointCounts,
    pub(crate) leaves: LeafStats,
    pub(crate) tiles: TileStats,
    /// Bytes of temporary files.
    pub(crate) temporary: u64,
    /// Results that the journals of parts name.
    pub(crate) files: Vec<PublishedFile>,
    /// The number of parts.
    pub(crate) parts: u64,
    pub(crate) slowest_part: Option<SlowestPart>,
    /// The largest resident set of the processes that did other phases, in bytes.
    pub(crate) peak_memory: Option<u64>,
    /// Seconds of processor time of the tasks that did other phases.
    pub(crate) cpu_s_of_tasks: f64,
}

/// Checks that there is a terrain to look at.
pub(crate) fn some_triangles(written: &TileStats, plan: &Plan) -> crate::Result<()> {
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
        return Err(Error::Config(format!(
            "[output] max_edge leaves out all {by_length} triangles{slivers}: give a greater one"
        ))
        .into());
    }
    Err(no_triangle(plan))
}

/// What step 8 gives back.
pub(crate) struct Published {
    /// Bytes of the results besides the tiles.
    pub(crate) bytes: u64,
    pub(crate) levels: LevelStats,
    pub(crate) raster: Option<RasterStats>,
    pub(crate) warnings: Warnings,
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
            "nothing is left out along the hull: {} of {} triangles are slivers there; the points lie along a curve, or are few; \
             [output] hull = \"whole\" says the same without this warning",
            grouped(slivers),
            grouped(triangles)
        )
    })
}

/// Writes what is beside the tiles. `levels` is there if viewers get 3D Tiles.
///
/// # Errors
/// Those of the functions in [`crate::publish`].
pub(crate) fn publish(
    run: &RunContext,
    plan: &Plan,
    bounds: Bounds<3>,
    written: &WrittenFiles,
    appearance: &TileAppearance,
    tileset: Option<TilesetContent>,
) -> Result<Published> {
    let raster = write_raster(run, plan, &appearance.style.frame, written.tiles)?;
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
        if placed.is_ok() {
            warnings.extend(heights_warning(&plan.crs, output.height_offset.as_ref()));
        }
        warnings.extend(left_out_warning(plan, &levels));
        divide(&mut root);
        text = Some((&appearance.style.frame, root));
        (placement, stats) = (placed.ok(), levels);
    }
    warnings.extend(hull_warning(plan, written.hull));
    let raster = raster.map(|raster| {
        warnings.extend(raster.warnings);
        raster.stats
    });
    let georeference =
        Georeference::new(&appearance.style.frame, &plan.lattice, bounds, &plan.unit, plan.crs.undisputed_code());
    let tiles = &written.stats;
    let fits = fits_one_file(tiles);
    let page_of_others = output.page && run.directory.has_page_of_others()?;
    if page_of_others {
        let page = run.directory.results().page();
        warnings.push(format!("the page is not written: {} came during the job, and no job wrote it", page.display()));
    }
    let lines = plan.built_breaklines()?;
    let content = SideFiles {
        georeference: georeference.to_json(placement.as_ref())?,
        tileset: text,
        one_file: fits && output.format != OutputFormat::Tiles3d,
        flat: flat_scene(plan, &appearance.style, bounds),
        page: output.page && !page_of_others,
        copyright: output.copyright(),
        has_ramp: matches!(appearance.style.coloring, None | Some(Coloring::Elevation(_))),
        breaklines: lines.as_deref().map(|lines| (lines, &plan.lattice)),
    };
    if content.one_file {
        // terrain.glb is made from the tiles, which must have their names.
        run.journal.commit()?;
    }
    let write = || write_side_files(run.directory, &content, &appearance.canvas, written.tiles);
    // The tiles reach the disk meanwhile, before the report says how long that took.
    let bytes = run_concurrently(|| run.journal.commit(), || run.journal.step(JobStep::Publish, write))?;
    if !fits && output.format == OutputFormat::Glb {
        warnings.push(too_large_for_one_file(tiles));
    }
    stage.advance(1);
    run.add_stage(stage.finish());
    let bytes = bytes + raster.map_or(0, |raster| raster.bytes);
    Ok(Published { bytes, levels: stats, raster, warnings })
}

/// Writes the report, which completes the job.
///
/// # Errors
/// [`sys::Error::Io`] if it cannot be written.
pub(crate) fn write_report(run: &RunContext, plan: &Plan, mesh: MeshFigures, published: Published) -> Result<Report> {
    let MeshFigures { points, leaves, tiles, temporary, files, parts, slowest_part, peak_memory, cpu_s_of_tasks } =
        mesh;
    let list = write_file_list(run, files)?;
    let parts = ReportParts {
        parts,
        slowest_part,
        peak_memory,
        wall_s: run.wall_s(),
        cpu_s_of_tasks,
        points,
        leaves,
        gpu: run.triangulator.gpu().map(str::to_owned),
        gpu_figures: run.triangulator.gpu_figures(),
        gpu_steps: run.triangulator.gpu_steps(),
        tiles,
        levels: published.levels,
        raster: published.raster,
        warnings: published.warnings,
        other_bytes: published.bytes + list.bytes,
        temporary,
        stages: std::mem::take(&mut *run.stages()),
        threads: run.threads,
        memory: plan.options.limits.memory.0,
        resumed: run.resumed,
        clock: run.clock,
        identity: run.identity.clone(),
        file_list: list.checksum,
    };
    let (report, text) = Report::new(plan, parts).sealed()?;
    // The report comes last: it says that all results are there.
    let files = vec![list, write_pending(&run.directory.output().report(), &text)?];
    run.journal.record(JobStep::Report, StepOutput { files, ..StepOutput::new((), Vec::new()) })?;
    run.journal.commit()?;
    Ok(report)
}

/// Writes the list of all results so far. Their checksums are in the job's journal, and those of parts are `others`.
fn write_file_list(run: &RunContext, others: Vec<PublishedFile>) -> Result<PendingFile> {
    let (directory, output) = (run.directory, run.directory.output());
    let own = [output.checksums(), output.report()].map(|path| directory.name(&path));
    let mut files: Vec<PublishedFile> = run.journal.files().into_iter().chain(others).collect();
    files.retain(|file| directory.is_result(&file.name) && !own.contains(&file.name));
    files.sort_by(|a, b| a.name.cmp(&b.name));
    let files: Vec<_> = files.into_iter().map(|file| (slashed(&file.name), file.checksum)).collect();
    write_pending(&output.checksums(), list_text(&files).as_bytes())
}

/// Returns a path with slashes on every system.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}
