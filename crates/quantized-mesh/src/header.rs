//! What the header of a tile tells viewers, so that they need not look into it: a sphere around it, and when the horizon hides it.

use crate::tile::Tile;

/// The greater half axis of the WGS 84 ellipsoid in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;
/// Its lesser half axis.
const SEMI_MINOR: f64 = 6_356_752.314_245_179;

/// Tiles of smaller zooms of the geographic scheme are so wide that a few places do not stand for all.
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
        let parts = if tile.geographic_zoom() < FIRST_SMALL_ZOOM { 32 } else { 2 };
        let ([west, south], [width, height]) = (tile.south_west(), tile.sides());
        let share = |side: f64, part: i32| side * f64::from(part) / f64::from(parts);
        let place = |i: i32, j: i32| [west + share(width, i), south + share(height, j)];
        let places = || (0..=parts).flat_map(|i| (0..=parts).map(move |j| place(i, j)));
        let centre = earth_centred(tile.middle(), (low + high) / 2.0);
        let all = places().flat_map(|place| [low, high].map(|height| earth_centred(place, height)));
        let radius = all.map(|place| length(minus(place, centre))).fold(0.0, f64::max);
        let direction = scaled(centre);
        let direction = direction.map(|along| along / length(direction));
        let mut reach = places().map(|place| horizon_distance(scaled(earth_centred(place, high)), direction));
        // The horizon hides no part of the globe's half or more. So far out, viewers do not find the point hidden, even behind the globe.
        const FAR: f64 = 1e200;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheme::Scheme;
    use proptest::prelude::*;

    /// Tells whether the horizon hides a point from a camera, both in half axes of the ellipsoid, as viewers compute it.
    fn is_hidden(point: [f64; 3], camera: [f64; 3]) -> bool {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (to_point, to_horizon) = (minus(point, camera), dot(camera, camera) - 1.0);
        let behind = -dot(to_point, camera);
        behind > to_horizon && behind * behind / dot(to_point, to_point) > to_horizon
    }

    proptest! {
        /// What hides the point of the header hides all of the tile.
        #[test]
        fn no_tile_in_sight_is_hidden(
            zoom in prop::sample::select(vec![0u8, 0, 0, 1, 2, 5, 8]),
            [column, row] in [0.0..1.0f64, 0.0..1.0f64],
            [longitude, latitude] in [-3.2..3.2f64, -1.5..1.5f64],
            digits in 3.0..8.0f64,
            is_geographic in any::<bool>(),
        ) {
            let scheme = if is_geographic { Scheme::Geographic } else { Scheme::WebMercator };
            let number = |share: f64, count: i32| (share * f64::from(count)) as i32;
            let tile = Tile { scheme, zoom, x: number(column, scheme.columns(zoom)), y: number(row, 1 << zoom) };
            let camera = scaled(earth_centred([longitude, latitude], 10f64.powf(digits)));
            if is_hidden(Header::new(tile, [-100.0, 3000.0]).horizon, camera) {
                let ([west, south], [width, high]) = (tile.south_west(), tile.sides());
                for i in 0..=32 {
                    for j in 0..=32 {
                        let share = [i, j].map(|part| f64::from(part) / 32.0);
                        let place = earth_centred([west + width * share[0], south + high * share[1]], 3000.0);
                        prop_assert!(is_hidden(scaled(place), camera), "{tile:?} {share:?}");
                    }
                }
            }
        }
    }
}
