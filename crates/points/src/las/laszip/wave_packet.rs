//! Wave packets, version 1: where the waveform of a point is stored, and its direction. This program does not use them, but the fields
//! behind them can be decoded only after them.

use std::io::Read;

use crate::las::laszip::integer::IntegerDecoder;
use crate::las::laszip::models::{ByteModel, SmallModel};
use crate::las::laszip::range_decoder::RangeDecoder;

/// The number of bytes of a wave packet.
pub(super) const SIZE: usize = 29;

/// The latest wave packet, and the models of the next.
pub(super) struct WavePacketDecoder {
    /// Where the waveform begins, and its number of bytes.
    offset: u64,
    bytes: i32,
    /// The place of the return in the waveform, and the direction in x, y and z: the bits of floating-point numbers.
    place: i32,
    direction: [i32; 3],
    /// The latest step of the offset that had an integer of its own.
    step: i32,
    /// How the offset went on the last time, which tells the model of the next.
    way: usize,
    descriptors: ByteModel,
    ways: [SmallModel; 4],
    steps: IntegerDecoder,
    sizes: IntegerDecoder,
    places: IntegerDecoder,
    directions: IntegerDecoder,
}

impl WavePacketDecoder {
    /// Starts behind the wave packet `first`.
    pub(super) fn new(first: &[u8; SIZE]) -> WavePacketDecoder {
        let [_, packet @ ..] = first;
        let word = |number: usize| std::array::from_fn(|i| packet[4 * number + i]);
        let integer = |number| i32::from_le_bytes(word(number));
        let low = u32::from_le_bytes(word(0)) as u64;
        WavePacketDecoder {
            offset: low | (u32::from_le_bytes(word(1)) as u64) << 32,
            bytes: integer(2),
            place: integer(3),
            direction: [4, 5, 6].map(integer),
            step: 0,
            way: 0,
            descriptors: ByteModel::new(256),
            ways: std::array::from_fn(|_| SmallModel::new(4)),
            steps: IntegerDecoder::new(32, 1),
            sizes: IntegerDecoder::new(32, 1),
            places: IntegerDecoder::new(32, 1),
            directions: IntegerDecoder::new(32, 3),
        }
    }

    /// Returns the next wave packet. Points with waveforms are rare, so this stays out of the loop over the others.
    #[inline(never)]
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> [u8; SIZE] {
        let descriptor = data.symbol(&mut self.descriptors) as u8;
        self.offset = self.next_offset(data);
        self.bytes = self.sizes.next(data, self.bytes, 0);
        self.place = self.places.next(data, self.place, 0);
        for (axis, component) in self.direction.iter_mut().enumerate() {
            *component = self.directions.next(data, *component, axis);
        }
        self.write(descriptor)
    }

    fn next_offset<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> u64 {
        self.way = (data.symbol(&mut self.ways[self.way]) & 3) as usize;
        match self.way {
            0 => self.offset,
            1 => self.offset.wrapping_add(self.bytes as u32 as u64),
            2 => {
                self.step = self.steps.next(data, self.step, 0);
                self.offset.wrapping_add_signed(self.step as i64)
            }
            _ => {
                let low = data.word() as u64;
                low | (data.word() as u64) << 32
            }
        }
    }

    fn write(&self, descriptor: u8) -> [u8; SIZE] {
        let mut out = [descriptor; SIZE];
        out[1..9].copy_from_slice(&self.offset.to_le_bytes());
        let [x, y, z] = self.direction;
        for (out, integer) in out[9..].chunks_exact_mut(4).zip([self.bytes, self.place, x, y, z]) {
            out.copy_from_slice(&integer.to_le_bytes());
        }
        out
    }
}
