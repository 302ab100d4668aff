//! Whether it is known what to add to heights, before the job begins: a grid of another country is found before the night, not after it.

use crate::plan::globe_system::globe_system;
use crate::plan::job_plan::Plan;
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use sys::Result;
use tiles::options::OutputFormat;
use tiles::tiles3d::globe::NotPlaced;
use tiles::tiles3d::ground::Ground;

/// Checks that `[output] height_offset` names something that can be read, and that has a height somewhere in the area of the job.
///
/// # Errors
/// [`sys::Error::Config`] if it does not; [`sys::Error::Io`] if a grid cannot be read.
pub(crate) fn check_height_offset(plan: &Plan) -> Result<()> {
    let Some(offset) = &plan.options.output.height_offset else { return Ok(()) };
    let geoid = Geoid::open(Some(offset))?;
    if offset.grid().is_none() {
        return Ok(());
    }
    // That the terrain is not placed at all is a warning, when it is written.
    let extras = plan.frame.extras();
    let Ok(system) = globe_system(&plan.crs, extras.metres_per_unit) else { return Ok(()) };
    let Bounds { min: [west, south], max: [east, north] } = plan.extent;
    let area = Bounds { min: [west, south, 0], max: [east, north, 0] };
    // A grid may lack heights at sea, so one place is enough.
    match Ground::new(extras, system, geoid).seen_from(area) {
        Err(NotPlaced::Height(error)) => Err(error),
        _ => Ok(()),
    }
}

/// Returns a warning about an offset that changes nothing, because the terrain is not placed on the globe.
pub(crate) fn unused_height_offset(plan: &Plan) -> Option<String> {
    let output = &plan.options.output;
    let is_wanted = output.height_offset.is_some() && output.format != OutputFormat::Glb;
    let why = is_wanted.then(|| globe_system(&plan.crs, plan.frame.extras().metres_per_unit).err()).flatten()?;
    Some(format!(
        "[output] height_offset has no effect, because the terrain is not placed on the globe: {why}; fix: set [input] crs = \
         \"EPSG:...\", or leave [output] height_offset out"
    ))
}
