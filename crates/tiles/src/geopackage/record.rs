//! Rows of an SQLite database as bytes.

/// A value in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Null,
    Integer(i64),
    Real(f64),
    Text(&'a str),
    Blob(&'a [u8]),
}

impl Value<'_> {
    /// Returns the code of the type and the length of a value.
    fn code(&self) -> u64 {
        match *self {
            Value::Null => 0,
            Value::Integer(0) => 8,
            Value::Integer(1) => 9,
            Value::Integer(i) => match i {
                -0x80..=0x7f => 1,
                -0x8000..=0x7fff => 2,
                -0x80_0000..=0x7f_ffff => 3,
                -0x8000_0000..=0x7fff_ffff => 4,
                -0x8000_0000_0000..=0x7fff_ffff_ffff => 5,
                _ => 6,
            },
            Value::Real(_) => 7,
            Value::Text(text) => 13 + 2 * text.len() as u64,
            Value::Blob(bytes) => 12 + 2 * bytes.len() as u64,
        }
    }

    fn add_to(&self, bytes: &mut Vec<u8>) {
        match *self {
            Value::Null => {}
            Value::Integer(i) => {
                let length = [0, 1, 2, 3, 4, 6, 8, 0, 0, 0][self.code() as usize];
                bytes.extend_from_slice(&i.to_be_bytes()[8 - length..]);
            }
            Value::Real(number) => bytes.extend_from_slice(&number.to_be_bytes()),
            Value::Text(text) => bytes.extend_from_slice(text.as_bytes()),
            Value::Blob(blob) => bytes.extend_from_slice(blob),
        }
    }
}

/// Returns a row as its table or index has it.
pub(super) fn record(values: &[Value]) -> Vec<u8> {
    let mut codes = Vec::new();
    values.iter().for_each(|value| add_varint(&mut codes, value.code()));
    // The length of the head counts itself: one byte for all heads of fewer than 127 bytes, and no table has so many columns.
    let length = codes.len() as u64 + if codes.len() < 127 { 1 } else { 2 };
    let mut bytes = Vec::new();
    add_varint(&mut bytes, length);
    bytes.append(&mut codes);
    values.iter().for_each(|value| value.add_to(&mut bytes));
    bytes
}

/// Adds a number of one to nine bytes: seven bits each, and eight in the ninth.
pub(super) fn add_varint(bytes: &mut Vec<u8>, number: u64) {
    let length = (1..9).find(|length| number < 1 << (7 * length)).unwrap_or(9);
    if length == 9 {
        (0..8).for_each(|n| bytes.push((number >> (57 - 7 * n)) as u8 | 0x80));
        bytes.push(number as u8);
        return;
    }
    for n in (0..length).rev() {
        let more = if n > 0 { 0x80 } else { 0 };
        bytes.push((number >> (7 * n)) as u8 & 0x7f | more);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_seven_bits_in_a_byte() {
        let of = |number| {
            let mut bytes = Vec::new();
            add_varint(&mut bytes, number);
            bytes
        };
        assert_eq!(of(0), [0]);
        assert_eq!(of(127), [127]);
        assert_eq!(of(128), [0x81, 0]);
        assert_eq!(of((1 << 56) - 1), [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f]);
        assert_eq!(of(1 << 56), [0x80, 0xc0, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0]);
        assert_eq!(of(u64::MAX), [0xff; 9]);
    }

    #[test]
    fn a_row_has_its_types_and_then_its_values() {
        let values = [Value::Null, Value::Integer(1), Value::Integer(-300), Value::Text("ab"), Value::Blob(&[7])];
        assert_eq!(record(&values), [6, 0, 9, 2, 17, 14, 0xfe, 0xd4, b'a', b'b', 7]);
    }
}
