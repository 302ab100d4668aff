//! A map projection with its false origin, from the parameters that a text gives.

use crate::projection::Projection;
use crate::projection_names::WEB_MERCATOR;
use crate::transform::ellipsoid::Ellipsoid;
use crate::transform::equal_area::{Albers, LambertAzimuthal, LambertCylindrical};
use crate::transform::krovak::Krovak;
use crate::transform::lambert_conic::LambertConic;
use crate::transform::mercator::Mercator;
use crate::transform::meridian_arc::{Cassini, Polyconic};
use crate::transform::oblique_mercator::ObliqueMercator;
use crate::transform::stereographic::{ObliqueStereographic, PolarStereographic};
use crate::transform::transverse_mercator::TransverseMercator;
use std::f64::consts::{FRAC_PI_2, PI};

/// Radians of a degree.
pub(crate) const DEGREE: f64 = PI / 180.0;

/// The transverse Mercator projection with axes to the west and south, as in the south of Africa.
const SOUTH: &str = "tmerc south";

/// No coordinate of a map is greater, in metres: the way round the earth.
const FARTHEST: f64 = 4.1e7;

/// A latitude that ends at the pole in degrees may begin a rounding error beyond it in radians.
const POLE: f64 = FRAC_PI_2 + 1e-12;

/// A projection that this program computes.
#[derive(Clone, Debug)]
enum Method {
    TransverseMercator(TransverseMercator),
    LambertConic(LambertConic),
    Mercator(Mercator),
    Albers(Albers),
    LambertAzimuthal(LambertAzimuthal),
    LambertCylindrical(LambertCylindrical),
    PolarStereographic(PolarStereographic),
    ObliqueStereographic(ObliqueStereographic),
    ObliqueMercator(ObliqueMercator),
    Krovak(Krovak),
    Cassini(Cassini),
    Polyconic(Polyconic),
}

/// A projection with its central meridian and its false origin.
#[derive(Clone, Debug)]
pub(crate) struct MapProjection {
    method: Method,
    label: String,
    /// Radians east of the prime meridian.
    meridian: f64,
    /// 1 if x grows to the east and y to the north, -1 if they grow to the west and south.
    direction: f64,
    /// Metres.
    false_origin: [f64; 2],
}

impl MapProjection {
    /// Returns the projection on an ellipsoid.
    ///
    /// # Errors
    /// A sentence if the program does not compute it.
    pub(crate) fn of(projection: &Projection, ellipsoid: Ellipsoid) -> Result<MapProjection, String> {
        let label = projection.label();
        let is_odd = |name: &&String| !is_known(projection.method(), name) && !is_idle(name, projection.value(name));
        if let Some(odd) = projection.names().find(is_odd) {
            return Err(format!("the parameter {odd} of its projection ({label}) is unknown"));
        }
        let direction = direction(projection)?;
        if has_two_scales(projection) {
            return Err(format!(
                "it gives two standard parallels and also the scale factor {}, which programs interpret differently",
                projection.value("k_0")
            ));
        }
        let method = method(projection, ellipsoid).ok_or_else(|| format!("its projection is {label}"))?;
        let meridian = projection.value("lon_0") * DEGREE;
        let (label, false_origin) = (label.replace('_', " "), projection.false_origin());
        Ok(MapProjection { method, label, meridian, direction, false_origin })
    }

    /// Returns what the text calls the method.
    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    /// Returns x and y in metres of a longitude and latitude in radians; `None` if the projection has no place there.
    pub(crate) fn forward(&self, [longitude, latitude]: [f64; 2]) -> Option<[f64; 2]> {
        let place = [turned(longitude - self.meridian), latitude];
        if !(latitude.abs() <= POLE && place[0].abs() <= PI) {
            return None;
        }
        let map = match &self.method {
            Method::TransverseMercator(method) => method.forward(place),
            Method::LambertConic(method) => method.forward(place),
            Method::Mercator(method) => method.forward(place),
            Method::Albers(method) => method.forward(place),
            Method::LambertAzimuthal(method) => method.forward(place),
            Method::LambertCylindrical(method) => method.forward(place),
            Method::PolarStereographic(method) => method.forward(place),
            Method::ObliqueStereographic(method) => method.forward(place),
            Method::ObliqueMercator(method) => method.forward(place),
            Method::Krovak(method) => method.forward(place),
            Method::Cassini(method) => method.forward(place),
            Method::Polyconic(method) => method.forward(place),
        };
        let map = map.filter(is_on_map)?;
        Some([0, 1].map(|k| self.direction * map[k] + self.false_origin[k]))
    }

    /// Returns the longitude and latitude in radians of x and y in metres; `None` if the projection shows no place there.
    pub(crate) fn inverse(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let map = [x - self.false_origin[0], y - self.false_origin[1]].map(|value| self.direction * value);
        let map = Some(map).filter(is_on_map)?;
        let place = match &self.method {
            Method::TransverseMercator(method) => method.inverse(map),
            Method::LambertConic(method) => method.inverse(map),
            Method::Mercator(method) => method.inverse(map),
            Method::Albers(method) => method.inverse(map),
            Method::LambertAzimuthal(method) => method.inverse(map),
            Method::LambertCylindrical(method) => method.inverse(map),
            Method::PolarStereographic(method) => method.inverse(map),
            Method::ObliqueStereographic(method) => method.inverse(map),
            Method::ObliqueMercator(method) => method.inverse(map),
            Method::Krovak(method) => method.inverse(map),
            Method::Cassini(method) => method.inverse(map),
            Method::Polyconic(method) => method.inverse(map),
        };
        let [longitude, latitude] = place?;
        let is_place = longitude.is_finite() && latitude.abs() <= POLE;
        is_place.then_some([longitude + self.meridian, latitude])
    }
}

