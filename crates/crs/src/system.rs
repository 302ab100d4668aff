//! What a file says about its coordinate reference system, and whether two files agree.

use serde::{Deserialize, Serialize};

use crate::codes::text_of_code;
use crate::datum::Sameness;
use crate::form::CrsForm;
use crate::proj4;
use crate::projection::projection_values;
use crate::unit::{Unit, same_length};
use crate::vertical::VerticalSystem;
use crate::wkt::{PROJECTED, comparable_name, find};

/// The name that version 2 of the text gives to an axis of heights above the ellipsoid.
const ELLIPSOIDAL_AXIS: &str = "axis[\"ellipsoidal height";

/// What stands for a name where the writer knew none, as `comparable_name` spells it.
const NO_NAMES: [&str; 6] = ["", "unknown", "unnamed", "undefined", "userdefined", "none"];

/// What a file says about its coordinate reference system.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crs {
    /// Its well-known text, version 1 or 2. If the file has only a code or keys, this is the text of these.
    pub wkt: Option<String>,
    /// The EPSG code of the horizontal system.
    pub epsg: Option<u32>,
    /// What its coordinates are.
    pub kind: CrsKind,
    /// The unit of x and y.
    pub horizontal: Unit,
    /// The length of one unit of z in metres, if the file gives it.
    pub vertical: Option<f64>,
    /// The system that heights count in, if the file gives it.
    pub vertical_system: Option<VerticalSystem>,
    /// The name of the horizontal system.
    pub name: Option<String>,
    /// What the GeoTIFF keys say of a projection that nothing here can read: `key=value`, by which two such systems can be compared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unread_keys: Vec<String>,
}

/// What the coordinates of a system are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CrsKind {
    /// Lengths on a map.
    Projected,
    /// Longitude and latitude.
    Geographic,
    /// Lengths from the middle of the earth.
    Geocentric,
    /// Lengths from some place.
    Local,
    /// The file does not say.
    #[default]
    Unknown,
}

impl CrsKind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            CrsKind::Projected => "projected",
            CrsKind::Geographic => "longitude and latitude",
            CrsKind::Geocentric => "geocentric",
            CrsKind::Local => "local",
            CrsKind::Unknown => "unknown",
        }
    }
}

