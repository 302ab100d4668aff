//! Whether the raster that the user wants can be written, before the job begins: a resolution that is too fine is found before the
//! night, not after it.

use crate::plan::job_plan::Plan;
use delaunay::geometry::Bounds;
use rust_decimal::Decimal;
use sys::{Error, Result};
use tiles::raster::grid::{CellAlignment, CellLimit, RasterGrid};
use tiles::raster::options::{CellOrigin, RasterOptions};

/// Returns the cells of the raster over the lattice box `bounds`.
///
/// # Errors
/// [`Error::Config`] if they are too many, or the resolution does not meet the lattice.
pub(crate) fn grid_over(plan: &Plan, options: &RasterOptions, bounds: Bounds<2>) -> Result<RasterGrid> {
    let limit = options.cells_per_file.map_or(CellLimit::OneFile, |side| CellLimit::Files(side.cells()));
    let origin = options.origin.map_or_else(String::new, |origin| format!(" with origin = {:?}", origin.numbers()));
    let corner = options.origin.map_or([Decimal::ZERO; 2], CellOrigin::exact);
    let alignment = CellAlignment { origin: corner, resolution: options.resolution.exact() };
    RasterGrid::new(&plan.lattice, alignment, bounds, limit).map_err(|what| {
        Error::Config(format!("[output.raster] resolution = {}{origin} {what}", options.resolution.number()))
    })
}

/// Checks that `[output.raster]` asks for a raster that can be written, as far as the headers of the inputs tell. Returns its cells.
///
/// # Errors
/// [`Error::Config`] if it does not.
pub(crate) fn check_raster(plan: &Plan) -> Result<Option<RasterGrid>> {
    let Some(options) = &plan.options.output.raster else { return Ok(None) };
    match (grid_over(plan, options, plan.extent), &plan.stretch) {
        (Err(Error::Config(what)), Some(stretch)) => Err(Error::Config(format!("{what}; {stretch}"))),
        (grid, _) => grid.map(Some),
    }
}

/// Returns the cells of the raster of a job that [`check_raster`] has let pass, as far as the headers tell.
pub(crate) fn planned_raster(plan: &Plan) -> Option<RasterGrid> {
    check_raster(plan).ok().flatten()
}
