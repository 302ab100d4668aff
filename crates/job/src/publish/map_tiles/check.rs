//! Whether the map tiles that the user wants can be written, before the job begins.

use crate::plan::job_plan::Plan;
use crate::publish::map_tiles::web_map::WebMap;
use crate::publish::raster::check::planned_raster;
use sys::{Error, Result};
use tiles::map_tiles::encoding::HeightEncoding;
use tiles::raster::grid::RasterGrid;
use tiles::raster::products::RasterProduct;

/// The most cells of a raster with map tiles: those of one file.
const MOST_CELLS: u64 = 1 << 38;

/// Returns how the raster `grid` lies on a web map.
///
/// # Errors
/// [`Error::Config`] if it does not.
pub(crate) fn map_of(plan: &Plan, grid: &RasterGrid) -> Result<WebMap> {
    let cannot = |why: String| Error::Config(format!("[output.raster] pmtiles cannot be written: {why}"));
    if grid.cells() > MOST_CELLS {
        return Err(cannot("the raster has more than 2^38 cells; fix: a greater resolution".into()));
    }
    WebMap::of(&plan.crs, plan.frame.extras().metres_per_unit, grid).map_err(cannot)
}

/// Checks that `[output.raster] pmtiles` asks for what can be written, as far as the headers of the inputs tell.
///
/// # Errors
/// [`Error::Config`] if it does not.
pub(crate) fn check_map_tiles(plan: &Plan) -> Result<()> {
    let Some(options) = plan.options.output.raster.filter(|options| options.pmtiles.is_some()) else { return Ok(()) };
    if options.products.iter().all(|product| product != RasterProduct::Height) {
        return Err(Error::Config(
            "[output.raster] pmtiles is made from terrain.tif, and products leaves it out: add \"height\" to products"
                .into(),
        ));
    }
    planned_raster(plan).map_or(Ok(()), |grid| map_of(plan, &grid).map(|_| ()))
}

/// Returns the encoding of the map tiles that the user wants, and the number of their pixels, as far as the headers tell.
pub(crate) fn planned_map_tiles(plan: &Plan) -> Option<(HeightEncoding, u64)> {
    let encoding = plan.options.output.raster?.pmtiles?;
    let map = map_of(plan, &planned_raster(plan)?).ok()?;
    Some((encoding, map.pixels()))
}
