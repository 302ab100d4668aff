//! Placing the terrain on the globe: the transforms of `tileset.json`, and how far off they are because the earth is curved.

use crate::geometry::Bounds;
use crate::input::Crs;
use crate::output::frame::Frame;
use crate::output::geoid::Geoid;
use crate::output::geoid::option::HeightOffset;
use crate::output::tiles3d::globe::{Globe, NotPlaced, transform_point};
use crate::output::tiles3d::tileset::{TilesetNode, bounds_in_metres};
use rayon::prelude::*;
use serde::Serialize;

/// The number of places along each side at which the distortion is measured. Both ends are among them: there it is greatest.
const PLACES: usize = 9;

/// The greatest distortion in metres with which one transform places all tiles, so that they meet exactly. Datums that differ from the
/// globe's by as much are accepted too. Beyond it every tile has a transform of its own.
const ONE_TRANSFORM: f64 = 1.0;

/// What `georeference.json` says of the globe.
#[derive(Clone, Debug, Serialize)]
pub struct Placement {
    /// The projected system as a PROJ.4 string.
    pub definition: String,
    /// The transform of the tileset's root: metres east, north and up in the scene to earth-centred ones, column by column.
    pub transform: [f64; 16],
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
const ADDED_TWICE: &str = "the inputs say that heights count from the ellipsoid, and [output] height_offset adds the height of a geoid to them; \
     leave it out, unless the inputs are wrong";

/// The way from the scene to the globe.
pub(super) struct Ground<'a> {
    frame: &'a Frame,
    globe: Globe,
    /// The height of the scene's origin above the geoid in metres.
    base: f64,
}

/// Places `root`, and each tile below if need be. Heights count from `geoid`.
///
/// # Errors
/// [`NotPlaced`] says why the terrain cannot be placed; then nothing is.
pub fn place(crs: &Crs, frame: &Frame, geoid: Geoid, root: &mut TilesetNode) -> Result<Placement, NotPlaced> {
    let (ground, definition) = Ground::new(crs, frame, geoid)?;
    let transform = ground.tangent(root.middle)?;
    let mut distortion_m = ground.distortion(&transform, root.bounds)?;
    let per_tile = distortion_m > ONE_TRANSFORM && !root.children.is_empty();
    if per_tile {
        // A copy, because no tile is placed if one cannot be.
        let mut placed = root.clone();
        distortion_m = ground.lay(&mut placed)?;
        *root = placed;
    }
    root.transform = Some(transform);
    let (height_offset, geoid) = (ground.height_offset(root.middle)?, ground.globe.geoid_model().map(str::to_owned));
    Ok(Placement {
        definition,
        transform,
        per_tile,
        distortion_m,
        vertical_datum: crs.vertical_name(),
        height_offset,
        geoid,
    })
}

/// Returns the system of `definition` with coordinates in units of `metres`. A file may say another unit than the code that it names.
fn with_unit(definition: &str, metres: f64) -> String {
    let is_unit = |word: &&str| word.starts_with("+units=") || word.starts_with("+to_meter=");
    let (units, others): (Vec<&str>, Vec<&str>) = definition.split_whitespace().partition(is_unit);
    let is_same = |unit: &&str| match unit.split_once('=') {
        Some(("+units", "m")) => metres == 1.0,
        Some(("+units", "ft")) => metres == 0.3048,
        Some(("+units", "us-ft")) => metres == 1200.0 / 3937.0,
        Some((_, value)) => value.parse().is_ok_and(|value: f64| (value - metres).abs() <= 1e-12 * metres),
        None => false,
    };
    let is_metre = units.is_empty() && metres == 1.0;
    if is_metre || (!units.is_empty() && units.iter().all(is_same)) {
        return definition.to_string();
    }
    format!("{} +to_meter={metres}", others.join(" "))
}

impl<'a> Ground<'a> {
    /// Returns the way to the globe, and the definition of the system that it begins in.
    pub(super) fn new(crs: &Crs, frame: &'a Frame, geoid: Geoid) -> Result<(Ground<'a>, String), NotPlaced> {
        let definition = crs.proj4_definition().ok_or_else(|| match &crs.name {
            Some(name) => format!("{name} has no definition that leads to longitude and latitude"),
            None => "no input names its coordinate system".to_string(),
        })?;
        let extras = frame.extras();
        let definition = with_unit(&definition, extras.metres_per_unit);
        let globe = Globe::new(&definition, extras.metres_per_unit, geoid)?;
        Ok((Ground { frame, globe, base: extras.offset[2] * extras.metres_per_unit_z }, definition))
    }

    /// Returns the metres that are added to heights at a lattice point.
    pub(super) fn height_offset(&self, [x, y]: [i32; 2]) -> Result<f64, NotPlaced> {
        let [[east, north, _], _] = bounds_in_metres(self.frame, Bounds::of_point([x, y, 0]));
        let [source_x, source_y] = self.source([east, north]);
        self.globe.height_offset(source_x, source_y)
    }

