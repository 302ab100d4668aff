//! What the header of a tile tells viewers, so that they need not look into it: a sphere around it, and when the horizon hides it.

use crate::tile::Tile;

/// The greater half axis of the WGS 84 ellipsoid in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;
/// Its lesser half axis.
const SEMI_MINOR: f64 = 6_356_752.314_245_179;

/// Tiles of smaller zooms are so wide that a few places do not stand for all.
const FIRST_SMALL_ZOOM: u8 = 8;

/// Where a tile is, in earth-centred metres.
pub(crate) struct Header {
    /// The centre of a sphere around it.
    pub(crate) centre: [f64; 3],
    /// Its radius.
    pub(crate) radius: f64,
    /// A point that the horizon hides only if it hides the whole tile, in half axes of the ellipsoid.
    pub(crate) horizon: [f64; 3],
}

impl Header {
    /// Returns the header of a tile with heights between two in metres.
    pub(crate) fn new(tile: Tile, [low, high]: [f64; 2]) -> Header {
        let parts = if tile.zoom < FIRST_SMALL_ZOOM { 32 } else { 2 };
        let [west, south] = tile.south_west();
        let share = |part: i32| tile.side() * f64::from(part) / f64::from(parts);
        let places = || (0..=parts).flat_map(|i| (0..=parts).map(move |j| [west + share(i), south + share(j)]));
        let middle = [west + tile.side() / 2.0, south + tile.side() / 2.0];
        let centre = earth_centred(middle, (low + high) / 2.0);
        let all = places().flat_map(|place| [low, high].map(|height| earth_centred(place, height)));
        let radius = all.map(|place| length(minus(place, centre))).fold(0.0, f64::max);
        let direction = scaled(centre);
        let direction = direction.map(|along| along / length(direction));
        let mut reach = places().map(|place| horizon_distance(scaled(earth_centred(place, high)), direction));
        // A tile around which the horizon turns is never hidden by it.
        const FAR: f64 = 10.0;
        let reach = reach.try_fold(1.0, |most: f64, reach| Some(most.max(reach?))).unwrap_or(FAR);
        Header { centre, radius, horizon: direction.map(|along| along * reach) }
    }
}

/// Returns the earth-centred place at longitude and latitude in radians, at a height in metres above the ellipsoid.
pub(crate) fn earth_centred([longitude, latitude]: [f64; 2], height: f64) -> [f64; 3] {
    let ([east, north], [sin, cos]) = (circle(longitude), circle(latitude));
    let ratio = (SEMI_MINOR / SEMI_MAJOR) * (SEMI_MINOR / SEMI_MAJOR);
    let normal = SEMI_MAJOR / (1.0 - (1.0 - ratio) * sin * sin).sqrt();
    let around = (normal + height) * cos;
    [around * north, around * east, (normal * ratio + height) * sin]
}

/// Returns sine and cosine.
pub(crate) fn circle(radians: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(radians);
    [sin, cos]
}

/// Returns how far out in `direction`, in half axes, a point is that the horizon hides no sooner than a place (Ring 2013, "Computing the horizon
/// occlusion point"); `None` if there is no such point.
fn horizon_distance(place: [f64; 3], direction: [f64; 3]) -> Option<f64> {
    let distance = length(place);
    let unit = place.map(|along| along / distance);
    let cos_alpha: f64 = (0..3).map(|k| unit[k] * direction[k]).sum();
    let sin_alpha = length(cross(unit, direction));
    // Places below the ellipsoid are taken for places on it.
    let distance = distance.max(1.0);
    let cos_beta = 1.0 / distance;
    let sin_beta = (distance * distance - 1.0).sqrt() * cos_beta;
    let reach = 1.0 / (cos_alpha * cos_beta - sin_alpha * sin_beta);
    (reach > 0.0).then_some(reach)
}

fn scaled([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x / SEMI_MAJOR, y / SEMI_MAJOR, z / SEMI_MINOR]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}
