//! The datum of a system in a comparable form: its names and codes, the ellipsoid and the prime meridian.

use crate::input::crs::wkt::{DATUM, WktNode, degrees};

/// Ellipsoids that are in use differ by metres, or by less than a millimetre. Then only names tell the datums apart.
const ELLIPSOID_TOLERANCE: f64 = 1.0;

/// In degrees: a tenth of a metre. Writers round the meridian of Paris to less.
const MERIDIAN_TOLERANCE: f64 = 1e-6;

/// Long names and the short ones that other writers use.
const SHORT_NAMES: [(&str, &str); 21] = [
    ("worldgeodeticsystem", "wgs"),
    ("northamericandatum", "nad"),
    ("northamerican", "nad"),
    ("europeanterrestrialreferencesystem", "etrs"),
    ("europeandatum", "ed"),
    ("european", "ed"),
    ("geocentricdatumofaustralia", "gda"),
    ("australiangeodeticdatum", "agd"),
    ("reseaugeodesiquefrancais", "rgf"),
    ("japanesegeodeticdatum", "jgd"),
    ("newzealandgeodeticdatum", "nzgd"),
    ("internationalterrestrialreferenceframe", "itrf"),
    ("ordnancesurveyofgreatbritain", "osgb"),
    ("highaccuracyreferencenetwork", "harn"),
    ("highaccuracyregionalnetwork", "harn"),
    ("canadianspatialreferencesystem", "csrs"),
    ("nationalspatialreferencesystem", ""),
    ("nsrs2007", "2007"),
    ("ensemble", ""),
    ("datum", ""),
    ("rgf93v1", "rgf93"),
];

/// What stands for a name where the writer knew none.
const NO_NAMES: [&str; 5] = ["unknown", "unnamed", "notspecified", "undefined", "userdefined"];

/// The datums that agree with WGS 84 to a metre or two, by the beginning of their comparable names.
const CLOSE_TO_WGS84: [&str; 11] =
    ["wgs84", "nad83", "etrs89", "rgf93", "gda94", "gda2020", "jgd2000", "jgd2011", "itrf", "sweref99", "nzgd2000"];

/// A datum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Datum {
    /// The first name, for messages.
    label: Option<String>,
    /// The comparable names of the geographic system and of the datum.
    names: Vec<String>,
    /// The EPSG codes of the geographic system and of the datum.
    codes: [Option<u32>; 2],
    /// The greater and the lesser half axis in metres.
    ellipsoid: Option<[f64; 2]>,
    /// Degrees east of Greenwich.
    meridian: f64,
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
            label: texts.iter().find(|text| comparable(text).is_some()).map(|text| text.to_string()),
            names: texts.iter().filter_map(|text| comparable(text)).collect(),
            codes: [system.epsg(), datum.epsg()],
            ellipsoid: spheroid.and_then(|spheroid| half_axes(spheroid.number(1)?, spheroid.number(2)?)),
            meridian,
        })
    }

    /// Returns whether the datum agrees with WGS 84 to a metre or two.
    pub(crate) fn is_close_to_wgs84(&self) -> bool {
        self.names.iter().any(|name| CLOSE_TO_WGS84.iter().any(|close| name.starts_with(close)))
    }

    /// Returns its name; `None` if its ellipsoid is all that is known.
    pub(crate) fn name(&self) -> Option<&str> {
        self.label.as_deref()
    }

    /// Says in what the two differ. Names that differ are a difference: no parameter tells NAD83 from WGS 84. A datum without a name
    /// is known by its ellipsoid only.
    pub(crate) fn difference(&self, other: &Datum) -> Option<String> {
        if (self.meridian - other.meridian).abs() > MERIDIAN_TOLERANCE {
            return Some(format!("the prime meridian ({}, {} degrees)", self.meridian, other.meridian));
        }
        let nameless = self.names.is_empty() || other.names.is_empty();
        let same_code = self.codes.iter().zip(other.codes).any(|(own, others)| own.is_some() && *own == others);
        let same_name = self.names.iter().any(|name| other.names.contains(name));
        let named = |datum: &Datum| datum.label.clone().unwrap_or_else(|| "unnamed".into());
        if !nameless && !same_code && !same_name {
            return Some(format!("the datum ({}, {})", named(self), named(other)));
        }
        let (own, others) = (self.ellipsoid?, other.ellipsoid?);
        let differs = (0..2).any(|axis| (own[axis] - others[axis]).abs() > ELLIPSOID_TOLERANCE);
        differs.then(|| format!("the ellipsoid (half axes of {own:?} m, {others:?} m)"))
    }
}

