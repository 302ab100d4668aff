//! Whether the raster that the user wants can be written, before the job begins: a resolution that is too fine is found before the
//! night, not after it.

use crate::geometry::Bounds;
use crate::job::plan::job_plan::Plan;
use crate::output::raster::grid::RasterGrid;
use crate::output::raster::options::RasterOptions;
use crate::{Error, Result};

/// Returns the cells of the raster over the lattice box `bounds`.
///
/// # Errors
/// [`Error::Config`] if they are too many, or the resolution does not meet the lattice.
pub(crate) fn grid_over(plan: &Plan, options: &RasterOptions, bounds: Bounds<2>) -> Result<RasterGrid> {
    let resolution = options.resolution;
    RasterGrid::new(&plan.lattice, resolution.exact(), bounds)
        .map_err(|what| Error::Config(format!("[output.raster] resolution = {} {what}", resolution.number())))
}

/// Checks that `[output.raster]` asks for a raster that one file can hold, as far as the headers of the inputs tell. Returns its cells.
///
/// # Errors
/// [`Error::Config`] if it does not.
pub fn check_raster(plan: &Plan) -> Result<Option<RasterGrid>> {
    let Some(options) = &plan.options.output.raster else { return Ok(None) };
    grid_over(plan, options, plan.extent).map(Some)
}
