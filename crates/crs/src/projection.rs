//! Map projections in one comparable form, whatever text describes them: the method by its name in PROJ.4, angles in degrees, lengths
//! in metres.

use crate::codes::SPHERICAL_ON_ELLIPSOID;
use crate::datum::Datum;
use crate::projection_names::{ORIGINS, PARALLELS, WEB_MERCATOR, method, parameter};
use crate::wkt::{BASE, WktNode, comparable_name, degrees};
use std::collections::BTreeMap;

/// What must agree for two systems to be the same: to within a centimetre. Writers round parameters by less, and two systems that
/// are in use differ by more.
const LENGTH_TOLERANCE: f64 = 0.01;
/// A centimetre on the ground.
const ANGLE_TOLERANCE: f64 = 1e-7;
/// A centimetre at a thousand kilometres from the origin.
const SCALE_TOLERANCE: f64 = 1e-8;

/// A projection. Parameters that have their default are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// The name in PROJ.4, or the comparable name of a method that is not known.
    method: String,
    /// The name in the text, for messages.
    label: String,
    parameters: BTreeMap<String, f64>,
    /// Whether x grows to the west; `None` if the text does not say.
    westward: Option<bool>,
    /// Whether y grows to the south; likewise.
    southward: Option<bool>,
}

impl Projection {
    /// Returns the projection of a projected system; `None` if the system does not say all of it.
    pub(crate) fn of(system: &WktNode) -> Option<Projection> {
        Projection::read(system)?.ok()
    }

    /// Returns the projection of a projected system, or says which parameter it lacks, or which cannot be read. Returns `None` if the
    /// system names no method.
    pub(crate) fn read(system: &WktNode) -> Option<Result<Projection, String>> {
        let conversion = system.child(&["CONVERSION", "DERIVINGCONVERSION"]).unwrap_or(system);
        let name = conversion.child(&["PROJECTION", "METHOD"])?.text(0)?;
        let comparable = comparable_name(name);
        let method = match method(name).unwrap_or(&comparable) {
            "merc" if is_web_mercator(system) => WEB_MERCATOR,
            "laea" if is_spherical(system) => "laea spherical",
            "cea" if is_spherical(system) => "cea spherical",
            method => method,
        };
        let parameters =
            parameters(system, conversion).and_then(|parameters| match missing(name, method, &parameters) {
                Some(missing) => Err(format!("it does not give {missing}")),
                None => contradiction(method, &parameters, system).map_or(Ok(parameters), Err),
            });
        Some(parameters.map(|parameters| {
            let (method, label) = (method.to_string(), name.to_string());
            let [westward, southward] = directions(system);
            let mut projection = Projection { method, label, parameters, westward, southward };
            projection.normalise(system);
            projection
        }))
    }

