//! What a well-known text says in a way that cannot be used. Nothing may silently take its place.

use crate::form::CrsForm;
use crate::from_wkt::{from_epsg, parse};
use crate::projection::Projection;
use crate::system::{Crs, CrsKind};
use crate::unit::same_length;
use crate::wkt::{GEOGRAPHIC, LOCAL, PROJECTED, VERTICAL, WktNode, find, length, units};

/// The code of the metre.
const METRE: u32 = 9001;

impl Crs {
    /// Says what of the system's text is there, but cannot be used, and which parameter its projection lacks.
    pub fn problems(&self) -> Vec<String> {
        let Some(text) = self.wkt.as_deref() else { return Vec::new() };
        let unit = |keywords: &[&str]| find(text, keywords).and_then(|system| bad_unit(&system));
        let horizontal = match self.kind {
            CrsKind::Projected => unit(&PROJECTED),
            CrsKind::Geocentric => unit(&GEOGRAPHIC),
            CrsKind::Local => unit(&LOCAL),
            CrsKind::Geographic | CrsKind::Unknown => None,
        };
        let horizontal = horizontal.map(|what| format!("its unit of x and y is {what}"));
        let vertical = unit(&VERTICAL).map(|what| format!("its unit of heights is {what}"));
        // A code says all that the text lacks.
        let system = if self.form().is_none() { find(text, &PROJECTED) } else { None };
        let projection = system.and_then(|system| match Projection::read(&system) {
            None => Some("it names no projection".into()),
            Some(read) => read.err(),
        });
        let projection = projection.map(|what| format!("the place of its coordinates is unknown: {what}"));
        let code = self.difference_to_code().map(|what| {
            let code = self.epsg.unwrap_or_default();
            format!("its text and its code EPSG:{code} differ in {what}; the text is used")
        });
        horizontal.into_iter().chain(vertical).chain(projection).chain(code).collect()
    }

    /// Says that z counts downwards, if it does.
    pub fn depths(&self) -> Option<String> {
        let heights = self.vertical_system.as_ref().filter(|heights| heights.is_depth() == Some(true))?;
        Some(format!(
            "its z is a depth ({}), but is taken as a height, so the terrain is upside down; fix: multiply z by -1 first",
            heights.label()
        ))
    }

    /// Says in what the unit and the parameters of the system's text differ from those of its code.
    pub fn difference_to_code(&self) -> Option<String> {
        let (own, known) = (CrsForm::of_text(self.wkt.as_deref()?)?, CrsForm::of_code(self.epsg?)?);
        let unit = self.difference_to_unit_of_code().into_iter();
        let differences: Vec<String> = unit.chain(own.differences_in_parameters(&known)).collect();
        (!differences.is_empty()).then(|| differences.join(" and "))
    }

    /// Says in what the unit of x and y in the system's text differs from that of its code.
    pub(crate) fn difference_to_unit_of_code(&self) -> Option<String> {
        let (own, known) = (parse(self.wkt.as_deref()?)?.horizontal, from_epsg(self.epsg?)?.horizontal);
        let (metres, of_code) = own.metres_per_unit().zip(known.metres_per_unit())?;
        (!same_length(metres, of_code)).then(|| format!("the unit of x and y ({}, {})", own.name(), known.name()))
    }

    /// Returns the code of the system, if its text does not contradict it.
    pub fn undisputed_code(&self) -> Option<u32> {
        self.epsg.filter(|_| self.difference_to_code().is_none())
    }
}

/// Says what is wrong with the unit of a system; `None` if it is a length and fits its name and its code, or if there is none.
fn bad_unit(system: &WktNode) -> Option<String> {
    let is_metre = |unit: &WktNode| {
        let name = unit.text(0).map(str::to_lowercase).unwrap_or_default();
        matches!(name.as_str(), "metre" | "meter" | "m") || unit.epsg() == Some(METRE)
    };
    let fits = |unit: &WktNode| length(unit).is_some_and(|metres| !is_metre(unit) || same_length(metres, 1.0));
    let unit = units(system).0.filter(|unit| !fits(unit))?;
    let metres = unit.number(1).map_or("no number".into(), |metres| format!("{metres}"));
    Some(format!("{} with {metres} in place of its length in metres", unit.text(0).unwrap_or("unnamed")))
}