    /// Gives every tile from `node` down a transform of its own, and returns the greatest distortion of the exact ones.
    ///
    /// A place is then not quite where it is in the exact tile below, by at most the distortion of both tiles. A viewer that shows
    /// the coarser tile shows that error too, so it is added to the vertical error.
    fn lay(&self, node: &mut TilesetNode) -> Result<f64, NotPlaced> {
        let transform = self.tangent(node.middle)?;
        let own = self.distortion(&transform, node.bounds)?;
        node.transform = Some(transform);
        if node.children.is_empty() {
            return Ok(own);
        }
        // A hundred thousand tiles take a thread a minute. The first error is that of the first child, whatever thread is faster.
        let laid: Vec<Result<f64, NotPlaced>> = node.children.par_iter_mut().map(|child| self.lay(child)).collect();
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

    /// Returns the source's x and y at a place of the scene.
    fn source(&self, place: [f64; 2]) -> [f64; 2] {
        let extras = self.frame.extras();
        [0, 1].map(|k| extras.offset[k] + place[k] / extras.metres_per_unit)
    }

    /// Returns the map from the scene to the globe that is exact to first order at a lattice point, at the height of the scene's origin.
    fn tangent(&self, [x, y]: [i32; 2]) -> Result<[f64; 16], NotPlaced> {
        let [[east, north, _], _] = bounds_in_metres(self.frame, Bounds::of_point([x, y, 0]));
        let [source_x, source_y] = self.source([east, north]);
        let mut transform = self.globe.tangent(source_x, source_y, self.base)?;
        // Move the origin from the tangent's to the scene's.
        let origin = transform_point(&transform, [-east, -north, 0.0]);
        transform[12..15].copy_from_slice(&origin);
        Ok(transform)
    }

    /// Returns the greatest distance in metres between where `transform` puts a place within `bounds` and where it belongs.
    fn distortion(&self, transform: &[f64; 16], bounds: Bounds<3>) -> Result<f64, NotPlaced> {
        let [low, high] = bounds_in_metres(self.frame, bounds);
        let mut greatest = 0.0f64;
        for i in 0..PLACES * PLACES * 2 {
            let share = [i % PLACES, i / PLACES % PLACES].map(|n| n as f64 / (PLACES - 1) as f64);
            let [x, y] = [0, 1].map(|k| low[k] + (high[k] - low[k]) * share[k]);
            let z = if i < PLACES * PLACES { low[2] } else { high[2] };
            let [source_x, source_y] = self.source([x, y]);
            let belongs = match self.globe.place(source_x, source_y, self.base + z) {
                // The corners of a box may lie beyond the geoid's grid although no point does.
                Err(NotPlaced::Height(_)) => continue,
                place => place?,
            };
            let found = transform_point(transform, [x, y, z]);
            greatest = greatest.max((0..3).map(|k| (found[k] - belongs[k]).powi(2)).sum::<f64>().sqrt());
        }
        Ok(greatest)
    }
}

/// Returns what the user should know about the placement.
pub fn placement_warning(placement: &Result<Placement, NotPlaced>) -> Option<String> {
    let placement = match placement {
        Err(why) => {
            return Some(format!("tileset.json is not placed on the globe: {why}; its coordinates are local"));
        }
        Ok(placement) => placement,
    };
    let (flat, off) = (if placement.per_tile { "each tile" } else { "the only tile" }, placement.distortion_m);
    (off > ONE_TRANSFORM).then(|| {
        format!(
            "in tileset.json {flat} lies flat on the tangent plane at its middle, up to {off:.1} m off the curved earth; smaller tiles \
             follow it more closely: lower [triangulation] max_points_per_tile, and leave out long triangles along the hull with \
             [output] max_edge"
        )
    })
}

/// Returns what the user should know about the heights of a terrain on the globe, to which `offset` is added.
pub fn heights_warning(crs: &Crs, offset: Option<&HeightOffset>) -> Option<String> {
    let from = match &crs.vertical_system {
        _ if crs.has_ellipsoidal_heights() => {
            return offset.filter(|offset| offset.is_model()).map(|_| ADDED_TWICE.into());
        }
        _ if offset.is_some() => return None,
        Some(system) => format!("count from {}", system.label()),
        None => "may count from the sea: no input says from what".to_string(),
    };
    Some(format!(
        "the heights {from}, and tileset.json is placed on the globe as if they counted from the ellipsoid, which may be tens of metres off; \
         set [output] height_offset to \"egm96\" (a geoid of the whole earth), to the path of a geoid grid (.gtx or .tif), or to a number of \
         metres; 0.0 leaves the heights as they are"
    ))
}