impl Crs {
    /// Returns the length of one unit of x and y in metres; `None` for degrees and for an unknown unit.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.horizontal.metres_per_unit()
    }

    /// Returns the length of the unit of heights in metres: what is said, or else that of the plane, or the metre.
    pub fn metres_per_unit_of_height(&self) -> f64 {
        self.vertical.or(self.metres_per_unit()).unwrap_or(1.0)
    }

    /// Returns whether it says where the coordinates are. One that knows only a unit does not, nor does a name such as "unknown".
    pub fn is_named(&self) -> bool {
        self.epsg.is_some() || !self.unread_keys.is_empty() || self.own_name().is_some() || self.form().is_some()
    }

    /// Returns whether nothing says that the two systems differ. That does not mean that they are the same: see [`Crs::sameness`].
    #[cfg(test)]
    pub(crate) fn same_as(&self, other: &Crs) -> bool {
        self.differences(other).is_empty()
    }

    /// Returns how sure it is that x and y mean the same place in both.
    pub fn sameness(&self, other: &Crs) -> Sameness {
        let plane = |crs: &Crs| Crs { vertical: None, vertical_system: None, ..crs.clone() };
        let [own, others] = [self, other].map(plane);
        ComparableCrs::of(&own).sameness(&ComparableCrs::of(&others))
    }

    /// Returns in what the two systems differ, or in what they cannot be compared, in words that a sentence can name. What one file
    /// does not say agrees with anything.
    ///
    /// Datums and projections are compared by what they are, not by the name of the system. If both have the same EPSG code, the names
    /// of the datums do not count.
    pub fn differences(&self, other: &Crs) -> Vec<String> {
        ComparableCrs::of(self).differences(&ComparableCrs::of(other))
    }

    /// Returns the names of the datums of two systems, for a sentence.
    pub fn names_of_datums(&self, other: &Crs) -> String {
        let name = |crs: &Crs| crs.form().and_then(|form| form.datum_name().map(str::to_string));
        let [own, others] = [self, other].map(|crs| name(crs).unwrap_or_else(|| "an unnamed datum".into()));
        format!("{own} and {others}")
    }

    /// Says why a system has no form by which it could be compared or computed.
    pub(crate) fn why_without_form(&self) -> String {
        match (self.epsg, self.kind) {
            (Some(code), _) if text_of_code(code).is_none() => format!("EPSG:{code} is not in the list of known codes"),
            (_, CrsKind::Geographic) => {
                format!("{} has no readable datum or angular unit", self.label())
            }
            _ => format!("{} has no readable projection", self.label()),
        }
    }

    fn differences_besides_place(&self, other: &Crs) -> Vec<String> {
        let mut found = Vec::new();
        if !same_unit(self.horizontal, other.horizontal) {
            found.push(format!("the unit of x and y ({}, {})", self.horizontal.name(), other.horizontal.name()));
        }
        if let (Some(own), Some(others)) = (self.vertical, other.vertical)
            && !same_length(own, others)
        {
            let name = |metres| Unit::from_metres(Some(metres)).name();
            found.push(format!("the unit of height ({}, {})", name(own), name(others)));
        }
        let vertical = self.vertical_system.as_ref().zip(other.vertical_system.as_ref());
        found.extend(vertical.and_then(|(own, others)| own.difference(others)));
        found
    }

    /// Returns what the system is compared by. A text says more than a code.
    pub fn form(&self) -> Option<CrsForm> {
        let text = self.wkt.as_deref().and_then(CrsForm::of_text);
        text.or_else(|| CrsForm::of_code(self.epsg?))
    }

    /// Returns its comparable name, if that is the name of something.
    fn own_name(&self) -> Option<String> {
        self.name.as_deref().map(comparable_name).filter(|name| !NO_NAMES.contains(&name.as_str()))
    }

    fn comparable_name(&self) -> Option<String> {
        let name = self.own_name();
        let keys = || (!self.unread_keys.is_empty()).then(|| self.unread_keys.concat());
        name.or_else(|| self.epsg.map(|code| format!("epsg{code}"))).or_else(keys)
    }

    /// Returns what defines a system that has no comparable form: the values of its keys, or of its text.
    fn unread(&self) -> Vec<String> {
        let Some(system) = self.wkt.as_deref().and_then(|text| find(text, &PROJECTED)) else {
            return self.unread_keys.clone();
        };
        projection_values(&system)
    }

    /// Returns the system's definition as a PROJ.4 string, from which longitude and latitude can be computed; `None` if neither
    /// the code nor the text gives one.
    pub fn proj4_definition(&self) -> Option<String> {
        // A code whose text says otherwise is not what the coordinates are in.
        proj4::definition(self.undisputed_code(), self.wkt.as_deref())
    }

    /// Returns the name of the vertical system, if the file gives one.
    pub fn vertical_name(&self) -> Option<String> {
        self.vertical_system.as_ref()?.name.clone()
    }

    /// Returns whether something says that heights count from the ellipsoid: the system of heights, or a third axis of the system of places.
    pub fn has_ellipsoidal_heights(&self) -> bool {
        let third_axis =
            || self.wkt.as_deref().is_some_and(|text| text.to_ascii_lowercase().contains(ELLIPSOIDAL_AXIS));
        self.vertical_system.as_ref().map_or_else(third_axis, VerticalSystem::is_ellipsoidal)
    }

    /// Returns a short name for messages.
    pub fn label(&self) -> String {
        match (&self.name, self.epsg) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name.clone(),
            (None, Some(code)) => format!("EPSG:{code}"),
            (None, None) if !self.unread_keys.is_empty() => "a projection that GeoTIFF keys define".to_string(),
            (None, None) => "unknown".to_string(),
        }
    }
}

/// A system that has been taken apart, to be compared with many others.
pub struct ComparableCrs<'a> {
    crs: &'a Crs,
    form: Option<CrsForm>,
}

