//! Whether the scene of a job follows the curve of the earth, and how.

use crate::geometry::Bounds;
use crate::job::plan::globe_definition::globe_definition;
use crate::job::plan::job_plan::Plan;
use crate::output::curvature::Curvature;
use crate::output::options::OutputFormat;
use crate::output::tiles3d::curve_fit::fit_curvature;
use crate::output::tiles3d::ground::Ground;

/// A plane that is off the curved earth by at most this many metres is as good as it. Datums that differ from the globe's by as much are
/// accepted too.
pub const ONE_PLANE: f64 = 1.0;

/// Returns the curvature of the scene of a job whose points are within `bounds`. `None` if the scene is a plane: the terrain is small,
/// nothing says where on the globe it lies, or the user wants one file, whose viewers know no globe.
pub fn curvature_of(plan: &Plan, bounds: Bounds<3>) -> Option<Curvature> {
    let output = &plan.options.output;
    if output.format == OutputFormat::Glb {
        return None;
    }
    let extras = plan.frame.extras();
    let definition = globe_definition(&plan.crs, extras.metres_per_unit).ok()?;
    // Whoever publishes says why a terrain has no place on the globe.
    let ground = Ground::new(extras, &definition, output.height_offset).ok()?;
    let middle = [0, 1].map(|k| (bounds.min[k] as i64 + bounds.extent(k) / 2) as i32);
    let distortion = ground.tangent(middle).and_then(|transform| ground.distortion(&transform, bounds)).ok()?;
    (distortion > ONE_PLANE).then(|| fit_curvature(&ground, bounds).ok())?
}
