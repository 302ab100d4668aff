//! What EPSG codes stand for. The crate `crs-definitions` knows most systems; the tables beside this file, written from version 11.022
//! of the EPSG dataset, hold those that it lacks or has otherwise, all systems of heights, and the areas of use of all systems of places.

use std::collections::HashMap;
use std::sync::OnceLock;

/// Systems whose map has the formulas of a sphere, though their datum has an ellipsoid (EPSG methods 1027 and 9834). Version 1 of the text
/// cannot say that: what it says is kilometres beside them.
pub(crate) const SPHERICAL_ON_ELLIPSOID: [u32; 4] = [3973, 3974, 3975, 9311];

/// A code and well-known text on each line.
const SYSTEMS: &str = include_str!("codes/systems.tsv");

/// On each line the code of a system of heights, that of its datum, up or down, the metres of its unit, and the comparable names that
/// only this datum has, by EPSG and by ESRI. A name stands on the first line of its datum only.
const HEIGHTS: &str = include_str!("codes/heights.tsv");

/// On each line the area of use of some systems, west, south, east and north in degrees, and their codes, such as `2001,4601-4604`.
const AREAS: &str = include_str!("codes/areas.tsv");

/// A system of heights that has a code.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeightCode {
    /// The code of its datum.
    pub(crate) datum: u32,
    /// Whether it counts depths.
    pub(crate) is_depth: bool,
    /// The metres of its unit.
    pub(crate) metres: f64,
}

/// Returns the well-known text of an EPSG code; `None` for a code that is not in the list of known ones.
pub(crate) fn text_of_code(code: u32) -> Option<&'static str> {
    systems().get(&code).copied().or_else(|| Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt))
}

/// Returns the well-known text of the geographic system whose datum has this code; of several, that with the least code.
pub(crate) fn text_of_datum(datum: u32) -> Option<&'static str> {
    static DATUMS: OnceLock<HashMap<u32, &'static str>> = OnceLock::new();
    let known = DATUMS.get_or_init(|| {
        let texts = (1..=u32::from(u16::MAX)).rev().filter_map(text_of_code);
        texts.filter_map(|text| Some((datum_of_text(text)?, text))).collect()
    });
    known.get(&datum).copied()
}

/// Returns the code of the datum of a geographic system. It stands behind the ellipsoid.
fn datum_of_text(text: &str) -> Option<u32> {
    let (datum, _) = text.strip_prefix("GEOGCS[")?.split_once(r#""]],PRIMEM["#)?;
    datum.rsplit_once(r#",AUTHORITY["EPSG",""#)?.1.parse().ok()
}

/// Returns the definition for PROJ.4 of an EPSG code; `None` for a code of which only the text is known.
pub(crate) fn proj4_of_code(code: u32) -> Option<&'static str> {
    if systems().contains_key(&code) || SPHERICAL_ON_ELLIPSOID.contains(&code) {
        return None;
    }
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.proj4)
}

/// Returns the areas of use and the codes of the systems that are made for them, as the table has them.
pub(crate) fn lines_of_areas() -> impl Iterator<Item = (&'static str, &'static str)> {
    AREAS.lines().filter_map(|line| line.split_once('\t'))
}

/// Returns the systems of heights that have codes.
pub(crate) fn heights() -> &'static HashMap<u32, HeightCode> {
    static CODES: OnceLock<HashMap<u32, HeightCode>> = OnceLock::new();
    CODES.get_or_init(|| height_lines().filter_map(|line| height(&line)).collect())
}

/// Returns the code of the datum of heights that has this comparable name.
pub(crate) fn height_datum(name: &str) -> Option<u32> {
    static NAMES: OnceLock<HashMap<&'static str, u32>> = OnceLock::new();
    let names = NAMES.get_or_init(|| {
        let lines = height_lines().filter_map(|line| Some((line[1].parse().ok()?, line[4])));
        lines.flat_map(|(datum, names)| names.split(',').map(move |name| (name, datum))).collect()
    });
    names.get(name).copied()
}

fn systems() -> &'static HashMap<u32, &'static str> {
    static TEXTS: OnceLock<HashMap<u32, &'static str>> = OnceLock::new();
    TEXTS.get_or_init(|| {
        let lines = SYSTEMS.lines().filter_map(|line| line.split_once('\t'));
        lines.filter_map(|(code, text)| Some((code.parse().ok()?, text))).collect()
    })
}

fn height_lines() -> impl Iterator<Item = [&'static str; 5]> {
    HEIGHTS.lines().filter_map(|line| line.split('\t').collect::<Vec<_>>().try_into().ok())
}

fn height(line: &[&str; 5]) -> Option<(u32, HeightCode)> {
    let [code, datum, direction, metres, _] = line;
    let is_depth = *direction == "down";
    Some((code.parse().ok()?, HeightCode { datum: datum.parse().ok()?, is_depth, metres: metres.parse().ok()? }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_wkt::from_epsg;

    #[test]
    fn every_line_of_the_tables_is_read() {
        assert_eq!(systems().len(), SYSTEMS.lines().count());
        assert_eq!(heights().len(), HEIGHTS.lines().count());
        for code in systems().keys() {
            let crs = from_epsg(*code).unwrap();
            let lost = (crs.form().is_none(), crs.metres_per_unit().is_none());
            assert!(!lost.0 && (!lost.1 || crs.kind == crate::system::CrsKind::Geographic), "EPSG:{code}: {crs:?}");
        }
    }

    #[test]
    fn the_code_of_a_compound_system_is_that_of_its_plane() {
        let is_compound = |code: &u32| text_of_code(*code).is_some_and(|text| text.starts_with("COMPD_CS"));
        let compound: Vec<u32> = (1..=u32::from(u16::MAX)).filter(is_compound).collect();
        assert!(compound.len() > 100);
        for code in compound {
            let (whole, plane) = (from_epsg(code).unwrap(), from_epsg(code).unwrap().epsg.unwrap());
            let text = text_of_code(plane).unwrap();
            assert!(text.starts_with("PROJCS") || text.starts_with("GEOGCS"), "EPSG:{code} has the plane EPSG:{plane}");
            assert!(whole.vertical_system.is_some() && whole.difference_to_code().is_none(), "EPSG:{code}");
        }
    }

    #[test]
    fn the_code_of_a_datum_gives_its_first_system() {
        for (datum, name) in [(6326, "GEOGCS[\"WGS 84\""), (6269, "GEOGCS[\"NAD83\""), (1116, "GEOGCS[\"NAD83(2011)\"")]
        {
            assert!(text_of_datum(datum).unwrap().starts_with(name), "{datum}: {:?}", text_of_datum(datum));
        }
        assert_eq!(text_of_datum(1), None);
    }

    #[test]
    fn codes_of_systems_and_heights_are_known_by_the_tables() {
        // SIRGAS-Chile 2010 / UTM zone 18S is younger than the list of the crate.
        assert!(text_of_code(8950).unwrap().contains("SIRGAS-Chile 2010"));
        assert_eq!((proj4_of_code(8950), proj4_of_code(26915).is_some()), (None, true));
        assert_eq!((height_datum("nzvd2016"), heights()[&7839].datum), (Some(1169), 1169));
        assert!(heights()[&5715].is_depth && !heights()[&5714].is_depth);
        assert_eq!(text_of_code(1), None);
    }
}
