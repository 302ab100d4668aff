//! The datum of a system in a comparable form: its names and codes, the ellipsoid and the prime meridian.

use crate::datum_names::{datum_name, is_known};
use crate::wkt::{DATUM, WktNode, degrees};

/// Ellipsoids that are in use differ by metres, or by less than a millimetre. Then only names tell the datums apart.
const ELLIPSOID_TOLERANCE: f64 = 1.0;

/// In degrees: a tenth of a metre. Writers round the meridian of Paris to less.
const MERIDIAN_TOLERANCE: f64 = 1e-6;

/// A centimetre or two on the ground, in metres, seconds of arc and millionths.
const SHIFT_TOLERANCES: [f64; 7] = [0.02, 0.02, 0.02, 5e-4, 5e-4, 5e-4, 3e-3];

/// The datums that agree with WGS 84 to a metre or two, by the beginning of their comparable names.
const CLOSE_TO_WGS84: [&str; 16] = [
    "wgs84",
    "nad83",
    "etrs89",
    "rgf93",
    "gda94",
    "gda2020",
    "jgd2000",
    "jgd2011",
    "itrf",
    "sweref99",
    "nzgd2000",
    "sirgas2000",
    "cgcs2000",
    "kgd2002",
    "hartebeesthoek94",
    "regven",
];

/// Those of them that do not agree with each other: in 2011 an earthquake moved the north of Japan by up to five metres.
const APART: (&str, &str) = ("jgd2000", "jgd2011");

/// How sure it is that two things are one. That nothing says they differ is not enough.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sameness {
    /// They are known to be the same.
    Known,
    /// Nothing says that they differ, and at least one of them does not say what it is.
    Assumed,
    /// They differ, or cannot be compared. The text says in what.
    Refuted(String),
}

/// A datum.
#[derive(Clone, Debug, PartialEq)]
pub struct Datum {
    /// The first name, for messages.
    label: Option<String>,
    /// The comparable name of the geographic system.
    system: Option<String>,
    /// The comparable name of the datum.
    datum: Option<String>,
    /// The EPSG codes of the geographic system and of the datum.
    codes: [Option<u32>; 2],
    /// The greater and the lesser half axis in metres.
    ellipsoid: Option<[f64; 2]>,
    /// Degrees east of Greenwich.
    meridian: f64,
    /// The seven parameters of the way to WGS 84: metres, seconds of arc, millionths.
    shift: Option<[f64; 7]>,
}

impl Datum {
    /// Returns the datum of a geographic or geocentric system; `None` if it says none, or not where its longitudes begin.
    pub(crate) fn of(system: &WktNode) -> Option<Datum> {
        let datum = system.child(&DATUM)?;
        let spheroid = datum.child(&["SPHEROID", "ELLIPSOID"]);
        let texts: Vec<&str> = [system.text(0), datum.text(0)].into_iter().flatten().collect();
        let meridian = match system.child(&["PRIMEM", "PRIMEMERIDIAN"]) {
            Some(meridian) => {
                meridian.number(1).map(|value| value * degrees(meridian.unit())).filter(|east| east.is_finite())?
            }
            None => 0.0,
        };
        Some(Datum {
            label: texts.iter().find(|text| datum_name(text).is_some()).map(|text| text.to_string()),
            system: system.text(0).and_then(datum_name),
            datum: datum.text(0).and_then(datum_name),
            codes: [system.epsg(), datum.epsg()],
            ellipsoid: spheroid.and_then(half_axes),
            meridian,
            shift: datum.child(&["TOWGS84"]).map(|shift| std::array::from_fn(|k| shift.number(k).unwrap_or(0.0))),
        })
    }

    /// Returns whether the datum agrees with WGS 84 to a metre or two.
    pub(crate) fn is_close_to_wgs84(&self) -> bool {
        self.names().any(|name| CLOSE_TO_WGS84.iter().any(|close| name.starts_with(close)))
    }

    /// Returns whether the two agree to a metre or two, because each agrees with WGS 84.
    pub(crate) fn is_close_to(&self, other: &Datum) -> bool {
        let is_apart = |own: &Datum, others: &Datum| own.is_named_like(APART.0) && others.is_named_like(APART.1);
        let all_close = self.is_close_to_wgs84() && other.is_close_to_wgs84();
        all_close && !is_apart(self, other) && !is_apart(other, self)
    }

    /// Returns its name; `None` if its ellipsoid is all that is known.
    pub(crate) fn name(&self) -> Option<&str> {
        self.label.as_deref()
    }

