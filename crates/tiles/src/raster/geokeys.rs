//! The keys of GeoTIFF (OGC 19-008r4) that say what a raster's coordinates and heights are in.

use crs::Crs;

/// What the coordinates of a raster are in, as far as keys can say it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RasterSystem {
    /// The EPSG code of the projected system, if it is known and means what the coordinates are in.
    pub code: Option<u16>,
    /// Its well-known text, where there is no such code.
    pub text: Option<String>,
    /// Its name.
    pub name: Option<String>,
    /// The metres of a unit of x and y.
    pub metres: Option<f64>,
    /// The EPSG code of the system of heights.
    pub vertical_code: Option<u16>,
    /// Its name.
    pub vertical_name: Option<String>,
    /// The metres of a unit of height.
    pub vertical_metres: Option<f64>,
}

/// The three tags of the keys.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct KeyTags {
    pub(crate) directory: Vec<u16>,
    pub(crate) doubles: Vec<f64>,
    pub(crate) texts: String,
}

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const PROJECTED_TYPE: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_TYPE: u16 = 4096;
const VERTICAL_CITATION: u16 = 4097;
const VERTICAL_UNITS: u16 = 4099;

const PROJECTED: u16 = 1;
const USER_DEFINED: u16 = 32767;
/// A cell is an area, and its height that of its centre.
const PIXEL_IS_AREA: u16 = 1;

/// The tag with the numbers of 64 bits, and that with the texts.
pub(crate) const DOUBLES: u16 = 34736;
pub(crate) const TEXTS: u16 = 34737;

/// What stands in front of a text by which programs of ESRI, and GDAL, know a system without a code.
const TEXT_PREFIX: &str = "ESRI PE String = ";

/// GDAL reads no longer text.
const LONGEST_TEXT: usize = 2399;

/// Units by their EPSG codes and their metres.
const UNITS: [(u16, f64); 3] = [(9001, 1.0), (9002, 0.3048), (9003, 1200.0 / 3937.0)];

impl RasterSystem {
    /// Returns what keys say of a CRS whose unit of x and y has so many metres, without its heights. It is empty for an unknown CRS.
    pub fn of_plane(crs: &Crs, metres: f64) -> RasterSystem {
        if !crs.is_named() {
            return RasterSystem::default();
        }
        // A code whose text says otherwise is not what the coordinates are in.
        let code = crs.undisputed_code().and_then(|code| u16::try_from(code).ok());
        RasterSystem {
            code,
            text: crs.wkt.clone(),
            name: crs.name.clone(),
            metres: Some(metres),
            ..RasterSystem::default()
        }
    }

    /// Returns whether the keys say where the coordinates are.
    pub fn is_placed(&self) -> bool {
        self.code.is_some() || self.written_text().is_some()
    }

    /// Returns the system as programs take it from users: its codes, or its text.
    pub(crate) fn definition(&self) -> Option<String> {
        let code = self.code.map(|code| match self.vertical_code {
            Some(heights) => format!("EPSG:{code}+{heights}"),
            None => format!("EPSG:{code}"),
        });
        code.or_else(|| self.text.clone())
    }

    fn written_text(&self) -> Option<String> {
        let text = format!("{TEXT_PREFIX}{}", self.text.as_ref()?);
        (text.len() <= LONGEST_TEXT).then_some(text)
    }

    /// Returns the keys; none if nothing is known.
    pub(crate) fn keys(&self) -> KeyTags {
        let mut keys = KeyTags { directory: vec![1, 1, 1, 0], ..KeyTags::default() };
        let text = self.written_text().filter(|_| self.code.is_none());
        // GDAL looks for the text only if the kind of the system is not said.
        let is_known = text.is_some() || self.code.is_some() || self.name.is_some();
        if is_known {
            keys.number(MODEL_TYPE, if text.is_some() { USER_DEFINED } else { PROJECTED });
        }
        keys.number(RASTER_TYPE, PIXEL_IS_AREA);
        if is_known {
            keys.number(PROJECTED_TYPE, self.code.unwrap_or(USER_DEFINED));
        }
        if let Some(citation) = text.as_ref().or(self.name.as_ref().filter(|_| self.code.is_none())) {
            keys.text(PROJECTED_CITATION, citation);
        }
        self.unit(&mut keys);
        self.vertical(&mut keys);
        let count = keys.directory.len() / 4 - 1;
        if count == 1 {
            // That a cell is an area goes without saying, and with this alone GDAL would show a system without a name.
            return KeyTags::default();
        }
        keys.directory[3] = count as u16;
        keys
    }

