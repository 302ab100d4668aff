//! Where the terrain lies on the globe: the transform of `tileset.json`, and how far it is off where the plane is not a plane.

use super::scan::Plan;
use crate::output::frame::Frame;
use crate::output::globe::{Globe, applied};
use crate::output::tileset::corners;
use serde::Serialize;

/// Places along each side at which the distortion is measured.
const PLACES: usize = 9;

/// Beyond so many metres the user is told.
const NOTABLE: f64 = 1.0;

/// What `georeference.json` says of the globe.
#[derive(Clone, Debug, Serialize)]
pub struct Placement {
    /// The projected system in the way of PROJ.4.
    pub definition: String,
    /// The transform of the tileset's root: metres east, north and up in the scene to earth-centred ones, column by column.
    pub transform: [f64; 16],
    /// The greatest distance in metres between where this puts a place of the terrain's box and where it belongs.
    pub distortion_m: f64,
    /// What heights are counted from, where the inputs say; they are taken as heights above the ellipsoid all the same.
    pub vertical_datum: Option<String>,
    /// Metres added to heights.
    pub height_offset: f64,
}

/// The placement of a job whose sites have these least and greatest lattice x, y, z; a sentence where there is none.
pub fn place(plan: &Plan, frame: &Frame, bounds: [[i32; 3]; 2], height_offset: f64) -> Result<Placement, String> {
    let definition = plan.crs.definition().ok_or_else(|| match &plan.crs.name {
        Some(name) => format!("{name} has no definition that leads to longitude and latitude"),
        None => "no input names its coordinate system".to_string(),
    })?;
    let extras = frame.extras();
    let globe = Globe::new(&definition, extras.metres_per_unit)?;
    let base = extras.offset[2] * extras.metres_per_unit_z + height_offset;
    let source = |k: usize, metres: f64| extras.offset[k] + metres / extras.metres_per_unit;
    let [low, high] = corners(frame, bounds);
    let middle = [0, 1].map(|k| (low[k] + high[k]) / 2.0);
    let mut transform = globe.tangent(source(0, middle[0]), source(1, middle[1]), base)?;
    // From the tangent's origin to the scene's.
    let origin = applied(&transform, [-middle[0], -middle[1], 0.0]);
    transform[12..15].copy_from_slice(&origin);
    let mut distortion_m = 0.0f64;
    for i in 0..PLACES * PLACES * 2 {
        let share = [i % PLACES, i / PLACES % PLACES].map(|n| n as f64 / (PLACES - 1) as f64);
        let [x, y] = [0, 1].map(|k| low[k] + (high[k] - low[k]) * share[k]);
        let z = if i < PLACES * PLACES { low[2] } else { high[2] };
        let true_place = globe.place(source(0, x), source(1, y), base + z)?;
        let found = applied(&transform, [x, y, z]);
        let distance = (0..3).map(|k| (found[k] - true_place[k]).powi(2)).sum::<f64>().sqrt();
        distortion_m = distortion_m.max(distance);
    }
    Ok(Placement { definition, transform, distortion_m, vertical_datum: plan.crs.vertical_name(), height_offset })
}

/// What the user should know of the placement.
pub fn remark(placement: &Result<Placement, String>) -> Option<String> {
    match placement {
        Err(why) => Some(format!("tileset.json is not placed on the globe: {why}; its coordinates are local")),
        Ok(placement) if placement.distortion_m > NOTABLE => Some(format!(
            "tileset.json lies flat on the tangent plane at its middle, which is up to {:.1} m off the curved earth",
            placement.distortion_m
        )),
        Ok(_) => None,
    }
}