    /// Returns its prime meridian in degrees east of Greenwich.
    pub fn meridian(&self) -> f64 {
        self.meridian
    }

    /// Returns whether one of its comparable names begins so.
    pub(crate) fn is_named_like(&self, start: &str) -> bool {
        self.names().any(|name| name.starts_with(start))
    }

    /// Returns its half axes in metres.
    pub(crate) fn ellipsoid(&self) -> Option<[f64; 2]> {
        self.ellipsoid
    }

    /// Takes the way to WGS 84 that stands outside of the datum, in a bound system.
    pub(crate) fn set_shift(&mut self, shift: Option<[f64; 7]>) {
        self.shift = self.shift.or(shift);
    }

    fn names(&self) -> impl Iterator<Item = &String> {
        self.system.iter().chain(&self.datum)
    }

    /// Returns how sure it is that the two are one, wherever longitudes begin. A datum without a name may be any that has its ellipsoid,
    /// unless one of the two has a way to WGS 84 that the other one lacks.
    pub(crate) fn sameness(&self, other: &Datum) -> Sameness {
        let is_nameless = |datum: &Datum| datum.names().next().is_none();
        let lacks_name = is_nameless(self) || is_nameless(other);
        if let Some(difference) = self.difference_in_frame(other) {
            return Sameness::Refuted(difference);
        }
        if lacks_name && let Some(difference) = self.difference_in_lone_shift(other) {
            return Sameness::Refuted(difference);
        }
        let has_both_shifts = self.shift.is_some() && other.shift.is_some();
        let has_both_shapes = self.ellipsoid.is_some() && other.ellipsoid.is_some();
        let are_told_by_shift = is_nameless(self) && is_nameless(other) && has_both_shifts && has_both_shapes;
        if lacks_name && !are_told_by_shift { Sameness::Assumed } else { Sameness::Known }
    }

    /// Says in what the two differ; nothing if nothing says it. Names that differ are a difference: no parameter tells NAD83 from WGS 84. A
    /// datum without a name is known by its ellipsoid and its way to WGS 84 only.
    pub(crate) fn difference(&self, other: &Datum) -> Option<String> {
        if (self.meridian - other.meridian).abs() > MERIDIAN_TOLERANCE {
            return Some(format!("the prime meridian ({}, {} degrees)", self.meridian, other.meridian));
        }
        self.difference_in_frame(other)
    }

    /// As [`Datum::difference`], wherever longitudes begin.
    pub(crate) fn difference_in_frame(&self, other: &Datum) -> Option<String> {
        if self.has_other_name(other) {
            let named = |datum: &Datum| datum.label.clone().unwrap_or_else(|| "unnamed".into());
            let names = [self, other].map(named);
            let [own, others] = if names[0] == names[1] { [self, other].map(Datum::full_name) } else { names };
            return Some(format!("the datum ({own}, {others})"));
        }
        self.difference_in_ellipsoid(other).or_else(|| self.difference_in_shift(other))
    }

    /// Says whether the ellipsoids differ.
    pub(crate) fn difference_in_ellipsoid(&self, other: &Datum) -> Option<String> {
        let (own, others) = (self.ellipsoid?, other.ellipsoid?);
        let differs = (0..2).any(|axis| (own[axis] - others[axis]).abs() > ELLIPSOID_TOLERANCE);
        differs.then(|| format!("the ellipsoid (half axes of {own:?} m, {others:?} m)"))
    }

    /// Says whether the ways to WGS 84 of two datums without names differ. One datum with a name has many such ways.
    fn difference_in_shift(&self, other: &Datum) -> Option<String> {
        let (own, others) = (self.shift?, other.shift?);
        let nameless = self.names().chain(other.names()).next().is_none();
        let differs = (0..7).any(|k| (own[k] - others[k]).abs() > SHIFT_TOLERANCES[k]);
        (nameless && differs).then(|| format!("the shift of the datum to WGS 84 ({own:?}, {others:?})"))
    }

    /// Says whether the ways to WGS 84 differ where at least one of the datums has no name. One that says no way has none.
    fn difference_in_lone_shift(&self, other: &Datum) -> Option<String> {
        let [own, others] = [self, other].map(|datum| datum.shift.unwrap_or_default());
        let differs = (0..7).any(|k| (own[k] - others[k]).abs() > SHIFT_TOLERANCES[k]);
        differs.then(|| format!("the shift of the datum to WGS 84 ({own:?}, {others:?})"))
    }

