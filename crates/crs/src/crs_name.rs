//! Names of systems by their EPSG codes, in the forms that programs write: `EPSG:25832`, `EPSG:25832+5783`, URNs and URLs of the OGC.

use crate::from_wkt::from_epsg;
use crate::system::Crs;
use crate::vertical::VerticalSystem;

/// How URNs begin, of one system and of a compound one.
const URN: &str = "urn:ogc:def:crs:";
const COMPOUND_URN: &str = "urn:ogc:def:crs,";

/// How the addresses of URLs begin, of one system and of a compound one.
const PATH: &str = "www.opengis.net/def/crs/";
const COMPOUND_PATH: &str = "www.opengis.net/def/crs-compound?";

/// The codes of a system of places and, if it is named too, one of heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CrsName {
    /// That of the system of places.
    pub plane: u32,
    pub(crate) heights: Option<u32>,
}

impl CrsName {
    /// Reads a name; `None` if the text is none of an EPSG code, or of longitude and latitude by the OGC.
    pub fn read(text: &str) -> Option<CrsName> {
        let codes = parts(text.trim())?.into_iter().map(|[authority, code]| code_of(authority, code));
        let codes: Vec<u32> = codes.collect::<Option<_>>()?;
        match codes.as_slice() {
            [plane] => Some(CrsName { plane: *plane, heights: None }),
            [plane, heights] => Some(CrsName { plane: *plane, heights: Some(*heights) }),
            _ => None,
        }
    }

    /// Returns the system that the codes stand for.
    ///
    /// # Errors
    /// The code that is not in the list of known ones.
    pub fn system(self) -> Result<Crs, u32> {
        let crs = from_epsg(self.plane).ok_or(self.plane)?;
        let Some(code) = self.heights else { return Ok(crs) };
        let heights = VerticalSystem { epsg: Some(code), ..VerticalSystem::default() };
        let metres = heights.metres_of_code().ok_or(code)?;
        Ok(Crs { vertical: Some(metres), vertical_system: Some(heights), ..crs })
    }
}

/// Returns the authority and the code of each part of a name.
fn parts(text: &str) -> Option<Vec<[&str; 2]>> {
    if let Some(address) = address(text) {
        return match after(address, COMPOUND_PATH) {
            Some(query) => query.split('&').map(of_query).collect(),
            None => Some(vec![without_version(after(address, PATH)?, '/')?]),
        };
    }
    if let Some(one) = after(text, URN) {
        return Some(vec![without_version(one, ':')?]);
    }
    if let Some(compound) = after(text, COMPOUND_URN) {
        return compound.split(',').map(|part| without_version(after(part.trim(), "crs:")?, ':')).collect();
    }
    let (authority, codes) = text.split_once(':')?;
    Some(codes.split('+').map(|code| [authority, code]).collect())
}

/// Reads a part of the query of a compound system, such as `1=http://www.opengis.net/def/crs/EPSG/0/25832`.
fn of_query(part: &str) -> Option<[&str; 2]> {
    let (_, url) = part.split_once('=')?;
    without_version(after(address(url)?, PATH)?, '/')
}

/// Returns a URL without its scheme.
fn address(text: &str) -> Option<&str> {
    after(text, "http://").or_else(|| after(text, "https://"))
}

/// Reads an authority, the version of its list, which may be empty, and a code.
fn without_version(text: &str, separator: char) -> Option<[&str; 2]> {
    let [authority, _, code] = text.split(separator).collect::<Vec<_>>().try_into().ok()?;
    Some([authority, code])
}

/// Returns what comes after the beginning of a text. Capital letters do not matter.
fn after<'a>(text: &'a str, beginning: &str) -> Option<&'a str> {
    let (start, rest) = text.split_at_checked(beginning.len())?;
    start.eq_ignore_ascii_case(beginning).then_some(rest)
}

/// Returns the EPSG code of a code. The systems of the OGC have longitude before latitude, as this program always has.
fn code_of(authority: &str, code: &str) -> Option<u32> {
    let [authority, code] = [authority.trim(), code.trim()].map(str::to_ascii_uppercase);
    match (authority.as_str(), code.as_str()) {
        ("EPSG", code) => code.parse().ok(),
        ("OGC", "CRS84" | "CRS84H") | ("CRS", "84") => Some(4326),
        ("OGC", "CRS83") | ("CRS", "83") => Some(4269),
        ("OGC", "CRS27") | ("CRS", "27") => Some(4267),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_urns_and_urls_are_one() {
        for text in [
            "EPSG:25832",
            "epsg: 25832",
            "urn:ogc:def:crs:EPSG::25832",
            "URN:OGC:DEF:CRS:EPSG:9.6.2:25832",
            "http://www.opengis.net/def/crs/EPSG/0/25832",
            "https://www.opengis.net/def/crs/EPSG/9.9.1/25832",
        ] {
            assert_eq!(CrsName::read(text), Some(CrsName { plane: 25832, heights: None }), "{text}");
        }
        for text in [
            "EPSG:25832+5783",
            "urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783",
            "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/25832&2=\
             http://www.opengis.net/def/crs/EPSG/0/5783",
        ] {
            assert_eq!(CrsName::read(text), Some(CrsName { plane: 25832, heights: Some(5783) }), "{text}");
        }
        for text in [
            "urn:ogc:def:crs:OGC:1.3:CRS84",
            "urn:ogc:def:crs:OGC::CRS84h",
            "OGC:CRS84",
            "http://www.opengis.net/def/crs/OGC/1.3/CRS84",
        ] {
            assert_eq!(CrsName::read(text), Some(CrsName { plane: 4326, heights: None }), "{text}");
        }
    }

    #[test]
    fn other_texts_are_no_names() {
        for text in [
            "",
            "25832",
            "UTM 32N",
            "EPSG:",
            "EPSG:1+2+3",
            "ESRI:102008",
            "urn:ogc:def:crs:EPSG:25832",
            "urn:ogc:def:crs,crs:EPSG::25832,5783",
            "http://www.opengis.net/def/crs/EPSG/25832",
            "http://example.com/def/crs/EPSG/0/25832",
            "PROJCS[\"a:b\"]",
            "\u{fc}rn:ogc:def:crs:EPSG::25832",
        ] {
            assert_eq!(CrsName::read(text), None, "{text}");
        }
        assert_eq!(CrsName::read("EPSG:1").unwrap().system(), Err(1));
        assert_eq!(CrsName::read("EPSG:26915+1").unwrap().system(), Err(1));
    }
}