/// Returns the half axes of an ellipsoid; the inverse flattening of a sphere is written as 0.
fn half_axes(greater: f64, inverse_flattening: f64) -> Option<[f64; 2]> {
    let flattening = if inverse_flattening > 0.0 { 1.0 / inverse_flattening } else { 0.0 };
    (greater.is_finite() && greater > 0.0).then_some([greater, greater * (1.0 - flattening)])
}

/// Returns the name as all writers would spell it; `None` if it says nothing.
fn comparable(name: &str) -> Option<String> {
    let lower = name.to_ascii_lowercase();
    let own = lower.strip_prefix("d_").or_else(|| lower.strip_prefix("gcs_")).unwrap_or(&lower);
    // CH1903 and CH1903+ are two datums.
    let words = own.split(|c: char| !c.is_alphanumeric() && c != '+');
    let mut joined: String = words.map(without_century).collect();
    for (long, short) in SHORT_NAMES {
        joined = joined.replace(long, short);
    }
    let says_nothing = joined.is_empty() || NO_NAMES.iter().any(|none| joined.contains(none));
    (!says_nothing).then_some(joined)
}

/// Writes a year of the twentieth century at the end of a word with two digits.
fn without_century(word: &str) -> String {
    let digits = word.len() - word.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (letters, number) = word.split_at(word.len() - digits);
    match number.strip_prefix("19") {
        Some(year) if digits == 4 => format!("{letters}{year}"),
        _ => word.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_datum_has_one_name_whoever_writes_it() {
        for names in [
            ["NAD83(2011)", "NAD83_National_Spatial_Reference_System_2011", "D_NAD_1983_2011", "GCS_NAD_1983_2011"],
            ["NAD83", "North_American_Datum_1983", "D_North_American_1983", "GCS_North_American_1983"],
            ["NAD83(HARN)", "NAD83_High_Accuracy_Reference_Network", "D_North_American_1983_HARN", "NAD83 (HARN)"],
            ["NAD83(NSRS2007)", "NAD83_National_Spatial_Reference_System_2007", "D_NAD_1983_NSRS2007", "NAD83(2007)"],
            ["WGS 84", "WGS_1984", "World Geodetic System 1984 ensemble", "GCS_WGS_1984"],
            ["ETRS89", "European_Terrestrial_Reference_System_1989", "D_ETRS_1989", "GCS_ETRS_1989"],
            ["ED50", "European_Datum_1950", "D_European_1950", "GCS_European_1950"],
            ["RGF93", "Reseau_Geodesique_Francais_1993", "D_RGF_1993", "RGF93 v1"],
        ] {
            let all: Vec<_> = names.iter().map(|name| comparable(name).unwrap()).collect();
            assert!(all.iter().all(|name| *name == all[0]), "{names:?}: {all:?}");
        }
        assert_ne!(comparable("CH1903"), comparable("CH1903+"));
        assert_ne!(comparable("NAD83"), comparable("NAD83(CSRS)"));
        for nothing in ["", "unknown", "D_Unknown", "Not_specified_based_on_GRS_1980_ellipsoid"] {
            assert_eq!(comparable(nothing), None, "{nothing}");
        }
    }
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
}
