//! Points of a node as records of numbers, one after the other, whose order and sizes the schema of the index has.

use std::io::Read;

use ruzstd::decoding::StreamingDecoder;
use serde::{Deserialize, Serialize};

use crate::ept::dimension::Dimension;
use crate::points::optional_fields::OptionalFields;
use crate::points::record::PointRecord;
use crate::points::returns::PulseReturn;
use sys::catch_panic::catch_panic;

/// The bit of `ClassFlags` of points that their producer has withdrawn.
const WITHHELD: i64 = 4;

/// A whole number in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Field {
    /// The position of its first byte.
    at: usize,
    /// 1, 2, 4 or 8 bytes, the least first.
    size: usize,
    is_signed: bool,
}

/// Where the fields that are read lie in a record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct BinaryLayout {
    /// The bytes of a record.
    pub(crate) length: usize,
    place: [Option<Field>; 3],
    rgb: Option<[Field; 3]>,
    intensity: Option<Field>,
    class: Option<Field>,
    /// The number of the return, and of the returns of its pulse.
    returns: [Option<Field>; 2],
    withheld: Option<Field>,
    flags: Option<Field>,
}

impl BinaryLayout {
    /// Returns the layout by a schema.
    ///
    /// # Errors
    /// A sentence about a dimension that no record can have.
    pub(crate) fn of(schema: &[Dimension]) -> Result<BinaryLayout, String> {
        let mut length = 0_usize;
        let mut fields = Vec::with_capacity(schema.len());
        for Dimension { name, kind, size, .. } in schema {
            if ![1, 2, 4, 8].contains(size) {
                return Err(format!("has the dimension {name} of {size} bytes in its schema, of 1, 2, 4 or 8"));
            }
            let is_whole = ["signed", "unsigned"].contains(&kind.as_str());
            fields.extend(is_whole.then_some((name, Field { at: length, size: *size, is_signed: kind == "signed" })));
            length += size;
        }
        let field = |name: &str| fields.iter().find(|(known, _)| *known == name).map(|(_, field)| *field);
        let rgb = match [field("Red"), field("Green"), field("Blue")] {
            [Some(red), Some(green), Some(blue)] => Some([red, green, blue]),
            _ => None,
        };
        Ok(BinaryLayout {
            length,
            place: [field("X"), field("Y"), field("Z")],
            rgb,
            intensity: field("Intensity"),
            class: field("Classification"),
            returns: [field("ReturnNumber"), field("NumberOfReturns")],
            withheld: field("Withheld"),
            flags: field("ClassFlags"),
        })
    }

    /// Reads a record of `self.length` bytes; `None` if a coordinate is no integer that LAS could hold.
    pub(crate) fn record(&self, bytes: &[u8], fields: OptionalFields) -> Option<PointRecord> {
        let value = |field: Option<Field>| field.map_or(0, |field| field.value(bytes));
        let raw = self.place.map(value);
        if raw.iter().any(|raw| i32::try_from(*raw).is_err()) {
            return None;
        }
        let within = |value: i64, most: u16| value.clamp(0, i64::from(most)) as u16;
        let rgb = self.rgb.filter(|_| fields.rgb).map(|rgb| rgb.map(|field| within(field.value(bytes), u16::MAX)));
        let small = |field: Option<Field>| within(value(field), u8::MAX.into()) as u8;
        let [number, of] = self.returns.map(small);
        Some(PointRecord {
            raw,
            rgb: rgb.unwrap_or_default(),
            intensity: if fields.intensity { within(value(self.intensity), u16::MAX) } else { 0 },
            class: small(self.class),
            withheld: value(self.withheld) != 0 || value(self.flags) & WITHHELD != 0,
            pulse_return: PulseReturn { number, of },
            rounded: [false; 2],
        })
    }
}

impl Field {
    fn value(&self, record: &[u8]) -> i64 {
        let mut wide = [0; 8];
        let bytes = &record[self.at..self.at + self.size];
        wide[..self.size].copy_from_slice(bytes);
        if self.is_signed && bytes.last().is_some_and(|last| last & 0x80 != 0) {
            wide[self.size..].fill(0xff);
        }
        // An unsigned number beyond all signed ones is one that no field may have.
        match i64::from_le_bytes(wide) {
            value if self.is_signed || value >= 0 => value,
            _ => i64::MAX,
        }
    }
}