    /// Writes what can be said in several ways in one of them.
    fn normalise(&mut self, system: &WktNode) {
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
            "merc" => {
                if let Some(parallel) = parameters.remove("lat_1").filter(|parallel| *parallel != 0.0) {
                    parameters.insert("k_0".into(), scale_of(parallel, system));
                }
            }
            "omerc origin" | "omerc centre" => {
                // Where the text does not say it, the grid is turned so that north is up in the middle.
                let azimuth = get(parameters, "alpha").unwrap_or(0.0);
                parameters.entry("gamma".into()).or_insert(azimuth);
            }
            // The other parameters are constants of the method. Some writers name them, and not all in the same way.
            "krovak" => {
                const TURN: [&str; 3] = ["x_scale", "y_scale", "gamma"];
                let says_axes = TURN.iter().any(|name| parameters.contains_key(*name));
                let axes = esris_axes(TURN.map(|name| get(parameters, name).unwrap_or(default(name))));
                self.westward = axes.filter(|_| says_axes).or(self.westward);
                let is_said = |name: &str| axes.is_some() && TURN.contains(&name);
                let is_own =
                    |name: &str| ["lat_0", "lon_0", "k_0", "x_0", "y_0"].contains(&name) || TURN.contains(&name);
                parameters.retain(|name, _| is_own(name) && !is_said(name));
            }
            // Writers name parameters of Mercator's other variants, which say nothing as long as they have their defaults.
            WEB_MERCATOR => parameters
                .retain(|name, value| ["lon_0", "x_0", "y_0"].contains(&name.as_str()) || *value != default(name)),
            _ => {}
        }
    }

    /// Returns the projection in the words of PROJ.4, without ellipsoid and unit; `None` if these parameters are not all that it needs.
    pub(crate) fn proj4(&self) -> Option<String> {
        const METHODS: [&str; 7] = ["tmerc", "lcc", "aea", "laea", "merc", "sterea", "stere"];
        const NAMES: [&str; 7] = ["lon_0", "lat_0", "lat_1", "lat_2", "k_0", "x_0", "y_0"];
        let known = METHODS.contains(&self.method.as_str())
            && self.parameters.keys().all(|name| NAMES.contains(&name.as_str()));
        let (latitude, scale) = (self.value("lat_0"), self.value("k_0"));
        let is_odd = match self.method.as_str() {
            // Variants with another origin differ in where they count from.
            "merc" => latitude != 0.0,
            "stere" => latitude.abs() != 90.0 && scale != 1.0,
            _ => false,
        };
        if !known || is_odd || self.has_other_axes() {
            return None;
        }
        let word = |(name, value): (&String, &f64)| match (self.method.as_str(), name.as_str()) {
            ("stere", "lat_0") => pole_of(*value, self.is_named_polar()),
            _ => Some(format!(" +{name}={value}")),
        };
        let words = self.parameters.iter().map(word).collect::<Option<String>>()?;
        Some(format!("+proj={}{words}", self.method))
    }

    /// Returns the name of the method in PROJ.4, or one of that kind.
    pub fn method(&self) -> &str {
        &self.method
    }

    /// Returns the name of the method in the text.
    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    /// Returns whether the name of the method in the text says that it is around a pole.
    pub(crate) fn is_named_polar(&self) -> bool {
        comparable_name(&self.label).contains("pol")
    }

    /// Returns whether x grows to the west, or y to the south.
    pub(crate) fn has_other_axes(&self) -> bool {
        self.westward == Some(true) || self.southward == Some(true)
    }

    /// Returns whether x may grow to the west and y to the south: whether the text says no other directions.
    pub(crate) fn may_go_south_west(&self) -> bool {
        self.westward != Some(false) && self.southward != Some(false)
    }

    /// Returns the names of the parameters that are not left out.
    pub(crate) fn names(&self) -> impl Iterator<Item = &String> {
        self.parameters.keys()
    }

    /// Returns the value of a parameter, in degrees or metres.
    pub fn value(&self, name: &str) -> f64 {
        self.parameters.get(name).copied().unwrap_or(default(name))
    }

    /// Returns the false easting and northing in metres.
    pub fn false_origin(&self) -> [f64; 2] {
        ["x_0", "y_0"].map(|name| self.value(name))
    }

    /// Says in what the two differ: what a sentence can name, as it is here and as it is in `other`.
    pub(crate) fn difference(&self, other: &Projection) -> Option<String> {
        if self.method != other.method {
            return Some(format!("the projection ({}, {})", self.label, other.label));
        }
        let differs = |own: Option<bool>, others: Option<bool>| own.is_some() && others.is_some() && own != others;
        if differs(self.westward, other.westward) || differs(self.southward, other.southward) {
            return Some("the direction of the axes".into());
        }
        let mut names: Vec<&String> = self.parameters.keys().chain(other.parameters.keys()).collect();
        names.sort_unstable();
        names.dedup();
        let value = |of: &Projection, name: &str| of.value(name);
        let differs = |name: &&&String| distance(name, value(self, name), value(other, name)) > tolerance(name);
        let first = names.iter().find(differs)?;
        Some(format!("the {} ({}, {})", long_name(first), value(self, first), value(other, first)))
    }
}

