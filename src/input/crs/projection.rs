//! Map projections in one comparable form, whatever text describes them: the method by its name in PROJ.4, angles in degrees, lengths
//! in metres.

use crate::input::crs::wkt::{WktNode, comparable_name, degrees};
use std::collections::BTreeMap;

/// The parameters of projections: the name in well-known text, as `comparable_name` spells it, and the name in PROJ.4.
const PARAMETERS: [(&str, &str); 43] = [
    ("centralmeridian", "lon_0"),
    ("longitudeofcenter", "lon_0"),
    ("longitudeoforigin", "lon_0"),
    ("longitudeofnaturalorigin", "lon_0"),
    ("longitudeoffalseorigin", "lon_0"),
    ("longitudeofprojectioncentre", "lon_0"),
    ("longitudeofprojectioncenter", "lon_0"),
    ("straightverticallongitudefrompole", "lon_0"),
    ("latitudeoforigin", "lat_0"),
    ("latitudeofcenter", "lat_0"),
    ("latitudeofnaturalorigin", "lat_0"),
    ("latitudeoffalseorigin", "lat_0"),
    ("latitudeofprojectioncentre", "lat_0"),
    ("latitudeofprojectioncenter", "lat_0"),
    ("standardparallel1", "lat_1"),
    ("latitudeof1ststandardparallel", "lat_1"),
    ("latitudeofstandardparallel", "lat_1"),
    ("standardparallel2", "lat_2"),
    ("latitudeof2ndstandardparallel", "lat_2"),
    ("scalefactor", "k_0"),
    ("scalefactoratnaturalorigin", "k_0"),
    ("scalefactoratprojectioncentre", "k_0"),
    ("scalefactoronpseudostandardparallel", "k_0"),
    ("scalefactoroninitialline", "k_0"),
    ("scalefactorontheinitialline", "k_0"),
    ("falseeasting", "x_0"),
    ("eastingatfalseorigin", "x_0"),
    ("eastingatprojectioncentre", "x_0"),
    ("falsenorthing", "y_0"),
    ("northingatfalseorigin", "y_0"),
    ("northingatprojectioncentre", "y_0"),
    ("azimuth", "alpha"),
    ("azimuthofinitialline", "alpha"),
    ("azimuthattheprojectioncentre", "alpha"),
    ("azimuthatprojectioncentre", "alpha"),
    ("colatitudeofconeaxis", "alpha"),
    ("rectifiedgridangle", "gamma"),
    ("anglefromrectifiedtoskewgrid", "gamma"),
    ("xyplanerotation", "gamma"),
    ("pseudostandardparallel1", "lat_pseudo"),
    ("latitudeofpseudostandardparallel", "lat_pseudo"),
    ("xscale", "x_scale"),
    ("yscale", "y_scale"),
];

/// The methods of projections: the name in well-known text and the name in PROJ.4, or one of that kind.
const METHODS: [(&str, &str); 39] = [
    ("transversemercator", "tmerc"),
    ("gausskruger", "tmerc"),
    ("lambertconformalconic2sp", "lcc"),
    ("lambertconicconformal2sp", "lcc"),
    ("lambertconformalconic1sp", "lcc"),
    ("lambertconicconformal1sp", "lcc"),
    ("lambertconformalconic", "lcc"),
    ("albersconicequalarea", "aea"),
    ("albersequalarea", "aea"),
    ("albers", "aea"),
    ("lambertazimuthalequalarea", "laea"),
    ("obliquestereographic", "sterea"),
    ("doublestereographic", "sterea"),
    ("polarstereographic", "stere"),
    ("polarstereographicvarianta", "stere"),
    ("polarstereographicvariantb", "stere"),
    ("stereographicnorthpole", "stere"),
    ("stereographicsouthpole", "stere"),
    ("mercator", "merc"),
    ("mercator1sp", "merc"),
    ("mercator2sp", "merc"),
    ("mercatorvarianta", "merc"),
    ("mercatorvariantb", "merc"),
    ("mercatorauxiliarysphere", WEB_MERCATOR),
    ("popularvisualisationpseudomercator", WEB_MERCATOR),
    ("transversemercatorsouthorientated", "tmerc south"),
    ("cassinisoldner", "cass"),
    ("cassini", "cass"),
    ("krovak", "krovak"),
    ("krovaknorthorientated", "krovak"),
    ("polyconic", "poly"),
    ("americanpolyconic", "poly"),
    ("hotineobliquemercatorvarianta", "omerc origin"),
    ("hotineobliquemercator", "omerc origin"),
    ("hotineobliquemercatorazimuthnaturalorigin", "omerc origin"),
    ("rectifiedskeworthomorphicnaturalorigin", "omerc origin"),
    ("hotineobliquemercatorazimuthcenter", "omerc centre"),
    ("hotineobliquemercatorvariantb", "omerc centre"),
    ("obliquemercator", "omerc centre"),
];

/// The Mercator projection of web maps: of the ellipsoid's coordinates, but by the formulas of the sphere.
const WEB_MERCATOR: &str = "webmerc";

/// What must agree for two systems to be the same: to within a centimetre. Writers round parameters by less, and two systems that
/// are in use differ by more.
const LENGTH_TOLERANCE: f64 = 0.01;
/// A centimetre on the ground.
const ANGLE_TOLERANCE: f64 = 1e-7;
/// A centimetre at a thousand kilometres from the origin.
const SCALE_TOLERANCE: f64 = 1e-8;

/// Returns the PROJ.4 name of a method of well-known text.
pub(crate) fn method(name: &str) -> Option<&'static str> {
    let name = comparable_name(name);
    METHODS.iter().find(|(long, _)| *long == name).map(|(_, short)| *short)
}

