//! GPS times, version 2. Times are taken as the integers of their bits, and are followed in up to four sequences at once.

use std::io::Read;

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::integer::IntegerDecoder;
use crate::las::laszip::models::{SmallModel, TimeModel};
use crate::las::laszip::range_decoder::RangeDecoder;

/// The number of bytes of a time.
pub(super) const SIZE: usize = 8;

/// The greatest and the least multiple of the step before that has a symbol of its own.
const MOST: i32 = 500;
const LEAST: i32 = -10;

/// The symbols after those of the multiples: the time is as before, begins a sequence, or (from there on) belongs to another.
const UNCHANGED: i32 = MOST - LEAST + 1;
const NEW_SEQUENCE: i32 = UNCHANGED + 1;

/// The number of changes of the sequence that a time may have. LASzip writes one at most.
const MOST_CHANGES: usize = 8;

/// A run of times with steps that are multiples of each other.
#[derive(Clone, Copy, Default)]
struct Sequence {
    time: i64,
    step: i32,
    /// How often since the latest usual step the multiple was 0, or out of bounds.
    unusual: u32,
}

pub(super) struct GpsTimeDecoder {
    sequences: [Sequence; 4],
    current: usize,
    latest: usize,
    /// How a time goes on if the step before was 0, and if it was not.
    without_step: SmallModel,
    multiples: Box<TimeModel>,
    steps: IntegerDecoder,
}

impl GpsTimeDecoder {
    /// Starts behind the time `first`.
    pub(super) fn new(first: [u8; SIZE]) -> GpsTimeDecoder {
        let mut sequences = [Sequence::default(); 4];
        sequences[0].time = i64::from_le_bytes(first);
        GpsTimeDecoder {
            sequences,
            current: 0,
            latest: 0,
            without_step: SmallModel::new(6),
            multiples: Box::new(TimeModel::new(516)),
            steps: IntegerDecoder::new(32, 9),
        }
    }

    /// Returns the next time.
    #[inline(always)]
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> Result<[u8; SIZE], DecodeError> {
        for _ in 0..=MOST_CHANGES {
            let change = if self.sequences[self.current & 3].step == 0 {
                self.after_no_step(data)
            } else {
                self.after_step(data)
            };
            match change {
                0 => return Ok(self.sequences[self.current & 3].time.to_le_bytes()),
                _ => self.current = (self.current + change as usize) & 3,
            }
        }
        data.check_end()?;
        Err(DecodeError::Nonsense)
    }

    /// Returns how many sequences further the time is; 0 if this one now has it.
    #[inline(always)]
    fn after_no_step<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> u32 {
        match data.symbol(&mut self.without_step) {
            0 => {}
            1 => {
                let sequence = &mut self.sequences[self.current & 3];
                sequence.step = self.steps.next(data, 0, 0);
                sequence.time = sequence.time.wrapping_add(sequence.step as i64);
                sequence.unusual = 0;
            }
            2 => self.begin_sequence(data),
            further => return further - 2,
        }
        0
    }

    /// Returns how many sequences further the time is; 0 if this one now has it.
    #[inline(always)]
    fn after_step<R: Read>(&mut self, data: &mut RangeDecoder<R>) -> u32 {
        let symbol = data.symbol(&mut self.multiples) as i32;
        let (multiple, context, is_unusual) = match symbol {
            0 => (0, 7, true),
            1 => (1, 1, false),
            2..10 => (symbol, 2, false),
            10..MOST => (symbol, 3, false),
            MOST => (MOST, 4, true),
            UNCHANGED => return 0,
            NEW_SEQUENCE => {
                self.begin_sequence(data);
                return 0;
            }
            _ if symbol > NEW_SEQUENCE => return (symbol - NEW_SEQUENCE) as u32,
            _ if MOST - symbol > LEAST => (MOST - symbol, 5, false),
            _ => (LEAST, 6, true),
        };
        let sequence = &mut self.sequences[self.current & 3];
        let step = self.steps.next(data, sequence.step.wrapping_mul(multiple), context);
        sequence.time = sequence.time.wrapping_add(step as i64);
        if is_unusual {
            sequence.unusual += 1;
            if sequence.unusual > 3 {
                sequence.step = step;
                sequence.unusual = 0;
            }
        } else if multiple == 1 {
            sequence.unusual = 0;
        }
        0
    }

    #[cold]
    fn begin_sequence<R: Read>(&mut self, data: &mut RangeDecoder<R>) {
        let high = self.steps.next(data, (self.sequences[self.current & 3].time >> 32) as i32, 8);
        self.latest = (self.latest + 1) & 3;
        self.current = self.latest;
        let time = (high as i64) << 32 | data.word() as i64;
        self.sequences[self.current] = Sequence { time, step: 0, unusual: 0 };
    }
}