/// Reads the parameters: angles in degrees, lengths in metres. Fails with what is wrong with the first that cannot be read.
fn parameters(system: &WktNode, conversion: &WktNode) -> Result<BTreeMap<String, f64>, String> {
    let metres = system.unit_metres().unwrap_or(1.0);
    let base = system.child(&["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"]);
    let angle = base.map_or(1.0, |base| degrees(base.unit()));
    let mut parameters = BTreeMap::new();
    for node in conversion.children().filter(|child| child.keyword == "PARAMETER") {
        let long = node.text(0).ok_or("it has a parameter without a name")?;
        let name = parameter(long).map_or_else(|| comparable_name(long), str::to_string);
        let factor = match name.as_str() {
            name if is_length(name) => node.unit().map_or(Some(metres), |_| node.unit_metres()),
            name if is_scale(name) => Some(1.0),
            _ => Some(node.unit().map_or(angle, |unit| degrees(Some(unit)))),
        };
        let value = node.number(1).zip(factor).map(|(value, factor)| value * factor);
        let value = value.filter(|value| value.is_finite()).ok_or_else(|| format!("its {long} is no number"))?;
        parameters.insert(name, value);
    }
    Ok(parameters)
}

/// Returns the method and the parameters of a projected system as it has them, to compare two that cannot be read.
pub(crate) fn projection_values(system: &WktNode) -> Vec<String> {
    let conversion = system.child(&["CONVERSION", "DERIVINGCONVERSION"]).unwrap_or(system);
    let method = conversion.child(&["PROJECTION", "METHOD"]).and_then(|method| method.text(0));
    let value = |node: &WktNode| {
        let long = comparable_name(node.text(0).unwrap_or_default());
        let value =
            node.number(1).map_or_else(|| node.text(1).unwrap_or("no number").to_string(), |value| value.to_string());
        format!("{} = {value}", parameter(&long).unwrap_or(&long))
    };
    let parameters = conversion.children().filter(|child| child.keyword == "PARAMETER").map(value);
    let mut all: Vec<String> = method.map(comparable_name).into_iter().chain(parameters).collect();
    all.sort_unstable();
    all
}

/// Returns the first parameter that a method needs and the text lacks, in words.
fn missing(name: &str, method: &str, parameters: &BTreeMap<String, f64>) -> Option<String> {
    let has = |name: &str| parameters.contains_key(name);
    let origins = ORIGINS.iter().filter(|(known, _)| *known == method).flat_map(|(_, needed)| needed.iter());
    let lost = origins.copied().find(|any| !any.iter().any(|name| has(name))).and_then(|any| any.first().copied());
    let name = comparable_name(name);
    let parallels = PARALLELS.iter().filter(|(known, _)| *known == name).flat_map(|(_, needed)| needed.iter());
    let lost = lost.or_else(|| parallels.copied().find(|name| !has(name)))?;
    Some(format!("the {}", long_name(lost)))
}

/// Says which two parameters contradict each other, if two do.
fn contradiction(method: &str, parameters: &BTreeMap<String, f64>, system: &WktNode) -> Option<String> {
    if let Some(words) = extension(system).filter(|_| method == "merc" && is_spherical_extension(system)) {
        return Some(format!("its extension ({words}) is an unknown projection"));
    }
    let (parallel, scale) = (parameters.get("lat_1")?, parameters.get("k_0")?);
    // Some writers give a scale of 1 beside the parallel, which says the scale.
    let is_idle = *parallel == 0.0 || *scale == 1.0;
    let agree = || (scale_of(*parallel, system) - scale).abs() <= SCALE_TOLERANCE;
    (method == "merc" && !is_idle && !agree())
        .then(|| format!("its standard parallel {parallel} and its scale factor {scale} contradict each other"))
}

/// Returns the definition for PROJ.4 that some writers add to a text of version 1.
fn extension(system: &WktNode) -> Option<&str> {
    system.child(&["EXTENSION"]).and_then(|extension| extension.text(1))
}

