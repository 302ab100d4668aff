//! Where the fields of a LAS point record lie, by point format.

use serde::{Deserialize, Serialize};

use crate::points::optional_fields::OptionalFields;
use crate::points::record::PointRecord;
use crate::points::returns::PulseReturn;
use sys::bytes::{int32, uint16};

/// The least record length of each point format, in bytes (LAS 1.4 R15, section 2.6).
pub(crate) const LEAST_LENGTHS: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// The positions of the fields that are read, in bytes from the start of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RecordLayout {
    /// Record length in bytes, including extra bytes.
    pub(crate) length: usize,
    /// Whether this is a point format of LAS 1.4 (6 to 10).
    extended: bool,
    rgb: Option<usize>,
}

impl RecordLayout {
    /// Returns the layout of point format `format` (0 to 10) with records of `length` bytes.
    pub(crate) fn new(format: u8, length: u16) -> RecordLayout {
        let rgb = match format {
            2 => Some(20),
            3 | 5 => Some(28),
            7 | 8 | 10 => Some(30),
            _ => None,
        };
        RecordLayout { length: length as usize, extended: format >= 6, rgb }
    }

    /// Returns whether records hold red, green and blue.
    pub(crate) fn has_rgb(&self) -> bool {
        self.rgb.is_some()
    }

    /// Reads a record of at least `self.length` bytes.
    #[inline(always)]
    pub(crate) fn record(&self, bytes: &[u8], fields: OptionalFields) -> PointRecord {
        // All formats begin with so many bytes. Their length is checked once.
        let head = &bytes[..LEAST_LENGTHS[0] as usize];
        let raw = [int32(head, 0) as i64, int32(head, 4) as i64, int32(head, 8) as i64];
        let (class, withheld) =
            if self.extended { (head[16], head[15] & 4 != 0) } else { (head[15] & 31, head[15] & 128 != 0) };
        let rgb = match self.rgb {
            Some(at) if fields.rgb => {
                let rgb = &bytes[at..at + 6];
                [uint16(rgb, 0), uint16(rgb, 2), uint16(rgb, 4)]
            }
            _ => [0; 3],
        };
        let intensity = if fields.intensity { uint16(head, 12) } else { 0 };
        let (number, of) =
            if self.extended { (head[14] & 15, head[14] >> 4) } else { (head[14] & 7, head[14] >> 3 & 7) };
        let pulse_return = PulseReturn { number, of };
        PointRecord { raw, rgb, intensity, class, withheld, pulse_return, rounded: [false; 2] }
    }
}
