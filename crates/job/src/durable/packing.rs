//! Packing whole numbers into few bits: neighbouring values of a column differ little, so a group of them takes little more than the
//! bits of their differences.
//!
//! Values go in groups of 256. Each column of a group has a frame of its own: the least value, the number of bits of the greatest
//! difference to it, and the number of zero bits at the end of all differences, which are left out (colours are often 8 bits times
//! 256). Full groups are laid out for vector instructions; the last one in pieces of 32, so that little is padded.

use crate::durable::bits::{self, PIECE, pack_group, unpack_group};
use multiversion::multiversion;

/// Values of a full group.
const GROUP: usize = 256;

/// A column of a group.
type Column = [u32; GROUP];

/// Appends `values` to `bytes`. `split` makes `N` columns of them; columns take few bits where values next to each other differ
/// little as signed numbers.
pub fn pack<T, const N: usize>(values: &[T], split: impl Fn(&T) -> [u32; N], bytes: &mut Vec<u8>) {
    let mut columns: [Column; N] = [[0; GROUP]; N];
    for group in values.chunks(GROUP) {
        for (at, value) in group.iter().enumerate() {
            let parts = split(value);
            for (column, part) in columns.iter_mut().zip(parts) {
                column[at] = part;
            }
        }
        columns.iter_mut().for_each(|column| pack_column(column, group.len(), bytes));
    }
}

/// Appends the `count` values in `bytes` to `values`; `join` makes one of its columns. Returns what follows in `bytes`, or `None` if
/// they hold no such values.
#[must_use]
pub fn unpack<'a, T, const N: usize>(
    mut bytes: &'a [u8],
    count: usize,
    join: impl Fn([u32; N]) -> T,
    values: &mut Vec<T>,
) -> Option<&'a [u8]> {
    let mut columns: [Column; N] = [[0; GROUP]; N];
    let mut left = count;
    while left > 0 {
        let length = left.min(GROUP);
        for column in &mut columns {
            bytes = unpack_column(bytes, length, column)?;
        }
        values.extend((0..length).map(|at| join(std::array::from_fn(|column| columns[column][at]))));
        left -= length;
    }
    Some(bytes)
}

/// Appends the first `length` values of `column`, and leaves differences in it.
fn pack_column(column: &mut Column, length: usize, bytes: &mut Vec<u8>) {
    let values = &mut column[..length];
    let (least, used) = subtract_least(values);
    let shift = if used == 0 { 0 } else { used.trailing_zeros() };
    let width = (u32::BITS - (used >> shift).leading_zeros()) as u8;
    bytes.extend_from_slice(&least.to_ne_bytes());
    bytes.extend_from_slice(&[width, shift as u8]);
    if shift > 0 {
        values.iter_mut().for_each(|value| *value >>= shift);
    }
    let start = bytes.len();
    bytes.resize(start + packed_bytes(length, width), 0);
    let packed = &mut bytes[start..];
    if length == GROUP {
        pack_group(column, width.into(), packed);
        return;
    }
    column[length..].fill(0);
    for (piece, packed) in column.chunks_exact(PIECE).zip(packed.chunks_exact_mut(packed_piece(width).max(1))) {
        bits::pack::<1>(piece, width.into(), packed);
    }
}

/// Reads `length` values into `column` and returns what follows in `bytes`.
fn unpack_column<'a>(bytes: &'a [u8], length: usize, column: &mut Column) -> Option<&'a [u8]> {
    let (least, rest) = bytes.split_first_chunk()?;
    let (&[width, shift], rest) = rest.split_first_chunk()?;
    let (least, shift) = (u32::from_ne_bytes(*least), shift as u32);
    if width as u32 + shift > u32::BITS || shift == u32::BITS {
        return None;
    }
    let (packed, rest) = rest.split_at_checked(packed_bytes(length, width))?;
    match width {
        0 => column[..length].fill(0),
        _ if length == GROUP => unpack_group(packed, width.into(), column),
        _ => {
            for (packed, piece) in packed.chunks_exact(packed_piece(width)).zip(column.chunks_exact_mut(PIECE)) {
                bits::unpack::<1>(packed, width.into(), piece);
            }
        }
    }
    add_least(&mut column[..length], shift, least);
    Some(rest)
}