/// Returns whether the definition that a writer has added is a Mercator projection by the formulas of the earth's sphere.
fn is_spherical_extension(system: &WktNode) -> bool {
    extension(system).is_some_and(|text| text.contains("+proj=merc") && text.contains("+b=6378137"))
}

/// Version 1 of the text has no name for this method. Writers add its definition for PROJ.4.
fn is_web_mercator(system: &WktNode) -> bool {
    let word = |name: &str| {
        let words = extension(system).unwrap_or_default().split_whitespace();
        words.filter_map(|word| word.strip_prefix('+')?.split_once('=')).find(|(known, _)| *known == name)
    };
    let is = |name: &str, wanted: f64| word(name).is_none_or(|(_, value)| value.parse() == Ok(wanted));
    let is_true_to_scale = is("k", 1.0) && is("k_0", 1.0) && is("lat_ts", 0.0);
    is_spherical_extension(system) && is("a", 6_378_137.0) && is("b", 6_378_137.0) && is_true_to_scale
}

/// Returns whether the code of a system says that its map has the formulas of a sphere.
fn is_spherical(system: &WktNode) -> bool {
    system.epsg().is_some_and(|code| SPHERICAL_ON_ELLIPSOID.contains(&code))
}

/// Returns whether x grows to the west, and whether y grows to the south; `None` where the text does not say. Around a pole, both axes
/// may go the same way, each along another meridian: that says neither.
fn directions(system: &WktNode) -> [Option<bool>; 2] {
    let axes = system.children().filter(|child| child.keyword == "AXIS");
    let words: Vec<String> = axes.filter_map(|axis| axis.text(1)).map(str::to_ascii_lowercase).collect();
    let has = |direction: &str| words.iter().any(|known| known == direction);
    if !has("east") && !has("west") {
        return [None, None];
    }
    [Some(has("west")), (has("north") || has("south")).then(|| has("south"))]
}

/// Returns whether x grows to the west by the scales and the turn of the axes in ESRI's texts of Krovak's projection; `None` if they are
/// neither those of south and west nor those of east and north.
fn esris_axes(turn: [f64; 3]) -> Option<bool> {
    let is = |known: [f64; 3]| turn.iter().zip(known).all(|(own, known)| (own - known).abs() < 1e-9);
    if is([1.0, 1.0, 0.0]) { Some(true) } else { is([-1.0, 1.0, 90.0]).then_some(false) }
}

fn default(name: &str) -> f64 {
    if is_scale(name) { 1.0 } else { 0.0 }
}

/// Returns the words for the origin of a polar stereographic projection: the pole itself, or the one next to the parallel that is true to
/// scale; `None` if it is around another place.
fn pole_of(latitude: f64, is_named_polar: bool) -> Option<String> {
    if latitude.abs() == 90.0 {
        return Some(format!(" +lat_0={latitude}"));
    }
    let pole = if latitude < 0.0 { -90 } else { 90 };
    (is_named_polar && latitude != 0.0).then(|| format!(" +lat_0={pole} +lat_ts={latitude}"))
}

/// Returns how far two values of a parameter are apart. A whole turn is nothing.
fn distance(name: &str, own: f64, other: f64) -> f64 {
    let apart = (own - other).abs();
    if is_length(name) || is_scale(name) { apart } else { (apart % 360.0).min(360.0 - apart % 360.0) }
}

/// Returns the scale at the equator of a Mercator projection that is true to scale at the parallel, on the ellipsoid of `system`.
fn scale_of(parallel: f64, system: &WktNode) -> f64 {
    scale_at(parallel, system.child(&BASE).and_then(Datum::of).and_then(|base| base.ellipsoid()))
}

