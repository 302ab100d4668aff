//! Whether terrain tiles can be written, before the job begins.

use crate::plan::globe_system::globe_system;
use crate::plan::job_plan::Plan;
use crate::plan::terrain_crowd::scheme_of;
use crate::publish::terrain_tiles::globe_grid::Place;
use crate::publish::terrain_tiles::limits::{MOST_LONGITUDES, beyond_latitudes, beyond_longitudes, refused};
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use sys::{Error, Result};
use tiles::tiles3d::globe::Globe;

/// Returns the way of the job to the globe.
///
/// # Errors
/// [`Error::Config`] if there is none, [`Error::Io`] or [`Error::Config`] on the geoid.
pub(crate) fn globe_of(plan: &Plan) -> Result<Globe> {
    let metres = plan.frame.extras().metres_per_unit;
    let system = globe_system(&plan.crs, metres).map_err(|why| {
        Error::Config(format!(
            "[output.terrain] needs the place of the terrain on the globe: {why}; fix: [input] crs = \"EPSG:...\" if you know the system, or \
             leave [output.terrain] out"
        ))
    })?;
    Ok(Globe::new(system, metres, Geoid::open(plan.options.output.height_offset.as_ref())?))
}

/// Checks that terrain tiles can be written, as far as headers tell, if the user wants some.
///
/// # Errors
/// [`Error::Config`] if they cannot.
pub(crate) fn check_terrain(plan: &Plan) -> Result<()> {
    let Some(scheme) = scheme_of(&plan.options) else { return Ok(()) };
    let globe = globe_of(plan)?;
    let middle = Place::of(plan, &globe, plan.extent.middle()).map_err(|why| refused(&why))?;
    // A sample of the points shows some of both, and the boxes of the inputs the rest.
    let [latitude, longitudes] = plan.terrain_crowd.map_or([0.0; 2], |crowd| [crowd.latitude, crowd.longitudes]);
    let highest = latitude.max(claimed(plan, &globe, |place| place.latitude.abs().to_degrees()));
    if highest > scheme.most_latitude() {
        return Err(beyond_latitudes(scheme, highest));
    }
    let widest = longitudes.max(claimed(plan, &globe, |place| place.span_around(&middle)));
    if widest > MOST_LONGITUDES { Err(beyond_longitudes(Some(widest))) } else { Ok(()) }
}

/// Returns the greatest value of `measure` that a point has for sure by the boxes of the inputs: each has a point on each side.
fn claimed(plan: &Plan, globe: &Globe, measure: impl Fn(Place) -> f64) -> f64 {
    const PARTS: i64 = 32;
    // Bounds and areas cut boxes, and points may lie anywhere behind the cut. A box that is transformed may be far too large.
    let input = &plan.options.input;
    if input.rectangle().is_some() || input.to_crs.is_some() || plan.clip.is_some() {
        return 0.0;
    }
    let of_side = |side: Bounds<2>| {
        let places = grid_over(side, PARTS).map(|place| Place::of(plan, globe, place));
        places.map(|place| place.map_or(0.0, &measure)).fold(f64::MAX, f64::min)
    };
    plan.inputs.iter().flat_map(|input| sides(input.claimed)).map(of_side).fold(0.0, f64::max)
}

/// Returns the sides of a box, as boxes.
fn sides(bounds: Bounds<2>) -> impl Iterator<Item = Bounds<2>> {
    (0..2).flat_map(move |axis| {
        let mut ends = [bounds; 2];
        ends[0].max[axis] = bounds.min[axis];
        ends[1].min[axis] = bounds.max[axis];
        ends
    })
}

/// Returns places at equal distances in a box, so many times as far apart as its sides are long.
fn grid_over(bounds: Bounds<2>, parts: i64) -> impl Iterator<Item = [i32; 2]> {
    let along = move |axis: usize, part: i64| (i64::from(bounds.min[axis]) + bounds.extent(axis) * part / parts) as i32;
    (0..=parts).flat_map(move |i| (0..=parts).map(move |j| [along(0, i), along(1, j)]))
}