/// Returns the PROJ.4 name of a parameter of well-known text.
pub(crate) fn parameter(name: &str) -> Option<&'static str> {
    let name = comparable_name(name);
    PARAMETERS.iter().find(|(long, _)| *long == name).map(|(_, short)| *short)
}

/// A projection. Parameters that have their default are left out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Projection {
    method: String,
    parameters: BTreeMap<String, f64>,
    /// Whether x grows to the west; `None` if the text does not say.
    westward: Option<bool>,
}

impl Projection {
    /// Returns the projection of a projected system.
    pub(crate) fn of(system: &WktNode) -> Option<Projection> {
        let conversion = system.child(&["CONVERSION", "DERIVINGCONVERSION"]).unwrap_or(system);
        let name = conversion.child(&["PROJECTION", "METHOD"])?.text(0)?;
        let method = if is_web_mercator(system) { WEB_MERCATOR } else { method(name).unwrap_or(name) };
        let metres = system.unit_metres().unwrap_or(1.0);
        let base = system.child(&["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"]);
        let angle = base.map_or(1.0, |base| degrees(base.unit()));
        let mut parameters = BTreeMap::new();
        for node in conversion.children().filter(|child| child.keyword == "PARAMETER") {
            let (long, value) = (node.text(0)?, node.number(1).filter(|value| value.is_finite())?);
            let name = parameter(long).map_or_else(|| comparable_name(long), str::to_string);
            let factor = match name.as_str() {
                "x_0" | "y_0" => node.unit_metres().unwrap_or(metres),
                "k_0" | "x_scale" | "y_scale" => 1.0,
                _ => node.unit().map_or(angle, |unit| degrees(Some(unit))),
            };
            parameters.insert(name, value * factor);
        }
        let mut projection = Projection { method: method.to_string(), parameters, westward: westward(system) };
        projection.normalise();
        Some(projection)
    }

    /// Writes what can be said in several ways in one of them.
    fn normalise(&mut self) {
        let parameters = &mut self.parameters;
        let get = |parameters: &BTreeMap<String, f64>, name: &str| parameters.get(name).copied();
        match self.method.as_str() {
            "lcc" | "aea" => {
                // A cone with one standard parallel touches there, at the origin if no parallel is named. The order says nothing.
                let origin = get(parameters, "lat_0").unwrap_or(0.0);
                let first = get(parameters, "lat_1").unwrap_or(origin);
                let second = get(parameters, "lat_2").unwrap_or(first);
                parameters.insert("lat_1".into(), first.max(second));
                parameters.insert("lat_2".into(), first.min(second));
            }
            "stere" => {
                if let Some(parallel) = parameters.remove("lat_1") {
                    parameters.insert("lat_0".into(), parallel);
                }
            }
            // The others are constants of the method. Some writers name them, and not all in the same way.
            "krovak" => parameters.retain(|name, _| ["lat_0", "lon_0", "k_0", "x_0", "y_0"].contains(&name.as_str())),
            WEB_MERCATOR => parameters.retain(|name, _| ["lon_0", "x_0", "y_0"].contains(&name.as_str())),
            _ => {}
        }
    }

    /// Says in what the two differ: what a sentence can name, as it is here and as it is in `other`.
    pub(crate) fn difference(&self, other: &Projection) -> Option<String> {
        if self.method != other.method {
            return Some(format!("the projection ({}, {})", self.method, other.method));
        }
        if matches!((self.westward, other.westward), (Some(own), Some(others)) if own != others) {
            return Some("the direction of the axes".into());
        }
        let mut names: Vec<&String> = self.parameters.keys().chain(other.parameters.keys()).collect();
        names.sort_unstable();
        names.dedup();
        let value = |of: &Projection, name: &str| of.parameters.get(name).copied().unwrap_or(default(name));
        let differs = |name: &&&String| (value(self, name) - value(other, name)).abs() > tolerance(name);
        let first = names.iter().find(differs)?;
        Some(format!("the {} ({}, {})", long_name(first), value(self, first), value(other, first)))
    }
}

/// Version 1 of the text has no name for this method. Writers add its definition for PROJ.4.
fn is_web_mercator(system: &WktNode) -> bool {
    let extension = system.child(&["EXTENSION"]).and_then(|extension| extension.text(1));
    extension.is_some_and(|text| text.contains("+proj=merc") && text.contains("+b=6378137"))
}

fn westward(system: &WktNode) -> Option<bool> {
    let axes = system.children().filter(|child| child.keyword == "AXIS");
    let directions: Vec<String> = axes.filter_map(|axis| axis.text(1)).map(str::to_ascii_lowercase).collect();
    let has = |direction: &str| directions.iter().any(|known| known == direction);
    (has("east") || has("west")).then(|| has("west"))
}

fn default(name: &str) -> f64 {
    if ["k_0", "x_scale", "y_scale"].contains(&name) { 1.0 } else { 0.0 }
}

fn tolerance(name: &str) -> f64 {
    match name {
        "x_0" | "y_0" => LENGTH_TOLERANCE,
        "k_0" | "x_scale" | "y_scale" => SCALE_TOLERANCE,
        _ => ANGLE_TOLERANCE,
    }
}

fn long_name(name: &str) -> &str {
    match name {
        "lon_0" => "longitude of the origin",
        "lat_0" => "latitude of the origin",
        "lat_1" | "lat_2" => "standard parallel",
        "k_0" => "scale factor",
        "x_0" => "false easting in metres",
        "y_0" => "false northing in metres",
        other => other,
    }
}
