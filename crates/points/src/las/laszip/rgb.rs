//! Colours, version 2; version 3 has the same models.

use std::io::Read;

use crate::las::laszip::models::ByteModel;
use crate::las::laszip::range_decoder::RangeDecoder;

/// The number of bytes of a colour.
pub(super) const SIZE: usize = 6;

/// The bytes of a colour: low byte and high byte of red, of green, of blue.
pub(super) type Rgb = [u8; SIZE];

/// The models of a colour after another.
pub(super) struct RgbModels {
    /// Which bytes change, and whether the colour is no grey.
    changes: ByteModel,
    bytes: [ByteModel; SIZE],
}

impl RgbModels {
    pub(super) fn new() -> Box<RgbModels> {
        Box::new(RgbModels { changes: ByteModel::new(128), bytes: std::array::from_fn(|_| ByteModel::new(256)) })
    }

    /// Returns the colour after `last`.
    #[inline(always)]
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>, last: Rgb) -> Rgb {
        let changes = data.symbol(&mut self.changes);
        let mut next = last;
        let low_red = self.change(data, changes, 0, &mut next[0], 0);
        let high_red = self.change(data, changes, 1, &mut next[1], 0);
        if changes & 64 == 0 {
            return [next[0], next[1], next[0], next[1], next[0], next[1]];
        }
        let low_green = self.change(data, changes, 2, &mut next[2], low_red);
        self.change(data, changes, 4, &mut next[4], (low_red + low_green) / 2);
        let high_green = self.change(data, changes, 3, &mut next[3], high_red);
        self.change(data, changes, 5, &mut next[5], (high_red + high_green) / 2);
        next
    }

    /// Changes byte `i`, which is expected to grow by `expected`, if it is among `changes`. Returns how much it grew.
    #[inline(always)]
    fn change<R: Read>(
        &mut self,
        data: &mut RangeDecoder<R>,
        changes: u32,
        i: usize,
        byte: &mut u8,
        expected: i32,
    ) -> i32 {
        if changes & 1 << i == 0 {
            return 0;
        }
        let last = *byte as i32;
        let guess = (last + expected).clamp(0, 255) as u8;
        *byte = guess.wrapping_add(data.symbol(&mut self.bytes[i]) as u8);
        *byte as i32 - last
    }
}
