//! The keys of GeoTIFF (OGC 19-008r4), which LAS stores in three records.

use std::ops::RangeInclusive;
use sys::bytes::{float64, uint16};

/// The code that stands for a definition in other keys.
pub(crate) const USER_DEFINED: u16 = 32767;

/// The record of the key directory.
pub const DIRECTORY: u16 = 34735;
/// The record of the 64-bit floating-point values.
pub const DOUBLES: u16 = 34736;
/// The record of the texts.
pub const TEXTS: u16 = 34737;

/// The bytes of the three records, as they are in the file.
pub struct GeoKeys {
    /// [`DIRECTORY`]: 16-bit integers.
    pub directory: Vec<u8>,
    /// [`DOUBLES`].
    pub doubles: Vec<u8>,
    /// [`TEXTS`].
    pub texts: Vec<u8>,
}

impl GeoKeys {
    /// Returns the bytes of the entries of the directory.
    fn entries(&self) -> impl Iterator<Item = &[u8]> {
        let mut numbers = self.directory.chunks_exact(8);
        let count = numbers.next().map_or(0, |head| uint16(head, 6) as usize);
        numbers.take(count)
    }

    /// Returns the record, count and value (or index in the record) of `key`.
    fn entry(&self, key: u16) -> Option<(u16, u16, u16)> {
        let entry = self.entries().find(|entry| uint16(entry, 0) == key)?;
        Some((uint16(entry, 2), uint16(entry, 4), uint16(entry, 6)))
    }

    /// Returns the keys in `range` that have numbers, as `key=value`.
    pub(crate) fn numbers(&self, range: RangeInclusive<u16>) -> Vec<String> {
        let mut keys: Vec<u16> =
            self.entries().map(|entry| uint16(entry, 0)).filter(|key| range.contains(key)).collect();
        keys.sort_unstable();
        keys.dedup();
        let value = |key: u16| match self.entry(key)? {
            (TEXTS, ..) => None,
            (0, _, value) => Some(format!("{key}={value}")),
            _ => Some(format!("{key}={}", self.double(key).map_or("?".into(), |value| value.to_string()))),
        };
        keys.into_iter().filter_map(value).collect()
    }

    /// Returns the number of `key`; 0 says nothing.
    pub(crate) fn code(&self, key: u16) -> Option<u16> {
        self.entry(key).filter(|(record, ..)| *record == 0).map(|(_, _, value)| value).filter(|value| *value != 0)
    }

    /// Returns whether `key` is there.
    pub(crate) fn has(&self, key: u16) -> bool {
        self.entry(key).is_some()
    }

    /// Returns whether `key` is there, but has no finite floating-point value.
    pub(crate) fn lacks_double(&self, key: u16) -> bool {
        self.has(key) && self.double(key).is_none()
    }

    /// Returns the finite floating-point value of `key`.
    pub(crate) fn double(&self, key: u16) -> Option<f64> {
        let (record, _, index) = self.entry(key)?;
        let bytes = self.doubles.chunks_exact(8).nth(index as usize)?;
        Some(float64(bytes, 0)).filter(|value| record == DOUBLES && value.is_finite())
    }

    /// Returns the text of `key`.
    pub(crate) fn text(&self, key: u16) -> Option<String> {
        let (record, count, start) = self.entry(key)?;
        let bytes = self.texts.get(start as usize..start as usize + count as usize)?;
        let text = String::from_utf8_lossy(bytes).trim_matches(['|', '\0', ' ']).to_string();
        (record == TEXTS && !text.is_empty()).then_some(text)
    }
}