impl<'a> ComparableCrs<'a> {
    /// Takes the system apart.
    pub fn of(crs: &'a Crs) -> ComparableCrs<'a> {
        ComparableCrs { crs, form: crs.form() }
    }

    /// Returns the name of the datum, if the system says one.
    pub fn datum_name(&self) -> Option<&str> {
        self.form.as_ref()?.datum_name()
    }

    /// Returns whether the system says its projection, but not the name of its datum.
    pub fn lacks_datum(&self) -> bool {
        self.form.is_some() && self.datum_name().is_none()
    }

    /// Returns whether nothing but its name, its code or its keys says where its coordinates are.
    pub fn is_known_by_name(&self) -> bool {
        self.form.is_none()
    }

    /// Returns a text that is the same for two systems only if they agree, and differ from the same systems in the same way.
    pub fn kind(&self) -> String {
        let crs = self.crs;
        let names = self.form.is_none().then(|| (crs.name.as_ref(), crs.unread()));
        let besides = (crs.horizontal, crs.vertical, &crs.vertical_system);
        format!("{:?}", (crs.kind, crs.epsg, &self.form, names, besides))
    }

    /// As [`Crs::differences`].
    pub fn differences(&self, other: &ComparableCrs) -> Vec<String> {
        let (own, others) = (self.crs.kind, other.crs.kind);
        if own != others && own != CrsKind::Unknown && others != CrsKind::Unknown {
            return vec![format!("the kind of coordinates ({}, {})", own.name(), others.name())];
        }
        let mut found = self.differences_in_place(other);
        found.extend(self.crs.differences_besides_place(other.crs));
        found
    }

    /// Returns how sure it is that x, y and the units are the same in both. Of a system without a comparable form, only an equal
    /// code, an equal name or equal keys tell that.
    fn sameness(&self, other: &ComparableCrs) -> Sameness {
        let differences = self.differences(other);
        if !differences.is_empty() {
            return Sameness::Refuted(differences.join(" and "));
        }
        let (own, others) = (self.crs, other.crs);
        if own.epsg.is_some() && own.epsg == others.epsg {
            return Sameness::Known;
        }
        let same_name = own.own_name().is_some() && own.own_name() == others.own_name();
        match (&self.form, &other.form) {
            (Some(own), Some(others)) => own.sameness(others),
            (None, None) if !own.unread().is_empty() && own.unread() == others.unread() => Sameness::Known,
            _ if same_name => Sameness::Known,
            (form, _) => Sameness::Refuted(if form.is_none() { own } else { others }.why_without_form()),
        }
    }

    fn differences_in_place(&self, other: &ComparableCrs) -> Vec<String> {
        let same_code = self.crs.epsg.is_some() && self.crs.epsg == other.crs.epsg;
        match (&self.form, &other.form) {
            (Some(own), Some(others)) if same_code => own.differences_in_parameters(others),
            (Some(own), Some(others)) => own.differences(others),
            _ if same_code => Vec::new(),
            _ => self.doubt(other).into_iter().collect(),
        }
    }

    /// Says why two systems are taken to differ of which at least one has no form.
    fn doubt(&self, other: &ComparableCrs) -> Option<String> {
        let (own, others) = (self.crs, other.crs);
        let unclear = if self.form.is_none() { own } else { others };
        let reason = unclear.why_without_form();
        if let (Some(code), Some(other_code)) = (own.epsg, others.epsg) {
            return Some(format!("the code (EPSG:{code}, EPSG:{other_code}), and {reason}"));
        }
        if self.form.is_none() && other.form.is_none() {
            let (own, others) = (own.unread(), others.unread());
            let only = |these: &[String], those: &[String]| these.iter().find(|value| !those.contains(value)).cloned();
            let lost = || "nothing".to_string();
            if own != others && !own.is_empty() && !others.is_empty() {
                let (first, second) = (only(&own, &others), only(&others, &own));
                let (first, second) = (first.unwrap_or_else(lost), second.unwrap_or_else(lost));
                return Some(format!("the definition of the projection ({first}, {second})"));
            }
            if own == others && !own.is_empty() {
                return None;
            }
        }
        // Two of which one is not known can only agree by name.
        let names = (own.comparable_name(), others.comparable_name());
        let doubtful = matches!(&names, (Some(own), Some(others)) if own != others);
        doubtful.then(|| format!("the name, and {reason}"))
    }
}

fn same_unit(own: Unit, others: Unit) -> bool {
    match (own, others) {
        (Unit::Unknown, _) | (_, Unit::Unknown) => true,
        (Unit::Other(own), Unit::Other(others)) => same_length(own, others),
        (own, others) => own == others,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_wkt::{from_epsg, parse};

    #[test]
    fn unknown_parts_agree_and_different_parts_do_not() {
        let utm = from_epsg(26915).unwrap();
        let named = Crs { epsg: None, ..utm.clone() };
        assert!(Crs::default().same_as(&utm) && utm.same_as(&Crs::default()));
        assert!(utm.same_as(&named) && named.same_as(&utm));
        assert!(!utm.same_as(&from_epsg(26916).unwrap()));
        assert!(!named.same_as(&Crs { epsg: None, ..from_epsg(26916).unwrap() }));
        assert!(!utm.same_as(&Crs { horizontal: Unit::Foot, ..utm.clone() }));
        assert!(!Crs { vertical: Some(1.0), ..utm.clone() }.same_as(&Crs { vertical: Some(0.3048), ..utm.clone() }));
    }

    /// ESRI's text of a UTM zone, without a code.
    fn esri(system: &str, datum: &str, spheroid: &str, meridian: f64) -> Crs {
        let text = format!(
            r#"PROJCS["{system}",GEOGCS["GCS_{datum}",DATUM["D_{datum}",SPHEROID[{spheroid}]],PRIMEM["Greenwich",0.0],
            UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],
            PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",{meridian:.1}],PARAMETER["Scale_Factor",0.9996],
            PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#
        );
        parse(&text).unwrap()
    }

    const CLARKE: &str = r#""Clarke_1866",6378206.4,294.9786982"#;
    const GRS80: &str = r#""GRS_1980",6378137.0,298.257222101"#;

    #[test]
    fn esri_texts_without_codes_are_told_apart_by_their_datum_and_agree_with_the_code() {
        let old = esri("UTM_15N", "North_American_1927", CLARKE, -93.0);
        let new = esri("UTM_15N", "North_American_1983", GRS80, -93.0);
        assert_eq!(old.differences(&new), ["the datum (GCS_North_American_1927, GCS_North_American_1983)"]);
        let [nad27, nad83, nad83_2011] = [26715, 26915, 6344].map(|code| from_epsg(code).unwrap());
        assert!(old.same_as(&nad27) && new.same_as(&nad83));
        assert_eq!(old.differences(&nad83).len(), 1);
        assert!(esri("NAD_1983_2011_UTM_Zone_15N", "NAD_1983_2011", GRS80, -93.0).same_as(&nad83_2011));
        let zone_16 = esri("UTM_15N", "North_American_1983", GRS80, -87.0);
        assert_eq!(new.differences(&zone_16), ["the longitude of the origin (-93, -87)"]);
        // WGS 84 has the same ellipsoid to a tenth of a millimetre.
        let wgs84 = from_epsg(32615).unwrap();
        assert_eq!(nad83.differences(&wgs84), ["the datum (NAD83, WGS 84)"]);
    }

    #[test]
    fn codes_of_one_system_agree_and_so_do_its_ways_to_be_written() {
        let same = |own: u32, other: u32| from_epsg(own).unwrap().same_as(&from_epsg(other).unwrap());
        // ETRS89 / UTM 32N, with northings first, with heights, and with the zone in the easting.
        assert!(same(25832, 3044) && same(25832, 5972));
        assert!(!same(25832, 4647));
        // Two axes west and south.
        assert!(!same(5513, 5514));
        let of_code = from_epsg(2154).unwrap();
        let text = r#"PROJCRS["Lambert",BASEGEOGCRS["x",DATUM["Reseau Geodesique Francais 1993",ELLIPSOID["GRS 1980",6378137,
            298.2572221]]],CONVERSION["c",METHOD["Lambert Conic Conformal (2SP)"],PARAMETER["Latitude of false origin",46.5],
            PARAMETER["Longitude of false origin",3],PARAMETER["Latitude of 1st standard parallel",44],
            PARAMETER["Latitude of 2nd standard parallel",49],PARAMETER["Easting at false origin",700000],
            PARAMETER["Northing at false origin",6600000]],CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]"#;
        assert_eq!(parse(text).unwrap().differences(&of_code), [""; 0]);
        let moved = parse(&text.replace("6600000", "6600000.1")).unwrap();
        assert_eq!(moved.differences(&of_code), ["the false northing in metres (6600000.1, 6600000)"]);
    }

    #[test]
    fn esris_text_agrees_with_the_code_of_the_same_system() {
        let texts: Vec<(u32, Crs)> = include_str!("codes/esri_texts.tsv")
            .lines()
            .map(|line| {
                line.split_once('\t').map(|(code, text)| (code.parse().unwrap(), parse(text).unwrap())).unwrap()
            })
            .collect();
        assert!(texts.len() > 20);
        for (index, (code, crs)) in texts.iter().enumerate() {
            assert_eq!(crs.differences(&from_epsg(*code).unwrap()), [""; 0], "EPSG:{code}");
            for (other, others) in &texts[index + 1..] {
                assert!(!crs.same_as(others), "EPSG:{code}, EPSG:{other}");
            }
        }
    }

    #[test]
    fn one_code_with_other_parameters_is_another_system() {
        let right = from_epsg(31467).unwrap();
        let text = right
            .wkt
            .clone()
            .unwrap()
            .replace("3500000", "4500000")
            .replace("\"central_meridian\",9", "\"central_meridian\",12");
        let wrong = Crs { epsg: Some(31467), ..parse(&text).unwrap() };
        assert_eq!(right.differences(&wrong), ["the longitude of the origin (9, 12)"]);
        assert_eq!(right.problems(), [""; 0]);
        let doubt = "its text and its code EPSG:31467 differ in the longitude of the origin (12, 9); the text is used";
        assert_eq!(wrong.problems(), [doubt]);
        // The code would place it elsewhere.
        assert!(!wrong.proj4_definition().unwrap_or_default().contains("+lon_0=9 "), "{:?}", wrong.proj4_definition());
        // The dataset has renamed this datum, and the code is still the same.
        let renamed = parse(&right.wkt.clone().unwrap().replace("DHDN", "Main triangle net")).unwrap();
        assert!(right.same_as(&Crs { epsg: Some(31467), ..renamed }));
    }

    #[test]
    fn two_codes_that_are_not_in_the_list_differ_whatever_the_name() {
        let coded = |code| Crs { epsg: Some(code), name: Some("Local".into()), ..Crs::default() };
        assert!(coded(65_001).same_as(&coded(65_001)));
        let found = coded(65_001).differences(&coded(65_002));
        assert_eq!(found, ["the code (EPSG:65001, EPSG:65002), and EPSG:65001 is not in the list of known codes"]);
        assert_eq!(from_epsg(26915).unwrap().differences(&coded(65_001)).len(), 1);
    }

    #[test]
    fn texts_that_lack_a_parameter_are_compared_by_those_that_they_have() {
        let text = |easting: u32| {
            parse(&format!(
                r#"PROJCS["My grid",GEOGCS["g"],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",{easting}],UNIT["metre",1]]"#
            ))
            .unwrap()
        };
        assert!(text(1).same_as(&text(1)));
        assert_eq!(text(1).differences(&text(2)), ["the definition of the projection (x_0 = 1, x_0 = 2)"]);
    }

    #[test]
    fn what_cannot_be_compared_is_a_difference_unless_the_names_agree() {
        let named = |name: &str| Crs { name: Some(name.into()), ..Crs::default() };
        let utm = from_epsg(26915).unwrap();
        assert!(named("City grid").same_as(&named("city_grid")));
        assert!(named("NAD83 / UTM zone 15N").same_as(&utm));
        let doubt = utm.differences(&named("City grid"));
        assert!(doubt.len() == 1 && doubt[0].contains("City grid"), "{doubt:?}");
    }

    #[test]
    fn geocentric_systems_are_known_by_code_and_by_either_version_of_the_text() {
        let version_2 = r#"GEODCRS["WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563]],
            CS[Cartesian,3],AXIS["(X)",geocentricX],AXIS["(Y)",geocentricY],AXIS["(Z)",geocentricZ],LENGTHUNIT["metre",1]]"#;
        for crs in [from_epsg(4978), parse(version_2)] {
            let crs = crs.unwrap();
            assert_eq!((crs.kind, crs.horizontal), (CrsKind::Geocentric, Unit::Metre));
        }
        assert_eq!(from_epsg(4979).unwrap().kind, CrsKind::Geographic);
    }
}
