//! Uncompressed point records, read block by block.

use std::ops::Range;

use crate::Result;
use crate::input::file::random_access::Positioned;
use crate::input::las::header::Header;
use crate::input::las::layout::Layout;
use crate::input::points::filter::Sieve;
use crate::input::points::rules::Rules;

/// Records of a piece.
const PIECE: u64 = 50_000;

/// Bytes read at once, unless a single record is longer.
const BLOCK: usize = 1 << 18;

/// The point data of a LAS file.
#[derive(Clone, Debug)]
pub(crate) struct Records {
    layout: Layout,
    points_at: u64,
    /// Whole records that the file holds.
    whole: u64,
    /// Records that the header promises and the file does not hold.
    pub(crate) missing: u64,
}

impl Records {
    /// The records of a file of `file_size` bytes.
    pub(crate) fn new(header: &Header, file_size: u64) -> Records {
        let layout = Layout::new(header.format, header.record_length);
        let extended = header.evlrs.0;
        let end = if header.evlrs.1 > 0 && extended > header.points_at { extended.min(file_size) } else { file_size };
        let room = (end - header.points_at) / layout.length as u64;
        let whole = header.records.min(room);
        Records { layout, points_at: header.points_at, whole, missing: header.records - whole }
    }

    /// The number of pieces; at least one where records are missing, to count them.
    pub(crate) fn pieces(&self) -> usize {
        (self.whole.div_ceil(PIECE) as usize).max((self.missing > 0) as usize)
    }

    fn range(&self, piece: usize) -> Range<u64> {
        let first = piece as u64 * PIECE;
        first..(first + PIECE).min(self.whole)
    }

    /// Sends the records of `piece` through `sieve`.
    pub(crate) fn decode(&self, file: &Positioned, piece: usize, rules: &Rules, sieve: &mut Sieve) -> Result<()> {
        let length = self.layout.length;
        let mut block = vec![0; (BLOCK / length).max(1) * length];
        let Range { start: mut number, end } = self.range(piece);
        while number < end {
            let count = ((block.len() / length) as u64).min(end - number);
            let bytes = &mut block[..count as usize * length];
            file.read_exact_at(bytes, self.points_at + number * length as u64)?;
            push_records(&self.layout, bytes, number, rules, sieve)?;
            number += count;
        }
        if piece + 1 == self.pieces() && self.missing > 0 {
            let (whole, missing) = (self.whole, self.missing);
            sieve.malformed(missing, || {
                format!(
                    "the header promises {} points, but the file ends after {whole} whole ones, so {missing} are missing; \
                     copy it again, or allow the loss",
                    whole + missing
                )
            });
        }
        Ok(())
    }
}

/// Sends whole records, the first of which has `number`, through `sieve`.
pub(crate) fn push_records(layout: &Layout, bytes: &[u8], number: u64, rules: &Rules, sieve: &mut Sieve) -> Result<()> {
    for (number, bytes) in (number..).zip(bytes.chunks_exact(layout.length)) {
        sieve.push(number, &layout.record(bytes, rules.rgb), || format!("point {number}"))?;
    }
    Ok(())
}