    fn has_other_name(&self, other: &Datum) -> bool {
        if self.names().next().is_none() || other.names().next().is_none() {
            return false;
        }
        let same_code = self.codes.iter().zip(other.codes).any(|(own, others)| own.is_some() && *own == others);
        let same = |own: &Option<String>, others: &Option<String>| own.is_some() && own == others;
        let same_name =
            same(&self.datum, &other.datum) || same(&self.datum, &other.system) || same(&self.system, &other.datum);
        // Where the names of the datums differ, only a name that stands for one datum may say that they are the same.
        let says_datum = |datum: &Datum| datum.datum.is_some() || datum.codes[1].is_some();
        let may_decide = || !(says_datum(self) && says_datum(other)) || self.system.as_deref().is_some_and(is_known);
        let same_system = || same(&self.system, &other.system) && may_decide();
        !(same_code || same_name || same_system())
    }

    /// Returns the names of the system and of the datum, for two whose systems have the same name.
    fn full_name(&self) -> String {
        let datum = self.datum.clone().or_else(|| self.codes[1].map(|code| format!("EPSG:{code}")));
        format!("{} of {}", self.label.as_deref().unwrap_or("unnamed"), datum.as_deref().unwrap_or("no datum"))
    }
}

/// Returns the half axes of an ellipsoid in metres; the inverse flattening of a sphere is written as 0.
fn half_axes(spheroid: &WktNode) -> Option<[f64; 2]> {
    let (greater, inverse_flattening) = (spheroid.number(1)?, spheroid.number(2)?);
    let greater = greater * spheroid.unit_metres().unwrap_or(1.0);
    let flattening = if inverse_flattening > 0.0 { 1.0 / inverse_flattening } else { 0.0 };
    (greater.is_finite() && greater > 0.0).then_some([greater, greater * (1.0 - flattening)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prime_meridian_counts_in_its_own_unit() {
        let datum = |meridian: &str| {
            let text = format!(
                r#"GEOGCRS["NTF (Paris)",DATUM["Nouvelle Triangulation Francaise (Paris)",ELLIPSOID["Clarke 1880 (IGN)",6378249.2,293.466021293627]],PRIMEM["Paris",{meridian}]]"#
            );
            Datum::of(WktNode::parse_all(&text).unwrap().first().unwrap()).unwrap()
        };
        let grads = datum(r#"2.5969213,ANGLEUNIT["grad",0.0157079632679489]"#);
        assert_eq!(grads.difference(&datum("2.33722917")), None);
        assert!(grads.difference(&datum("2.5969213")).unwrap().contains("the prime meridian"));
    }

    fn named(system: &str, datum: &str, shift: &str) -> Datum {
        let text = format!(r#"GEOGCS["{system}",DATUM["{datum}",SPHEROID["International 1924",6378388,297]{shift}]]"#);
        Datum::of(WktNode::parse_all(&text).unwrap().first().unwrap()).unwrap()
    }

    #[test]
    fn a_name_that_any_system_may_have_does_not_hide_two_datums() {
        for name in ["Geographic Coordinate System", "LL84", "My system"] {
            let found = named(name, "European_Datum_1950", "").difference(&named(name, "Monte_Mario", "")).unwrap();
            assert!(found.contains("ed50") && found.contains("montemario"), "{found}");
        }
        assert_eq!(named("ED50", "European_Datum_1950", "").difference(&named("ED50", "D_Euro_50", "")), None);
        assert_eq!(named("LL84", "European_Datum_1950", "").difference(&named("LL84", "D_European_1950", "")), None);
    }

    #[test]
    fn datums_without_names_are_told_apart_by_their_way_to_wgs84() {
        let nameless = |shift: &str| named("unknown", "Unknown based on International 1924 ellipsoid", shift);
        let (first, second) =
            (",TOWGS84[598.1,73.7,418.2,0.202,0.045,-2.455,6.7]", ",TOWGS84[577.326,90.129,463.919,0,0,0,0]");
        assert!(nameless(first).difference(&nameless(second)).unwrap().contains("the shift of the datum to WGS 84"));
        assert_eq!(nameless(first).difference(&nameless(first)), None);
        assert_eq!(nameless(first).difference(&nameless("")), None);
        // A datum that has a name has many ways.
        assert_eq!(named("ED50", "ED50", first).difference(&named("ED50", "ED50", second)), None);
    }

    #[test]
    fn a_datum_without_a_name_is_assumed_to_be_another_one_only_if_no_shift_speaks_against_it() {
        let nameless = |shift: &str| named("unknown", "Unknown based on International 1924 ellipsoid", shift);
        let ed50 = |shift: &str| named("ED50", "European_Datum_1950", shift);
        let (first, other, zero) = (",TOWGS84[-87,-98,-121]", ",TOWGS84[-199.87,74.79,246.62]", ",TOWGS84[0,0,0]");
        assert_eq!(ed50(first).sameness(&ed50(other)), Sameness::Known);
        assert_eq!(nameless(first).sameness(&nameless(first)), Sameness::Known);
        for (own, others) in [("", ""), ("", zero), (first, first)] {
            assert_eq!(nameless(own).sameness(&ed50(others)), Sameness::Assumed, "{own} {others}");
            assert_eq!(ed50(others).sameness(&nameless(own)), Sameness::Assumed, "{own} {others}");
        }
        for (own, others) in [(first, ""), ("", first), (first, zero), (first, other)] {
            let found = nameless(own).sameness(&ed50(others));
            assert!(matches!(&found, Sameness::Refuted(what) if what.contains("shift")), "{own} {others} {found:?}");
        }
        // Without a transformation, what a file does not say agrees with anything.
        assert_eq!(nameless(first).difference(&ed50("")), None);
    }

    #[test]
    fn datums_that_agree_with_wgs84_agree_with_each_other_but_for_an_earthquake() {
        let close = |own: &str, other: &str| named(own, own, "").is_close_to(&named(other, other, ""));
        for name in [
            "SIRGAS 2000",
            "D_China_2000",
            "CGCS2000",
            "Korea 2000",
            "Hartebeesthoek94",
            "D_Hartebeesthoek_1994",
            "REGVEN",
            "China Geodetic Coordinate System 2000",
            "JGD2011",
            "JGD2000",
        ] {
            assert!(close(name, "WGS 84"), "{name}");
        }
        assert!(!close("JGD2000", "JGD2011") && !close("JGD2011", "JGD2000"));
        assert!(!close("SIRGAS 1995", "WGS 84"));
    }

    #[test]
    fn the_way_to_wgs84_of_a_bound_system_counts() {
        let bound = |x: f64, method: &str, rotation: f64| {
            let base = r#"BASEGEOGCRS["unknown",DATUM["unknown",ELLIPSOID["e",6378388,297]]]"#;
            let names = ["X-axis translation", "y", "z", "X-axis rotation", "b", "c"];
            let values = [x, 0.0, 0.0, rotation, 0.0, 0.0];
            let all: String =
                names.iter().zip(values).map(|(name, value)| format!(r#",PARAMETER["{name}",{value}]"#)).collect();
            let text = format!(
                r#"BOUNDCRS[SOURCECRS[PROJCRS["p",{base},CONVERSION["c",METHOD["Mercator (variant A)"],
                PARAMETER["Longitude of natural origin",0]],LENGTHUNIT["metre",1]]],TARGETCRS[GEOGCRS["WGS 84"]],
                ABRIDGEDTRANSFORMATION["t",METHOD["{method}"]{all},PARAMETER["Scale difference",1]]]"#
            );
            crate::from_wkt::parse(&text).unwrap()
        };
        let own = bound(100.0, "Position Vector transformation", 1.0);
        assert!(own.same_as(&bound(100.0, "Coordinate Frame rotation", -1.0)));
        assert!(
            own.differences(&bound(200.0, "Position Vector transformation", 1.0))[0].contains("shift of the datum")
        );
        assert!(!own.same_as(&bound(100.0, "Coordinate Frame rotation", 1.0)));
    }

    #[test]
    fn an_ellipsoid_counts_in_its_own_unit() {
        let datum = |axis: &str| {
            let text = format!(r#"GEOGCRS["x",DATUM["x",ELLIPSOID["Clarke 1858",{axis},294.260676369]]]"#);
            Datum::of(WktNode::parse_all(&text).unwrap().first().unwrap()).unwrap()
        };
        assert!(datum("20926348").difference(&datum("6378293.645")).is_some());
        let text = r#"GEOGCRS["x",DATUM["x",ELLIPSOID["Clarke 1858",20926348,294.260676369,LENGTHUNIT["Clarke's foot",0.3047972654]]]]"#;
        let feet = Datum::of(WktNode::parse_all(text).unwrap().first().unwrap()).unwrap();
        assert_eq!(feet.difference(&datum("6378293.645")), None);
    }
}
