//! What a raster says of the job's coordinate reference system.

use crate::plan::job_plan::Plan;
use crs::Crs;
use tiles::raster::geokeys::RasterSystem;

/// Returns what the raster of a job says of its system.
pub(crate) fn system_of(plan: &Plan) -> RasterSystem {
    let (crs, extras) = (&plan.crs, plan.frame.extras());
    let heights = crs.vertical_system.as_ref();
    let metres_z = extras.metres_per_unit_z;
    RasterSystem {
        vertical_code: heights.and_then(|system| system.system_code(metres_z)).and_then(short),
        vertical_name: crs.vertical_name(),
        vertical_metres: (heights.is_some() || crs.vertical.is_some()).then_some(metres_z),
        ..RasterSystem::of_plane(crs, extras.metres_per_unit)
    }
}

fn short(code: u32) -> Option<u16> {
    u16::try_from(code).ok()
}

/// Returns a warning if the inputs name a system that the raster cannot name.
pub(crate) fn system_warning(crs: &Crs, system: &RasterSystem) -> Option<String> {
    (crs.is_named() && !system.is_placed()).then(|| {
        format!(
            "terrain.tif has no CRS: {} has no EPSG code, and its WKT is missing or too long for the file; fix: set the CRS where you \
             open the file",
            crs.label()
        )
    })
}
