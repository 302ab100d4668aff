//! Placing the terrain on the globe: the transforms of `tileset.json`, and how far off they are because the earth is curved.

use crate::plan::globe_system::globe_system;
use crate::tiles::curve::{ONE_TRANSFORM, ONE_TRANSFORM_SIDEWAYS};
use crs::geoid::Geoid;
use crs::geoid::option::HeightOffset;
use crs::vertical::VerticalSystem;
use crs::{Crs, Unit};
use rayon::prelude::*;
use serde::Serialize;
use tiles::curvature::Curvature;
use tiles::frame::Frame;
use tiles::tiles3d::globe::NotPlaced;
use tiles::tiles3d::ground::Ground;
use tiles::tiles3d::tileset::TilesetNode;

/// What `georeference.json` says of the globe.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Placement {
    /// The projected system as a PROJ.4 string.
    pub definition: String,
    /// The transform of the tileset's root: metres east, north and up in the scene to earth-centred ones, column by column.
    pub transform: [f64; 16],
    /// Whether the scene follows the curve of the earth.
    pub curved: bool,
    /// Whether the tiles below the root have transforms of their own.
    pub per_tile: bool,
    /// The greatest distance in metres between where the tileset puts a place of an exact tile and where it belongs.
    pub distortion_m: f64,
    /// What the heights count from, if the inputs say. The tileset takes them as heights above the ellipsoid anyway.
    pub vertical_datum: Option<String>,
    /// Metres added to heights in the middle of the terrain.
    pub height_offset: f64,
    /// The model of the geoid that says what is added to heights; `None` if it is the same everywhere.
    pub geoid: Option<String>,
}

/// The warning about a geoid that is added to heights which need none.
const ADDED_TWICE: &str = "the inputs state ellipsoidal heights, and [output] height_offset adds a geoid to them; fix: leave \
     [output] height_offset out, unless the inputs are wrong";

/// Places `root`, and each tile below if need be. Tiles have positions by `frame`, and heights count from `geoid`.
///
/// # Errors
/// [`NotPlaced`] says why the terrain cannot be placed; then nothing is.
pub(crate) fn place(crs: &Crs, frame: &Frame, geoid: Geoid, root: &mut TilesetNode) -> Result<Placement, NotPlaced> {
    let extras = frame.extras();
    let system = globe_system(crs, extras.metres_per_unit)?;
    let definition = system.definition.clone();
    let ground = Ground::new(extras, system, geoid);
    let curvature = extras.curvature.as_ref();
    let middle = ground.seen_from(curvature.map_or(root.bounds, Curvature::bounds))?;
    let transform = ground.tangent(middle)?;
    let mut distortion_m = ground.distortion(&transform, root.bounds)?;
    let most = match curvature {
        None => ONE_TRANSFORM,
        Some(curvature) if curvature.is_vertical() => ONE_TRANSFORM_SIDEWAYS,
        // What follows the earth along all axes needs no other transform.
        Some(_) => f64::INFINITY,
    };
    let per_tile = distortion_m > most && !root.children.is_empty();
    if per_tile {
        // A copy, because no tile is placed if one cannot be.
        let mut placed = root.clone();
        distortion_m = lay(&ground, &mut placed)?;
        *root = placed;
    }
    root.transform = Some(transform);
    let height_offset = ground.height_offset([middle[0], middle[1]])?;
    Ok(Placement {
        definition,
        transform,
        curved: curvature.is_some(),
        per_tile,
        distortion_m,
        vertical_datum: crs.vertical_system.as_ref().map(VerticalSystem::label),
        height_offset,
        geoid: ground.geoid_model().map(str::to_owned),
    })
}