/// Returns the scale at the equator of a Mercator projection that is true to scale at the parallel.
fn scale_at(parallel: f64, ellipsoid: Option<[f64; 2]>) -> f64 {
    let eccentricity = ellipsoid.map_or(0.0, |[greater, lesser]| 1.0 - (lesser / greater) * (lesser / greater));
    let parallel = parallel * (std::f64::consts::PI / 180.0);
    let (sine, cosine) = (libm::sin(parallel), libm::cos(parallel));
    cosine / (1.0 - eccentricity * sine * sine).sqrt()
}

fn is_length(name: &str) -> bool {
    ["x_0", "y_0", "h_0"].contains(&name)
}

fn is_scale(name: &str) -> bool {
    ["k_0", "x_scale", "y_scale"].contains(&name)
}

fn tolerance(name: &str) -> f64 {
    match name {
        name if is_length(name) => LENGTH_TOLERANCE,
        name if is_scale(name) => SCALE_TOLERANCE,
        _ => ANGLE_TOLERANCE,
    }
}

fn long_name(name: &str) -> &str {
    match name {
        "lon_0" => "longitude of the origin",
        "lat_0" => "latitude of the origin",
        "lat_1" | "lat_2" => "standard parallel",
        "k_0" => "scale factor",
        "alpha" => "azimuth",
        "gamma" => "angle between the grid and the oblique line",
        "x_scale" | "y_scale" => "scale of an axis",
        "x_0" => "false easting in metres",
        "y_0" => "false northing in metres",
        "h_0" => "height of the plane in metres",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wkt::{PROJECTED, find};

    #[test]
    fn the_axes_of_krovak_are_those_of_esris_parameters() {
        let read = |turn: &str| {
            let text = format!(
                r#"PROJCS["S-JTSK_Krovak",GEOGCS["GCS_S_JTSK",DATUM["D_S_JTSK",SPHEROID["Bessel_1841",6377397.155,299.1528128]],
                PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Krovak"],PARAMETER["False_Easting",0.0],
                PARAMETER["False_Northing",0.0],PARAMETER["Pseudo_Standard_Parallel_1",78.5],PARAMETER["Scale_Factor",0.9999],
                PARAMETER["Azimuth",30.2881397527778],PARAMETER["Longitude_Of_Center",24.8333333333333],
                PARAMETER["Latitude_Of_Center",49.5],{turn}UNIT["Meter",1.0]]"#
            );
            Projection::of(&find(&text, &PROJECTED).unwrap()).unwrap()
        };
        let turn = |x: f64, y: f64, angle: f64| {
            read(&format!(
                r#"PARAMETER["X_Scale",{x:.1}],PARAMETER["Y_Scale",{y:.1}],PARAMETER["XY_Plane_Rotation",{angle:.1}],"#
            ))
        };
        let of_code =
            |code| Projection::of(&find(crs_definitions::from_code(code).unwrap().wkt, &PROJECTED).unwrap()).unwrap();
        let (south_west, east_north, odd) = (turn(1.0, 1.0, 0.0), turn(-1.0, 1.0, 90.0), turn(1.0, 1.0, 90.0));
        let direction = Some("the direction of the axes".to_string());
        assert_eq!(south_west.difference(&east_north), direction);
        assert_eq!(
            (south_west.difference(&of_code(5514)), east_north.difference(&of_code(5513))),
            (direction.clone(), direction)
        );
        assert_eq!((south_west.difference(&of_code(5513)), east_north.difference(&of_code(5514))), (None, None));
        assert!(odd.difference(&south_west).is_some() && odd.difference(&east_north).is_some());
        // A text that does not say it agrees with both.
        assert_eq!((read("").difference(&south_west), read("").difference(&east_north)), (None, None));
    }

    #[test]
    fn every_projection_with_a_code_says_all_of_it() {
        let mut known = 0;
        for code in 1..=u16::MAX {
            let Some(system) = crs_definitions::from_code(code).and_then(|crs| find(crs.wkt, &PROJECTED)) else {
                continue;
            };
            if let Some(read) = Projection::read(&system) {
                known += 1;
                assert!(read.is_ok(), "EPSG:{code}: {read:?}");
            }
        }
        assert!(known > 4_000, "{known}");
    }
}
