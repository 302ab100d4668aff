//! Placing the terrain on the globe: the transform of `tileset.json`, and how far off it is because the earth is curved.

use crate::input::Crs;
use crate::job::plan::globe_definition::globe_definition;
use crate::job::tiles::curve::ONE_PLANE;
use crate::output::frame::Frame;
use crate::output::tiles3d::ground::Ground;
use crate::output::tiles3d::tileset::TilesetNode;
use serde::Serialize;

/// What `georeference.json` says of the globe.
#[derive(Clone, Debug, Serialize)]
pub struct Placement {
    /// The projected system as a PROJ.4 string.
    pub definition: String,
    /// The transform of the tileset: metres east, north and up in the scene to earth-centred ones, column by column.
    pub transform: [f64; 16],
    /// Whether the scene follows the curve of the earth.
    pub curved: bool,
    /// The greatest distance in metres between where the tileset puts a place and where it belongs.
    pub distortion_m: f64,
    /// What the heights count from, if the inputs say. The tileset takes them as heights above the ellipsoid anyway.
    pub vertical_datum: Option<String>,
    /// Metres added to heights.
    pub height_offset: f64,
}

/// Why a terrain cannot be placed on the globe.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct NotPlaced(String);

impl From<String> for NotPlaced {
    fn from(why: String) -> NotPlaced {
        NotPlaced(why)
    }
}

/// Places `root`, whose tiles have positions by `frame`. `height_offset` is added to heights, in metres.
///
/// # Errors
/// [`NotPlaced`] says why the terrain cannot be placed.
pub fn place(crs: &Crs, frame: &Frame, height_offset: f64, root: &mut TilesetNode) -> Result<Placement, NotPlaced> {
    let extras = frame.extras();
    let definition = globe_definition(crs, extras.metres_per_unit)?;
    let ground = Ground::new(extras, &definition, height_offset)?;
    let seen_from = extras.curvature.as_ref().map(|curvature| curvature.centre());
    let transform = ground.tangent(seen_from.map_or(root.middle, |[x, y, _]| [x, y]))?;
    let distortion_m = ground.distortion(&transform, root.bounds)?;
    root.transform = Some(transform);
    let (curved, vertical_datum) = (seen_from.is_some(), crs.vertical_name());
    Ok(Placement { definition, transform, curved, distortion_m, vertical_datum, height_offset })
}

/// Returns what the user should know about the placement.
pub fn placement_warning(placement: &Result<Placement, NotPlaced>) -> Option<String> {
    let placement = match placement {
        Err(why) => {
            return Some(format!("tileset.json is not placed on the globe: {why}; its coordinates are local"));
        }
        Ok(placement) => placement,
    };
    (placement.distortion_m > ONE_PLANE).then(|| {
        format!(
            "tileset.json lies up to {:.1} m off the curved earth: set [output] format = \"3dtiles\", with which the scene follows it, or \
             [input] bounds for a smaller terrain",
            placement.distortion_m
        )
    })
}