/// Gives every tile from `node` down a transform of its own, and returns the greatest distortion of the exact ones.
///
/// A place is then not quite where it is in the exact tile below, by at most the distortion of both tiles. A viewer that shows
/// the coarser tile shows that error too, so it is added to the vertical error.
fn lay(ground: &Ground, node: &mut TilesetNode) -> Result<f64, NotPlaced> {
    let [x, y] = node.middle;
    let transform = ground.tangent_of_scene([x, y, node.bounds.middle()[2]])?;
    let own = ground.distortion(&transform, node.bounds)?;
    node.transform = Some(transform);
    if node.children.is_empty() {
        return Ok(own);
    }
    // A hundred thousand tiles take a thread a minute. The first error is that of the first child, whatever thread is faster.
    let laid: Vec<Result<f64, NotPlaced>> = node.children.par_iter_mut().map(|child| lay(ground, child)).collect();
    let (mut exact, mut below, mut greatest_below) = (0.0f64, 0.0f64, 0.0f64);
    for (child, distortion) in node.children.iter().zip(laid) {
        exact = exact.max(distortion?);
        below = below.max(child.error);
        greatest_below = greatest_below.max(child.greatest_error);
    }
    node.error = below.max(node.error + own + exact);
    node.greatest_error = greatest_below.max(node.greatest_error + own + exact);
    Ok(exact)
}

/// Returns what the user should know about the placement.
pub(crate) fn placement_warning(placement: &Result<Placement, NotPlaced>) -> Option<String> {
    let placement = match placement {
        Err(why) => {
            return Some(format!(
                "tileset.json is not placed on the globe, because {why}: its coordinates are local; fix: [input] crs = \
             \"EPSG:...\""
            ));
        }
        Ok(placement) => placement,
    };
    let off = placement.distortion_m;
    match (placement.per_tile, placement.curved) {
        (true, true) => Some(
            "tiles have gaps of up to some metres on the globe, because the terrain is too wide for one transform; fix: [output] \
             compression = \"meshopt\", with which they meet exactly"
                .into(),
        ),
        _ if off <= ONE_TRANSFORM => None,
        (false, true) => Some(format!(
            "positions on the globe are up to {off:.1} m off; fix: [output] compression = \"meshopt\", or [input] bounds for a smaller \
             terrain"
        )),
        (per_tile, false) => Some(format!(
            "on the globe {} is flat, up to {off:.1} m off the curved earth{}; fix: a lower [triangulation] max_points_per_tile for \
             smaller tiles, and [output] max_edge without long triangles along the hull",
            if per_tile { "each tile" } else { "the only tile" },
            if per_tile { ", with gaps between neighbours" } else { "" }
        )),
    }
}

/// Returns what the user should know about the unit of heights, if the terrain has a CRS and nothing states that unit. Beside feet either is
/// common. Beside metres heights are in metres, so [`heights_warning`] is enough.
pub(crate) fn height_unit_warning(crs: &Crs) -> Option<String> {
    let is_unknown = crs.vertical.is_none() && !crs.has_ellipsoidal_heights() && crs.horizontal != Unit::Metre;
    (crs.name.is_some() && is_unknown).then(|| {
        format!(
            "height unit unknown: heights are taken to be in the unit of x and y ({}); fix: [input] height_unit = \"metre\", \"foot\" or \
             \"us-foot\"",
            crs.horizontal.name()
        )
    })
}

/// Returns what the user should know about the heights of a terrain on the globe, to which `offset` is added.
pub(crate) fn heights_warning(crs: &Crs, offset: Option<&HeightOffset>) -> Option<String> {
    let has_assumed_metres = crs.vertical.is_none() && crs.vertical_system.is_none() && crs.horizontal == Unit::Metre;
    let from = match &crs.vertical_system {
        _ if crs.has_ellipsoidal_heights() => {
            return offset.filter(|offset| offset.is_model()).map(|_| ADDED_TWICE.into());
        }
        _ if offset.is_some() => return None,
        Some(system) => format!("heights are above {}", system.label()),
        None if has_assumed_metres => {
            "vertical datum and unit unknown: heights are taken to be in the unit of x and y (metre), and may be above sea level".into()
        }
        None => "vertical datum unknown: heights may be above sea level".to_string(),
    };
    let unit = if has_assumed_metres { "; and [input] height_unit, if their unit is another one" } else { "" };
    Some(format!(
        "{from}, not the ellipsoid, so the terrain may be tens of metres too low or high on the globe; fix: [output] height_offset = \
         \"egm96\" or a geoid grid; 0.0 if they are above the ellipsoid{unit}"
    ))
}
