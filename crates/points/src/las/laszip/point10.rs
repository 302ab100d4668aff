//! The fields of point format 0, version 2.

use std::io::Read;

use crate::las::laszip::integer::IntegerDecoder;
use crate::las::laszip::median::RunningMedian;
use crate::las::laszip::models::{ByteModel, LazyModel};
use crate::las::laszip::range_decoder::RangeDecoder;
use crate::las::laszip::returns::{context_of_8, height_context};
use sys::bytes::{int32, uint16};

/// The number of bytes of the fields.
pub(super) const SIZE: usize = 20;

/// A model for each value that a byte had before.
type ByteModels = Box<[LazyModel; 256]>;

/// The latest fields, and the models of the next.
pub(super) struct Point10Decoder {
    xyz: [i32; 3],
    intensity: u16,
    returns: u8,
    class: u8,
    angle: u8,
    user_data: u8,
    source: u16,
    /// Which fields change.
    changes: Box<ByteModel>,
    return_bytes: ByteModels,
    classes: ByteModels,
    angles: [LazyModel; 2],
    user_bytes: ByteModels,
    intensities: IntegerDecoder,
    sources: IntegerDecoder,
    x_steps: IntegerDecoder,
    y_steps: IntegerDecoder,
    heights: IntegerDecoder,
    /// The latest intensities and steps in x and y, by the context of the return.
    last_intensities: [u16; 16],
    medians: [[RunningMedian; 2]; 16],
    /// The latest heights, by the context of heights.
    last_heights: [i32; 8],
}

impl Point10Decoder {
    /// Starts behind the first record.
    pub(super) fn new(first: &[u8]) -> Point10Decoder {
        let models = || Box::new([const { LazyModel::new() }; 256]);
        Point10Decoder {
            xyz: [0, 4, 8].map(|at| int32(first, at)),
            intensity: 0,
            returns: first[14],
            class: first[15],
            angle: first[16],
            user_data: first[17],
            source: uint16(first, 18),
            changes: Box::new(ByteModel::new(64)),
            return_bytes: models(),
            classes: models(),
            angles: Default::default(),
            user_bytes: models(),
            intensities: IntegerDecoder::new(16, 4),
            sources: IntegerDecoder::new(16, 1),
            x_steps: IntegerDecoder::new(32, 2),
            y_steps: IntegerDecoder::new(32, 22),
            heights: IntegerDecoder::new(32, 20),
            last_intensities: [0; 16],
            medians: Default::default(),
            last_heights: [0; 8],
        }
    }

    /// Decodes the next fields into `out`.
    #[inline(always)]
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>, out: &mut [u8; SIZE]) {
        let changes = data.symbol(&mut self.changes);
        if changes & 32 != 0 {
            self.returns = data.symbol(self.return_bytes[self.returns as usize].of(256)) as u8;
        }
        let (number, of) = (self.returns & 7, self.returns >> 3 & 7);
        let context = context_of_8(number, of);
        if changes != 0 {
            self.other_fields(data, changes, context);
        }
        self.place(data, context, (of == 1) as usize, height_context(number, of));
        self.write(out);
    }

    #[inline(always)]
    fn other_fields<R: Read>(&mut self, data: &mut RangeDecoder<R>, changes: u32, context: usize) {
        self.intensity = self.last_intensities[context];
        if changes & 16 != 0 {
            self.intensity = self.intensities.next(data, self.intensity as i32, context.min(3)) as u16;
            self.last_intensities[context] = self.intensity;
        }
        if changes & 8 != 0 {
            self.class = data.symbol(self.classes[self.class as usize].of(256)) as u8;
        }
        if changes & 4 != 0 {
            let direction = (self.returns >> 6 & 1) as usize;
            self.angle = self.angle.wrapping_add(data.symbol(self.angles[direction].of(256)) as u8);
        }
        if changes & 2 != 0 {
            self.user_data = data.symbol(self.user_bytes[self.user_data as usize].of(256)) as u8;
        }
        if changes & 1 != 0 {
            self.source = self.sources.next(data, self.source as i32, 0) as u16;
        }
    }

    #[inline(always)]
    fn place<R: Read>(&mut self, data: &mut RangeDecoder<R>, context: usize, single: usize, level: usize) {
        let [x, y, z] = &mut self.xyz;
        let [x_median, y_median] = &mut self.medians[context];
        let step = self.x_steps.next(data, x_median.get(), single);
        *x = x.wrapping_add(step);
        x_median.add(step);
        let length = self.x_steps.length();
        let step = self.y_steps.next(data, y_median.get(), single + (length & !1).min(20) as usize);
        *y = y.wrapping_add(step);
        y_median.add(step);
        let length = (length + self.y_steps.length()) / 2;
        *z = self.heights.next(data, self.last_heights[level], single + (length & !1).min(18) as usize);
        self.last_heights[level] = *z;
    }

    #[inline(always)]
    fn write(&self, out: &mut [u8; SIZE]) {
        let [x, y, z] = self.xyz.map(|coordinate| coordinate as u32 as u64);
        let rest = (self.intensity as u64) << 32 | (self.returns as u64) << 48 | (self.class as u64) << 56;
        out[..8].copy_from_slice(&(x | y << 32).to_le_bytes());
        out[8..16].copy_from_slice(&(z | rest).to_le_bytes());
        let source = (self.source as u32) << 16;
        out[16..].copy_from_slice(&(self.angle as u32 | (self.user_data as u32) << 8 | source).to_le_bytes());
    }
}