/// Returns the method of `projection`; `None` for one that is not computed, or that its parameters make impossible.
fn method(projection: &Projection, ellipsoid: Ellipsoid) -> Option<Method> {
    let angle = |name: &str| projection.value(name) * DEGREE;
    let (latitude, scale) = (angle("lat_0"), projection.value("k_0"));
    if !(scale > 0.0 && scale < 10.0) || latitude.abs() > POLE {
        return None;
    }
    let parallels = || [angle("lat_1"), angle("lat_2")];
    let line = || [angle("alpha"), angle("gamma")];
    match projection.method() {
        "tmerc" | SOUTH => Some(Method::TransverseMercator(TransverseMercator::new(ellipsoid, latitude, scale))),
        "lcc" => LambertConic::new(ellipsoid, latitude, parallels(), scale).map(Method::LambertConic),
        "aea" => Albers::new(ellipsoid, latitude, parallels()).map(Method::Albers),
        "laea" => Some(Method::LambertAzimuthal(LambertAzimuthal::new(ellipsoid, latitude))),
        "cea" if latitude == 0.0 => LambertCylindrical::new(ellipsoid, angle("lat_1")).map(Method::LambertCylindrical),
        // Variants with another origin differ in where they count from.
        "merc" if latitude == 0.0 => Some(Method::Mercator(Mercator::new(ellipsoid, scale))),
        WEB_MERCATOR => Some(Method::Mercator(Mercator::web(ellipsoid))),
        "stere" => polar(projection, ellipsoid, latitude, scale).map(Method::PolarStereographic),
        "sterea" => ObliqueStereographic::new(ellipsoid, latitude, scale).map(Method::ObliqueStereographic),
        "omerc origin" => {
            ObliqueMercator::around_crossing(ellipsoid, latitude, line(), scale).map(Method::ObliqueMercator)
        }
        "omerc centre" => {
            ObliqueMercator::around_centre(ellipsoid, latitude, line(), scale).map(Method::ObliqueMercator)
        }
        // Programs do not agree in which direction a false origin would count.
        "krovak" if projection.false_origin() == [0.0; 2] => {
            Krovak::new(ellipsoid, latitude, scale).map(Method::Krovak)
        }
        "cass" => Some(Method::Cassini(Cassini::new(ellipsoid, latitude))),
        "poly" => Some(Method::Polyconic(Polyconic::new(ellipsoid, latitude))),
        _ => None,
    }
}

/// Returns a polar stereographic projection: at the pole itself by its scale there, else true to scale at the parallel.
fn polar(projection: &Projection, ellipsoid: Ellipsoid, latitude: f64, scale: f64) -> Option<PolarStereographic> {
    let is_pole = (latitude.abs() - FRAC_PI_2).abs() < 1e-9;
    if is_pole {
        return Some(PolarStereographic::with_scale(ellipsoid, libm::copysign(1.0, latitude), scale));
    }
    // A text of version 1 has the parallel where others have the origin. One around another place is another method.
    let is_polar = projection.is_named_polar() && latitude != 0.0;
    is_polar.then(|| PolarStereographic::with_parallel(ellipsoid, latitude, scale))
}

/// Returns 1 if x grows to the east and y to the north, -1 if they grow to the west and south, as the method has it.
fn direction(projection: &Projection) -> Result<f64, String> {
    match projection.method() {
        SOUTH if projection.may_go_south_west() => Ok(-1.0),
        SOUTH => Err("its axes do not point west and south, as those of its projection do".into()),
        _ if projection.has_other_axes() => Err("its x grows to the west, or its y to the south".into()),
        _ => Ok(1.0),
    }
}

/// Returns whether the formulas of a method have a place for a parameter.
fn is_known(method: &str, name: &str) -> bool {
    match name {
        "lon_0" | "lat_0" | "x_0" | "y_0" => true,
        "lat_1" => ["lcc", "aea", "cea"].contains(&method),
        "lat_2" => ["lcc", "aea"].contains(&method),
        "alpha" | "gamma" => ["omerc origin", "omerc centre"].contains(&method),
        "k_0" => !["aea", "laea", "cea", "cass", "poly", WEB_MERCATOR].contains(&method),
        _ => false,
    }
}

/// Returns whether a cone has two parallels that are true to scale, and a scale as well.
fn has_two_scales(projection: &Projection) -> bool {
    let [first, second, scale] = ["lat_1", "lat_2", "k_0"].map(|name| projection.value(name));
    projection.method() == "lcc" && first != second && scale != 1.0
}

/// Returns whether a parameter changes nothing.
fn is_idle(name: &str, value: f64) -> bool {
    value == if name == "k_0" { 1.0 } else { 0.0 }
}

/// Returns a longitude with whole turns taken away, if there are a few. Others stay: they are no longitudes.
fn turned(longitude: f64) -> f64 {
    match longitude {
        east if east > PI && east <= 3.0 * PI => east - 2.0 * PI,
        west if (-3.0 * PI..-PI).contains(&west) => west + 2.0 * PI,
        other => other,
    }
}

fn is_on_map(map: &[f64; 2]) -> bool {
    map.iter().all(|value| value.abs() <= FARTHEST)
}