/// Leaves the differences to the least of `values`. Returns the least, and the bits that any difference has.
#[multiversion(targets("x86_64+avx2"))]
fn subtract_least(values: &mut [u32]) -> (u32, u32) {
    let least = values.iter().fold(i32::MAX, |least, &value| least.min(value as i32)) as u32;
    let mut used = 0;
    for value in values {
        *value = value.wrapping_sub(least);
        used |= *value;
    }
    (least, used)
}

#[multiversion(targets("x86_64+avx2"))]
fn add_least(values: &mut [u32], shift: u32, least: u32) {
    values.iter_mut().for_each(|value| *value = (*value << shift).wrapping_add(least));
}

/// Returns the bytes that `length` values of a group take.
fn packed_bytes(length: usize, width: u8) -> usize {
    length.div_ceil(PIECE) * packed_piece(width)
}

fn packed_piece(width: u8) -> usize {
    PIECE / u8::BITS as usize * width as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(values: &[[u32; 2]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        pack(values, |value| *value, &mut bytes);
        bytes
    }

    fn round_trip(values: &[[u32; 2]]) -> usize {
        let mut bytes = packed(values);
        let length = bytes.len();
        bytes.push(77);
        let mut unpacked = vec![[3, 4]];
        let rest = unpack(&bytes, values.len(), |value| value, &mut unpacked).unwrap();
        assert_eq!((rest, &unpacked[1..]), (&[77][..], values));
        length
    }

    #[test]
    fn columns_take_the_bits_of_their_differences() {
        let header = 2 * 6;
        assert_eq!(round_trip(&[]), 0);
        assert_eq!(round_trip(&[[7, u32::MAX]; 256]), header);
        // Differences of 0 to 255, and multiples of 512 up to 15: 8 and 4 bits.
        let values: Vec<[u32; 2]> = (0..256).map(|i: u32| [i.wrapping_sub(100), 5 + (i % 16) * 512]).collect();
        assert_eq!(round_trip(&values), header + 256 + 128);
        // In pieces of 32: the last 4 values take as much as 32.
        assert_eq!(round_trip(&values[..100]), header + 4 * 28 + 4 * 16);
    }

    #[test]
    fn extreme_values_come_back() {
        let extremes = [0, 1, i32::MAX as u32, i32::MIN as u32, u32::MAX, 1 << 30, !(1 << 30)];
        for count in [1, 2, 31, 32, 33, 255, 256, 257, 511, 512, 1000] {
            for first in 0..extremes.len() {
                let value = |i: usize| [extremes[(first + i) % 7], extremes[(first + i / 3) % 7]];
                round_trip(&(0..count).map(value).collect::<Vec<_>>());
                round_trip(&vec![[extremes[first], extremes[6 - first]]; count]);
            }
        }
    }

    #[test]
    fn what_is_cut_off_has_no_values() {
        let bytes = packed(&(0..300).map(|i| [i * 3, i << 20]).collect::<Vec<_>>());
        for end in 0..bytes.len() {
            assert!(unpack(&bytes[..end], 300, |value: [u32; 2]| value, &mut Vec::new()).is_none(), "{end}");
        }
    }

    proptest! {
        #[test]
        fn any_values_come_back(
            values in prop::collection::vec(any::<[u32; 2]>(), 0..600),
            mask in any::<[u32; 2]>(),
            shift in 0u32..32,
        ) {
            let narrow = |value: &[u32; 2]| [value[0] & mask[0], (value[1] >> shift << (shift / 2)).wrapping_add(mask[1])];
            round_trip(&values.iter().map(narrow).collect::<Vec<_>>());
        }

        /// Whatever a broken disk gives back, nothing panics.
        #[test]
        fn any_bytes_are_values_or_nothing(bytes in prop::collection::vec(any::<u8>(), 0..2000), count in 0usize..600) {
            let mut values = Vec::new();
            let rest = unpack(&bytes, count, |value: [u32; 3]| value, &mut values);
            prop_assert!(rest.is_none() || values.len() == count);
        }
    }
}
