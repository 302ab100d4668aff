//! Running step 8 and writing the report.

use crate::geometry::Bounds;
use crate::job::durable::atomic_file::{PendingFile, write_pending};
use crate::job::levels::make_level::LevelStats;
use crate::job::mesh::leaf::LeafStats;
use crate::job::partition::result::Partition;
use crate::job::plan::job_plan::Plan;
use crate::job::publish::one_file_limits::{fits_one_file, too_large_for_one_file};
use crate::job::publish::placement::{place, placement_warning};
use crate::job::publish::side_files::{SideFiles, write_side_files};
use crate::job::publish::tileset_tree::{tileset_root, tileset_text};
use crate::job::records::{JobStep, StepOutput};
use crate::job::report::job_report::{Report, ReportParts};
use crate::job::run::levels_step::LevelResult;
use crate::job::run::run_context::RunContext;
use crate::job::run::tile_queue::WrittenTiles;
use crate::job::tiles::write_tile::TileStats;
use crate::output::checksums::list_text;
use crate::output::options::OutputFormat;
use crate::output::tiles3d::georeference::Georeference;
use crate::threads::run_concurrently;
use crate::{Result, Warnings};
use std::path::Path;

/// Tells whether viewers get 3D Tiles: where the user wants them, or where one file would be too large.
pub(crate) fn wants_tileset(plan: &Plan, written: &TileStats) -> bool {
    plan.options.output.format != OutputFormat::Glb || !fits_one_file(written)
}

/// What step 8 gives back.
pub(crate) struct Published {
    /// Bytes of the results besides the tiles.
    pub(crate) bytes: u64,
    pub(crate) levels: LevelStats,
    pub(crate) warnings: Warnings,
}

/// Writes what is beside the tiles. `levels` is there if viewers get 3D Tiles.
///
/// # Errors
/// Those of the functions in [`crate::job::publish`].
pub(crate) fn publish(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    bounds: Bounds<3>,
    tiles: &WrittenTiles,
    levels: Option<LevelResult>,
) -> Result<Published> {
    let stage = run.progress.stage("publish", 1, "job");
    let output = &plan.options.output;
    let (mut warnings, mut tileset, mut placement, mut stats) =
        (Warnings::default(), None, None, LevelStats::default());
    if let Some(levels) = levels {
        let mut root = tileset_root(run.store, &partition.tree, &levels.hierarchy)?;
        let placed = place(&plan.crs, &tiles.style.frame, output.height_offset, &mut root);
        warnings.extend(placement_warning(&placed));
        warnings.extend(levels.warning);
        tileset = Some(tileset_text(&tiles.style.frame, &root));
        (placement, stats) = (placed.ok(), levels.stats);
    }
    let georeference = Georeference::new(&plan.frame, &plan.lattice, bounds, &plan.unit, plan.crs.epsg);
    let fits = fits_one_file(&tiles.stats);
    let content = SideFiles {
        georeference: georeference.to_json(placement.as_ref())?,
        tileset,
        one_file: fits && output.format != OutputFormat::Tiles3d,
    };
    if content.one_file {
        // terrain.glb is made from the tiles, which must have their names.
        run.journal.commit()?;
    }
    let count = partition.tree.leaves.len();
    let write = || write_side_files(run.directory, run.store, &content, &tiles.canvas, count);
    // The tiles reach the disk meanwhile, before the report says how long that took.
    let bytes = run_concurrently(|| run.journal.commit(), || run.journal.step(JobStep::Publish, write))?;
    if !fits && output.format == OutputFormat::Glb {
        warnings.push(too_large_for_one_file(&tiles.stats));
    }
    stage.advance(1);
    run.add_stage(stage.finish());
    Ok(Published { bytes, levels: stats, warnings })
}

/// Writes the report, which completes the job.
///
/// # Errors
/// [`crate::Error::Io`] if it cannot be written.
pub(crate) fn write_report(
    run: &RunContext,
    plan: &Plan,
    partition: &Partition,
    leaves: LeafStats,
    tiles: TileStats,
    published: Published,
) -> Result<Report> {
    let list = write_file_list(run)?;
    let parts = ReportParts {
        points: partition.summary.counts.clone(),
        leaves,
        gpu: run.triangulator.gpu().map(str::to_owned),
        gpu_steps: run.triangulator.gpu_steps(),
        tiles,
        levels: published.levels,
        warnings: published.warnings,
        other_bytes: published.bytes + list.bytes,
        temporary: run.temporary.measure(partition, run.store),
        stages: std::mem::take(&mut *run.stages()),
        threads: run.threads,
        memory: plan.options.limits.memory.0,
        resumed: run.journal.taken_over(),
        clock: run.clock,
        inputs_fingerprint: run.inputs_fingerprint.clone(),
        file_list: list.checksum,
    };
    let (report, text) = Report::new(plan, parts).sealed()?;
    // The report comes last: it says that all results are there.
    let files = vec![list, write_pending(&run.directory.output().report(), &text)?];
    run.journal.record(JobStep::Report, StepOutput { files, ..StepOutput::new((), Vec::new()) })?;
    run.journal.commit()?;
    Ok(report)
}

/// Writes the list of all results so far. Their checksums are in the journal.
fn write_file_list(run: &RunContext) -> Result<PendingFile> {
    let (directory, output) = (run.directory, run.directory.output());
    let own = [output.checksums(), output.report()].map(|path| directory.name(&path));
    let files = run.journal.files().into_iter();
    let files = files.filter(|file| directory.is_result(&file.name) && !own.contains(&file.name));
    let files: Vec<_> = files.map(|file| (slashed(&file.name), file.checksum)).collect();
    write_pending(&output.checksums(), list_text(&files).as_bytes())
}

/// Returns a path with slashes on every system.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}