    fn unit(&self, keys: &mut KeyTags) {
        match self.metres.map(|metres| (metres, unit_code(metres))) {
            Some((_, Some(code))) => keys.number(LINEAR_UNITS, code),
            Some((metres, None)) => {
                keys.number(LINEAR_UNITS, USER_DEFINED);
                keys.double(LINEAR_UNIT_SIZE, metres);
            }
            None => {}
        }
    }

    fn vertical(&self, keys: &mut KeyTags) {
        if let Some(code) = self.vertical_code {
            keys.number(VERTICAL_TYPE, code);
        }
        if let Some(name) = &self.vertical_name {
            keys.text(VERTICAL_CITATION, name);
        }
        // A unit alone would make an unknown system of heights. It is worth that only if nobody would expect it.
        let is_named = self.vertical_code.is_some() || self.vertical_name.is_some();
        let unit = self.vertical_metres.filter(|metres| is_named || self.metres.is_some_and(|plane| plane != *metres));
        if let Some(code) = unit.and_then(unit_code) {
            keys.number(VERTICAL_UNITS, code);
        }
    }
}

fn unit_code(metres: f64) -> Option<u16> {
    UNITS.iter().find(|(_, known)| (known - metres).abs() < 1e-8).map(|(code, _)| *code)
}

/// Keys come in ascending order.
impl KeyTags {
    fn number(&mut self, key: u16, value: u16) {
        self.directory.extend([key, 0, 1, value]);
    }

    fn double(&mut self, key: u16, value: f64) {
        self.directory.extend([key, DOUBLES, 1, self.doubles.len() as u16]);
        self.doubles.push(value);
    }

    /// Adds a text. A bar ends a text, and texts are ASCII.
    fn text(&mut self, key: u16, text: &str) {
        let is_fine = |c: char| (c.is_ascii_graphic() && c != '|') || c == ' ';
        let plain: String = text.chars().map(|c| if is_fine(c) { c } else { '?' }).take(LONGEST_TEXT).collect();
        self.directory.extend([key, TEXTS, plain.len() as u16 + 1, self.texts.len() as u16]);
        self.texts.push_str(&plain);
        self.texts.push('|');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_written_as_such() {
        let system = RasterSystem {
            code: Some(26915),
            text: Some("PROJCS[...]".into()),
            name: Some("NAD83 / UTM zone 15N".into()),
            metres: Some(1.0),
            vertical_code: Some(6360),
            vertical_metres: Some(1200.0 / 3937.0),
            ..RasterSystem::default()
        };
        let keys = [[1, 1, 1, 6], [1024, 0, 1, 1], [1025, 0, 1, 1], [3072, 0, 1, 26915], [3076, 0, 1, 9001]];
        let heights = [[4096, 0, 1, 6360], [4099, 0, 1, 9003]];
        let directory = keys.iter().chain(&heights).flatten().copied().collect();
        assert_eq!(system.keys(), KeyTags { directory, ..KeyTags::default() });
        assert!(system.is_placed());
    }

    #[test]
    fn a_text_stands_where_there_is_no_code() {
        let text = Some("PROJCS[\"Grid | \u{e9}\"]".to_string());
        let system = RasterSystem { text, metres: Some(0.201168), ..RasterSystem::default() };
        let keys = system.keys();
        assert_eq!(keys.texts, "ESRI PE String = PROJCS[\"Grid ? ?\"]|");
        assert_eq!(
            keys.directory[4..],
            [
                1024,
                0,
                1,
                USER_DEFINED,
                1025,
                0,
                1,
                1,
                3072,
                0,
                1,
                USER_DEFINED,
                3073,
                TEXTS,
                36,
                0,
                3076,
                0,
                1,
                USER_DEFINED,
                3077,
                DOUBLES,
                1,
                0
            ]
        );
        assert_eq!(keys.doubles, [0.201168]);
        let long = RasterSystem { text: Some("x".repeat(3000)), ..RasterSystem::default() };
        assert!(system.is_placed() && !long.is_placed() && !RasterSystem::default().is_placed());
        assert_eq!(RasterSystem::default().keys(), KeyTags::default());
    }
}