#[cfg(test)]
mod tests {
    use crate::from_wkt::parse;

    const UTM: &str = r#"PROJCS["UTM",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",
        SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],
        PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],
        PARAMETER["Central_Meridian",-93.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0],
        UNIT["Meter",1.0]]"#;

    fn problems(from: &str, to: &str) -> Vec<String> {
        let text = UTM.replace(from, to);
        assert!(from.is_empty() || text != UTM, "{from}");
        let crs = parse(&text).unwrap();
        let problems = crs.problems();
        let lacks_unit = problems.iter().any(|doubt| doubt.contains("unit"));
        assert_eq!(crs.proj4_definition().is_some(), problems.is_empty(), "{problems:?}");
        assert_eq!(crs.metres_per_unit().is_none(), lacks_unit, "{problems:?}");
        problems
    }

    #[test]
    fn an_origin_that_is_missing_or_unreadable_leaves_the_place_unknown() {
        assert_eq!(problems("", ""), [""; 0]);
        // What the standard has a value for may be missing.
        let plain = UTM.replace(r#"PARAMETER["False_Northing",0.0],"#, "");
        assert_eq!(parse(&plain).unwrap().problems(), [""; 0]);
        for (from, to, what) in [
            (r#"PARAMETER["Central_Meridian",-93.0],"#, "", "it does not give the longitude of the origin"),
            (r#"PARAMETER["Latitude_Of_Origin",0.0],"#, "", "it does not give the latitude of the origin"),
            ("-93.0", "nan", "its Central_Meridian is no number"),
            ("500000.0", "\"east\"", "its False_Easting is no number"),
            ("0.9996", "inf", "its Scale_Factor is no number"),
        ] {
            assert_eq!(problems(from, to), [format!("the place of its coordinates is unknown: {what}")], "{to}");
        }
        let cone = |parameters: &str| {
            let text = UTM.replace("Transverse_Mercator", "Lambert_Conformal_Conic_2SP");
            parse(&text.replace(r#"PARAMETER["Scale_Factor",0.9996],"#, parameters)).unwrap().problems().len()
        };
        let (first, second) = (r#"PARAMETER["Standard_Parallel_1",44],"#, r#"PARAMETER["Standard_Parallel_2",49],"#);
        assert_eq!((cone(first), cone(second), cone(&format!("{first}{second}"))), (1, 1, 0));
        // The code says what the text lacks.
        let coded = UTM
            .replace(r#"PARAMETER["Central_Meridian",-93.0],"#, "")
            .replace("1.0]]", r#"1.0],AUTHORITY["EPSG","26915"]]"#);
        assert_eq!(parse(&coded).unwrap().problems(), [""; 0]);
    }

    #[test]
    fn a_unit_that_is_no_length_is_named() {
        for (unit, shown) in [("0.0", "0"), ("-1.0", "-1"), ("nan", "NaN"), ("\"long\"", "no number")] {
            let found = problems(r#""Meter",1.0"#, &format!(r#""Meter",{unit}"#));
            assert_eq!(found, [format!("its unit of x and y is Meter with {shown} in place of its length in metres")]);
        }
        let heights = format!(r#"COMPD_CS["c",{UTM},VERT_CS["v",VERT_DATUM["d",2005],UNIT["foot",0]]]"#);
        let crs = parse(&heights).unwrap();
        assert_eq!(crs.problems(), ["its unit of heights is foot with 0 in place of its length in metres"]);
        assert_eq!(crs.vertical, None);
    }
}