/// Returns the records in the bytes of a compressed node, or as many as there are, and what is wrong with the others. There are at most
/// `most` bytes.
pub(crate) fn decompressed(bytes: &[u8], most: usize) -> (Vec<u8>, Option<String>) {
    let mut records = Vec::new();
    let outcome = catch_panic(|| {
        let decoder = StreamingDecoder::new(bytes).map_err(|error| error.to_string())?;
        decoder.take(most as u64).read_to_end(&mut records).map(drop).map_err(|error| error.to_string())
    });
    let damage = outcome.unwrap_or_else(|panic| Err(panic.to_string())).err();
    (records, damage)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dimension(name: &str, kind: &str, size: usize) -> Dimension {
        serde_json::from_value(serde_json::json!({ "name": name, "type": kind, "size": size })).unwrap()
    }

    const ALL: OptionalFields = OptionalFields { rgb: true, intensity: true };

    #[test]
    fn fields_are_read_by_their_names() {
        let schema = [
            dimension("GpsTime", "floating", 8),
            dimension("X", "signed", 4),
            dimension("Y", "signed", 8),
            dimension("Z", "unsigned", 2),
            dimension("Intensity", "unsigned", 2),
            dimension("Classification", "unsigned", 1),
            dimension("ClassFlags", "unsigned", 1),
            dimension("ReturnNumber", "unsigned", 1),
            dimension("NumberOfReturns", "unsigned", 1),
            dimension("Red", "unsigned", 2),
            dimension("Green", "unsigned", 2),
            dimension("Blue", "unsigned", 2),
        ];
        let layout = BinaryLayout::of(&schema).unwrap();
        assert_eq!(layout.length, 34);
        let mut bytes = vec![0xff; 8];
        bytes.extend((-5_i32).to_le_bytes());
        bytes.extend(7_i64.to_le_bytes());
        bytes.extend(60_000_u16.to_le_bytes());
        bytes.extend([1, 2, 9, 4, 2, 3, 1, 0, 2, 0, 3, 0]);
        let record = layout.record(&bytes, ALL).unwrap();
        let pulse_return = PulseReturn { number: 2, of: 3 };
        let expected = PointRecord {
            raw: [-5, 7, 60_000],
            rgb: [1, 2, 3],
            intensity: 513,
            class: 9,
            withheld: true,
            pulse_return,
            rounded: [false; 2],
        };
        assert_eq!(record, expected);
        let plain = layout.record(&bytes, OptionalFields::default()).unwrap();
        assert_eq!((plain.rgb, plain.intensity), ([0; 3], 0));
        bytes[12..20].copy_from_slice(&(1_i64 << 31).to_le_bytes());
        assert_eq!(layout.record(&bytes, ALL), None, "beyond what LAS can hold");
    }

    #[test]
    fn a_schema_has_sizes_of_numbers() {
        assert!(BinaryLayout::of(&[dimension("X", "signed", 3)]).unwrap_err().contains("X of 3 bytes"));
        let large = BinaryLayout::of(&[dimension("X", "unsigned", 8)]).unwrap();
        assert_eq!(large.record(&[0xff; 8], ALL), None);
    }

    #[test]
    fn compressed_records_are_decoded_as_far_as_they_go() {
        let records: Vec<u8> = (0..100_000_u32).flat_map(|i| (i / 7).to_le_bytes()).collect();
        let packed = ruzstd::encoding::compress_to_vec(&records[..], ruzstd::encoding::CompressionLevel::Fastest);
        assert_eq!(decompressed(&packed, records.len() + 1), (records.clone(), None));
        assert_eq!(decompressed(&packed, 10).0, records[..10]);
        let (some, damage) = decompressed(&packed[..packed.len() / 2], records.len());
        assert!(damage.is_some() && records.starts_with(&some));
        assert!(decompressed(b"no frame", 9).1.is_some());
    }
}
