//! The part of the earth that a map projection is good for, from its parameters alone. Maps of countries and of sites lie well within it.

use crate::projection::Projection;
use crate::rectangle::{Rectangle, turned};

/// Degrees of longitude on either side of the central meridian of a cylinder: Norway is mapped 12 degrees beside that of its zone.
const CYLINDER: f64 = 12.0;

/// The latitudes that a transverse cylinder is used for.
const POLEMOST: f64 = 84.0;

/// Degrees of latitude from the equator up to which an origin counts as on it: zones of Gauss-Krueger have some tenths.
const EQUATOR: f64 = 1.0;

/// Degrees of latitude on either side of an origin that lies neither at the equator nor at a pole.
const FROM_ORIGIN: f64 = 20.0;

/// Degrees of longitude and latitude around the parallels of a cone, and how many more for each degree between the parallels: one for a
/// continent has them far apart.
const CONE: [[f64; 2]; 2] = [[45.0, 1.5], [10.0, 0.5]];

/// Degrees of longitude and latitude around the centre of maps of single countries.
const COUNTRY: [f64; 2] = [15.0, 15.0];

/// Returns the area of a projection whose longitudes count from `meridian`, in degrees east of Greenwich; `None` for one that is used for the
/// whole earth or half of it, or that is not known.
pub(crate) fn area_of_projection(projection: &Projection, meridian: f64) -> Option<Rectangle> {
    let value = |name: &str| projection.value(name);
    let middle = value("lon_0") + meridian;
    let origin = value("lat_0");
    let [half, south, north] = match projection.method() {
        "tmerc" => {
            let [south, north] = latitudes_of_cylinder(origin);
            [CYLINDER, south, north]
        }
        "lcc" | "aea" => {
            let (first, second) = (value("lat_1"), value("lat_2"));
            let [across, along] = CONE.map(|[degrees, factor]| degrees + factor * (first - second).abs());
            [across, first.min(second) - along, first.max(second) + along]
        }
        "sterea" | "cass" | "omerc origin" | "omerc centre" => {
            let [across, along] = COUNTRY;
            [across, origin - along, origin + along]
        }
        _ => return None,
    };
    let is_all = half >= 180.0;
    let [west, east] = if is_all { [-180.0, 180.0] } else { [middle - half, middle + half].map(turned) };
    Some(Rectangle { west, south: south.max(-90.0), east, north: north.min(90.0) })
}

/// Returns the least and the greatest latitude of a transverse cylinder. One that counts from the equator or from a pole serves both
/// hemispheres or one.
fn latitudes_of_cylinder(origin: f64) -> [f64; 2] {
    match origin {
        north if north >= POLEMOST => [0.0, 90.0],
        south if south <= -POLEMOST => [-90.0, 0.0],
        near if near.abs() <= EQUATOR => [-POLEMOST, POLEMOST],
        other => [other - FROM_ORIGIN, other + FROM_ORIGIN],
    }
}
