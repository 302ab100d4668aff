//! Whether terrain tiles can be written, before the job begins.

use crate::plan::globe_system::globe_system;
use crate::plan::job_plan::Plan;
use crate::publish::terrain_tiles::globe_grid::Place;
use crate::publish::terrain_tiles::limits::{beyond_latitudes, refused, scheme_of};
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use quantized_mesh::Scheme;
use sys::{Error, Result};
use tiles::tiles3d::globe::Globe;

/// The widest terrain in degrees of longitude.
const MOST_LONGITUDES: f64 = 90.0;

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
    let Some(scheme) = scheme_of(plan) else { return Ok(()) };
    let globe = globe_of(plan)?;
    // What headers claim may be far more than where points are, such as all of the globe. When they have been read, all of it is checked.
    let middle = Place::of(plan, &globe, plan.extent.middle()).map_err(|why| refused(&why))?;
    let places = corners(plan.extent).into_iter().filter_map(|corner| Place::of(plan, &globe, corner).ok());
    let lowest = places.map(|place| place.latitude.abs()).fold(middle.latitude.abs(), f64::min).to_degrees();
    if lowest > scheme.most_latitude() { Err(beyond_latitudes(scheme, lowest)) } else { Ok(()) }
}

/// Returns the corners of a box.
fn corners(Bounds { min, max }: Bounds<2>) -> [[i32; 2]; 4] {
    [min, [max[0], min[1]], [min[0], max[1]], max]
}

/// Checks that a terrain within `bounds` is neither too near to a pole nor around the globe.
///
/// # Errors
/// [`Error::Config`] if it is.
pub(crate) fn check_places(plan: &Plan, globe: &Globe, scheme: Scheme, bounds: Bounds<2>) -> Result<()> {
    const PARTS: i64 = 4;
    let along = |axis: usize, part: i64| (i64::from(bounds.min[axis]) + bounds.extent(axis) * part / PARTS) as i32;
    let places = (0..=PARTS).flat_map(|i| (0..=PARTS).map(move |j| [along(0, i), along(1, j)]));
    let middle = Place::of(plan, globe, bounds.middle()).map_err(|why| refused(&why))?;
    let (mut highest, mut widest) = (0.0f64, 0.0f64);
    for place in places {
        // Corners of the box may lie outside the range of a projection in which all points are.
        let Ok(place) = Place::of(plan, globe, place) else { continue };
        highest = highest.max(place.latitude.to_degrees().abs());
        widest = widest.max(2.0 * (place.beside(middle.longitude).longitude - middle.longitude).to_degrees().abs());
    }
    if highest > scheme.most_latitude() {
        return Err(beyond_latitudes(scheme, highest));
    }
    if widest > MOST_LONGITUDES {
        return Err(refused(&format!(
            "the terrain spans about {widest:.0} degrees of longitude; {MOST_LONGITUDES} degrees is the limit"
        )));
    }
    Ok(())
}
