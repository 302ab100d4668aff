//! Whether the scene of a job follows the curve of the earth, and how.

use crate::plan::globe_system::globe_system;
use crate::plan::job_plan::Plan;
use crate::tiles::style::{bent_frame, packing};
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use tiles::compression::{Compression, CompressionChoice};
use tiles::curvature::Curvature;
use tiles::options::{OutputFormat, OutputOptions};
use tiles::tiles3d::curve_fit::{Bent, fit_curvature};
use tiles::tiles3d::globe::{GlobeSystem, NotPlaced};
use tiles::tiles3d::ground::Ground;

/// The greatest distortion in metres with which one transform places all tiles of a scene that is not bent. Datums that differ from the
/// globe's by as much are accepted too.
pub(crate) const ONE_TRANSFORM: f64 = 1.0;

/// The same for a scene that is bent upwards alone. All that is left is sideways: at the ends of 24 km in the Alps, or at the edge of a UTM
/// zone, some metres. With one transform tiles meet exactly, which is worth more than these.
pub(crate) const ONE_TRANSFORM_SIDEWAYS: f64 = 5.0;

/// Returns the projected system of a scene that may be bent.
fn bendable(plan: &Plan) -> Option<GlobeSystem> {
    let system = globe_system(&plan.crs, plan.frame.extras().metres_per_unit).ok();
    system.filter(|_| plan.options.output.format != OutputFormat::Glb)
}

/// Returns the curvature of the scene of a job whose points are within `bounds`. `None` if the scene is a plane: the terrain is small,
/// nothing says where on the globe it lies, or the user wants one file, whose viewers know no globe.
///
/// # Errors
/// [`sys::Error::Config`] if the geoid has no height anywhere, or its file is damaged; [`sys::Error::Io`] if it cannot be read.
pub(crate) fn curvature_of(plan: &Plan, bounds: Bounds<3>) -> sys::Result<Option<Curvature>> {
    let Some(system) = bendable(plan) else { return Ok(None) };
    let (output, extras) = (&plan.options.output, plan.frame.extras());
    let geoid = Geoid::open(output.height_offset.as_ref())?;
    let ground = Ground::new(extras, system, geoid);
    let distortion = || ground.distortion(&ground.tangent(ground.seen_from(bounds)?)?, bounds);
    let found = distortion()
        .and_then(|distortion| (distortion > ONE_TRANSFORM).then(|| bent_for(&ground, bounds, output)).transpose());
    match found {
        // The step that publishes says why a terrain has no place on the globe.
        Err(NotPlaced::System(_)) => Ok(None),
        Err(NotPlaced::Height(error)) => Err(error),
        Ok(curvature) => Ok(curvature.filter(|curvature| {
            // Half a continent, or a map such as Mercator's that is nowhere to scale, stays flat, with a transform for each tile.
            let packing = packing(output, Some(curvature));
            bent_frame(plan, curvature.clone(), bounds).can_be_bent(&plan.frame, bounds, packing)
        })),
    }
}

/// Returns the curvature that suits tiles with these options. Packed with meshopt, they may be bent along all axes. Programs that read other
/// tiles take x and y as they are, so those are bent upwards alone; but without a wish of the user only as far as one transform places
/// them, because tiles that do not meet are worse.
fn bent_for(ground: &Ground, bounds: Bounds<3>, output: &OutputOptions) -> Result<Curvature, NotPlaced> {
    let is_packed = output.packing() == Compression::Meshopt;
    if is_packed || output.compression == CompressionChoice::Auto {
        let all = fit_curvature(ground, bounds, Bent::All)?;
        let [x, y, _] = all.greatest();
        // A tenth covers what lies between the places that were looked at.
        if is_packed || 1.1 * libm::hypot(x, y) > ONE_TRANSFORM_SIDEWAYS {
            return Ok(all);
        }
    }
    fit_curvature(ground, bounds, Bent::Up)
}
