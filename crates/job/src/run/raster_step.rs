//! Running the step that writes the raster.

use crate::plan::job_plan::Plan;
use crate::publish::raster::write_raster::{RasterStats, RasterWork};
use crate::publish::side_files::EachTile;
use crate::records::JobStep;
use crate::run::run_context::RunContext;
use sys::Result;
use tiles::frame::Frame;

/// The raster of a job.
pub(crate) struct WrittenRaster {
    pub(crate) stats: RasterStats,
    /// What the user should know of it.
    pub(crate) warnings: Vec<String>,
}

/// Writes the raster, if the user wants one. The scene of the tiles is that of `frame`.
///
/// # Errors
/// Those of [`RasterWork`].
pub(crate) fn write_raster(
    run: &RunContext,
    plan: &Plan,
    frame: &Frame,
    tiles: &dyn EachTile,
) -> Result<Option<WrittenRaster>> {
    let Some(work) = RasterWork::of(plan, frame, tiles)? else { return Ok(None) };
    // It is made from the tiles, which must have their names.
    run.journal.commit()?;
    let stage = run.progress.stage("raster", work.blocks(), "blocks");
    let stats = run.journal.step(JobStep::Raster, || work.write(run.directory, &|| stage.advance(1)))?;
    run.add_stage(stage.finish());
    Ok(Some(WrittenRaster { warnings: work.warnings(run.directory, &stats)?, stats }))
}
