//! Coordinate reference systems as GeoTIFF keys (OGC 19-008r4), which LAS stores in three records.

use crate::input::crs::from_wkt::from_epsg;
use crate::input::crs::system::Crs;
use crate::input::crs::unit::Unit;
use crate::input::file::bytes::{float64, uint16};

const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC_TYPE: u16 = 2048;
const PROJECTED_TYPE: u16 = 3072;
const LINEAR_UNITS: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
const VERTICAL_UNITS: u16 = 4099;
/// The citations of the projected, the geographic and any system.
const CITATIONS: [u16; 3] = [3073, 2049, 1026];

/// The code that stands for a definition in other keys.
const USER_DEFINED: u16 = 32767;

/// The record of the key directory.
pub(crate) const DIRECTORY: u16 = 34735;
/// The record of the 64-bit floating-point values.
pub(crate) const DOUBLES: u16 = 34736;
/// The record of the texts.
pub(crate) const TEXTS: u16 = 34737;

/// The bytes of the three records, as they are in the file.
pub(crate) struct GeoKeys {
    /// [`DIRECTORY`]: 16-bit integers.
    pub(crate) directory: Vec<u8>,
    /// [`DOUBLES`].
    pub(crate) doubles: Vec<u8>,
    /// [`TEXTS`].
    pub(crate) texts: Vec<u8>,
}

impl GeoKeys {
    /// Returns the record, count and value (or index in the record) of `key`.
    fn entry(&self, key: u16) -> Option<(u16, u16, u16)> {
        let numbers = |index: usize| self.directory.chunks_exact(8).nth(index);
        let count = uint16(numbers(0)?, 6) as usize;
        let entry = (1..=count).map_while(numbers).find(|entry| uint16(entry, 0) == key)?;
        Some((uint16(entry, 2), uint16(entry, 4), uint16(entry, 6)))
    }

    fn code(&self, key: u16) -> Option<u16> {
        self.entry(key).filter(|(record, ..)| *record == 0).map(|(_, _, value)| value).filter(|value| *value != 0)
    }

    fn double(&self, key: u16) -> Option<f64> {
        let (record, _, index) = self.entry(key)?;
        let bytes = self.doubles.chunks_exact(8).nth(index as usize)?;
        (record == DOUBLES).then(|| float64(bytes, 0))
    }

    fn text(&self, key: u16) -> Option<String> {
        let (record, count, start) = self.entry(key)?;
        let bytes = self.texts.get(start as usize..start as usize + count as usize)?;
        let text = String::from_utf8_lossy(bytes).trim_matches(['|', '\0', ' ']).to_string();
        (record == TEXTS && !text.is_empty()).then_some(text)
    }

    /// Returns the metres of the unit of x and y, if a key gives it.
    fn linear_unit(&self) -> Option<f64> {
        match self.code(LINEAR_UNITS)? {
            USER_DEFINED => self.double(LINEAR_UNIT_SIZE).filter(|size| size.is_finite() && *size > 0.0),
            code => metres(code),
        }
    }
}

/// Returns the metres of a unit of length by its EPSG code.
fn metres(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(Unit::FOOT),
        9003 => Some(Unit::US_FOOT),
        9036 => Some(1000.0),
        _ => None,
    }
}

/// Returns the system that the keys describe; `None` if they say nothing.
pub(crate) fn parse(records: &GeoKeys) -> Option<Crs> {
    let model = records.code(MODEL_TYPE);
    let projected = records.code(PROJECTED_TYPE).filter(|_| model != Some(2));
    let code = projected.or_else(|| records.code(GEOGRAPHIC_TYPE).filter(|_| model != Some(1)));
    let epsg = code.filter(|code| *code != USER_DEFINED).map(u32::from);
    let known = epsg.and_then(from_epsg).unwrap_or_default();
    let degrees = projected.is_none() && (model == Some(2) || (model.is_none() && epsg.is_some()));
    let horizontal = match records.linear_unit() {
        _ if degrees => Unit::Degree,
        Some(metres) => Unit::from_metres(Some(metres)),
        None => known.horizontal,
    };
    let crs = Crs {
        // If a key gives another unit than the code, the text of the code would be wrong.
        wkt: known.wkt.filter(|_| known.horizontal == horizontal),
        epsg,
        horizontal,
        vertical: records.code(VERTICAL_UNITS).and_then(metres),
        name: known.name.or_else(|| CITATIONS.iter().find_map(|key| records.text(*key))),
    };
    (crs != Crs::default()).then_some(crs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records(keys: &[[u16; 4]], doubles: &[f64]) -> GeoKeys {
        let mut all = vec![[1, 1, 0, keys.len() as u16]];
        all.extend(keys);
        GeoKeys {
            directory: all.iter().flatten().flat_map(|number| number.to_le_bytes()).collect(),
            doubles: doubles.iter().flat_map(|number| number.to_le_bytes()).collect(),
            texts: b"My grid|".to_vec(),
        }
    }

    #[test]
    fn a_code_gives_unit_and_text() {
        let crs = parse(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 2949]], &[])).unwrap();
        assert_eq!((crs.epsg, crs.horizontal), (Some(2949), Unit::Metre));
        assert!(crs.wkt.unwrap().contains("MTM zone 7"));
    }

    #[test]
    fn a_unit_key_wins_over_the_code() {
        let crs = parse(&records(&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, 9003], [4099, 0, 1, 9003]], &[]))
            .unwrap();
        assert_eq!((crs.horizontal, crs.vertical), (Unit::UsFoot, Some(Unit::US_FOOT)));
        assert_eq!(crs.wkt, None);
    }

    #[test]
    fn user_defined_units_and_names_are_read() {
        let keys = [
            [1024, 0, 1, 1],
            [1026, TEXTS, 8, 0],
            [3072, 0, 1, USER_DEFINED],
            [3076, 0, 1, USER_DEFINED],
            [3077, DOUBLES, 1, 0],
        ];
        let crs = parse(&records(&keys, &[0.201168])).unwrap();
        assert_eq!((crs.horizontal, crs.name.as_deref()), (Unit::Other(0.201168), Some("My grid")));
    }

    #[test]
    fn geographic_systems_are_in_degrees_and_damaged_keys_are_no_system() {
        assert_eq!(parse(&records(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]], &[])).unwrap().horizontal, Unit::Degree);
        assert_eq!(parse(&records(&[[3076, DOUBLES, 9, 9], [1026, TEXTS, 9, 9000]], &[])), None);
        let cut = GeoKeys { directory: vec![1, 0, 1], doubles: Vec::new(), texts: Vec::new() };
        assert_eq!(parse(&cut), None);
    }
}
