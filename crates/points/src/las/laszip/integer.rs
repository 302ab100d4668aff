//! Integers, as differences from what was expected.

use std::io::Read;

use crate::las::laszip::models::{BitModel, LazyModel, LengthModel};
use crate::las::laszip::range_decoder::RangeDecoder;

/// The number of leading bits of a difference that have a model; raw bits follow.
const MODELLED_BITS: u32 = 8;

/// A decoder of integers of one field.
pub(super) struct IntegerDecoder {
    /// The number of bits of the latest difference.
    length: u32,
    /// The number of bits of the integers.
    bits: u32,
    /// The numbers of bits, by the context.
    lengths: Vec<LengthModel>,
    /// The differences 0 and 1.
    bit: BitModel,
    /// The other differences, by the number of bits.
    differences: [LazyModel; 32],
}

impl IntegerDecoder {
    /// Returns a decoder of integers of `bits` bits, 16 or 32.
    pub(super) fn new(bits: u32, contexts: usize) -> IntegerDecoder {
        IntegerDecoder {
            length: 0,
            bits,
            lengths: vec![LengthModel::new(bits + 1); contexts],
            bit: BitModel::new(),
            differences: Default::default(),
        }
    }

    /// Returns the number of bits of the latest difference.
    #[inline(always)]
    pub(super) fn length(&self) -> u32 {
        self.length
    }

    /// Returns the next integer, near `expected` by habit.
    #[inline(always)]
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>, expected: i32, context: usize) -> i32 {
        self.length = data.symbol(&mut self.lengths[context]);
        let difference = match self.length {
            0 => data.bit(&mut self.bit) as i32,
            1..32 => self.difference(data),
            _ => i32::MIN,
        };
        let integer = expected.wrapping_add(difference);
        let count = 1i32.checked_shl(self.bits).unwrap_or(0);
        match integer {
            ..0 => integer.wrapping_add(count),
            _ if integer >= count => integer.wrapping_sub(count),
            _ => integer,
        }
    }

    /// Returns a difference of 1 to 31 bits. From the middle on it is positive, and 0 and 1 are left out.
    #[inline(always)]
    fn difference<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> i32 {
        let length = self.length & 31;
        let model = self.differences[length as usize].of(1 << length.min(MODELLED_BITS));
        let mut code = data.symbol(model);
        if length > MODELLED_BITS {
            let raw = length - MODELLED_BITS;
            code = code << raw | data.bits(raw);
        }
        let (code, middle) = (code as i32, 1 << (length - 1));
        if code >= middle { code.wrapping_add(1) } else { code.wrapping_sub(middle - 1 + middle) }
    }
}
