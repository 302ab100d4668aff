//! The arithmetic decoder: a number in an interval, which each symbol narrows, and which bytes of the data widen again.

use std::io::{self, Read, Seek, SeekFrom};

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::models::{BitModel, SymbolModel};

/// The number of bytes in memory at once; a power of two.
const WINDOW: usize = 1 << 12;

/// The number of bytes that are looked at together.
const LOOK: usize = 4;

/// Bytes that suffice between two calls of [`RangeDecoder::refill`]. A symbol takes at most 2, raw bits take at most 6. The fields of
/// a record are fewer than 50 symbols, and at most 14 numbers of raw bits.
const RESERVE: usize = 1 << 8;

/// `value` is always less than `length`, whatever the data are. That bounds all products here, and the search for a symbol.
pub(super) struct RangeDecoder<R> {
    value: u32,
    length: u32,
    /// The position in the window of the next byte; behind `filled` once bytes were used that the data do not have.
    at: usize,
    /// The number of bytes in the window; zeros follow.
    filled: usize,
    window: Box<[u8; WINDOW + LOOK]>,
    source: R,
}

impl<R: Read> RangeDecoder<R> {
    /// Starts to decode `source`.
    pub(super) fn new(source: R) -> Result<RangeDecoder<R>, DecodeError> {
        let mut decoder = RangeDecoder::over_nothing(source);
        decoder.read_window()?;
        decoder.value = decoder.look();
        decoder.at = LOOK;
        decoder.check_end()?;
        // No LASzip writes this, and it would break the rule that the value is less than the length.
        if decoder.value == decoder.length { Err(DecodeError::Nonsense) } else { Ok(decoder) }
    }

    /// Returns a decoder that finds nothing but zeros in `source`, which has no bytes.
    pub(super) fn over_nothing(source: R) -> RangeDecoder<R> {
        let window = Box::new([0; WINDOW + LOOK]);
        RangeDecoder { value: 0, length: u32::MAX, at: 0, filled: 0, window, source }
    }

    /// Makes sure that the window has [`RESERVE`] bytes, unless the data end.
    #[inline(always)]
    pub(super) fn refill(&mut self) -> Result<(), DecodeError> {
        if self.at > WINDOW - RESERVE { self.read_window() } else { Ok(()) }
    }

    /// Fails if bytes were used that the data do not have.
    #[inline(always)]
    pub(super) fn check_end(&self) -> Result<(), DecodeError> {
        if self.at > self.filled { Err(DecodeError::CutShort) } else { Ok(()) }
    }

    #[cold]
    #[inline(never)]
    fn read_window(&mut self) -> Result<(), DecodeError> {
        self.check_end()?;
        self.window.copy_within(self.at..self.filled, 0);
        self.filled -= self.at;
        self.at = 0;
        while self.filled < WINDOW {
            match self.source.read(&mut self.window[self.filled..WINDOW]) {
                Ok(0) => break,
                Ok(count) => self.filled += count.min(WINDOW - self.filled),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(DecodeError::Read(error)),
            }
        }
        self.window[self.filled..].fill(0);
        Ok(())
    }

    /// Returns the next bytes, of which none is used yet.
    #[inline(always)]
    fn look(&self) -> u32 {
        let at = self.at & (WINDOW - 1);
        u32::from_be_bytes([self.window[at], self.window[at + 1], self.window[at + 2], self.window[at + 3]])
    }

    /// Widens the interval by `bytes` bytes, at most 3. How many cannot be foreseen, so this has no branch.
    #[inline(always)]
    fn widen(&mut self, bytes: u32) {
        let bits = bytes << 3;
        self.value = self.value << bits | (self.look() as u64 >> (32 - bits)) as u32;
        self.length <<= bits;
        self.at += bytes as usize;
    }

    /// Returns the next symbol.
    #[inline(always)]
    pub(super) fn symbol<const SYMBOLS: usize, const TABLE: usize>(
        &mut self,
        model: &mut SymbolModel<SYMBOLS, TABLE>,
    ) -> u32 {
        // At least 2^9, since the length is at least 2^24 between symbols.
        let unit = self.length >> 15;
        // The check costs less time than a bound that the compiler understands.
        let place = self.value.checked_div(unit).unwrap_or(0);
        let (symbol, low, high) = model.find(place);
        let low = low * unit;
        // The end of the last symbol is beyond the length.
        let high = (high as u64 * unit as u64).min(self.length as u64) as u32;
        self.value -= low;
        self.length = high - low;
        // No symbol is narrower than a unit.
        self.widen((self.length < 1 << 24) as u32 + (self.length < 1 << 16) as u32);
        model.count(symbol);
        symbol as u32
    }

    /// Returns the next bit.
    #[inline(always)]
    pub(super) fn bit(&mut self, model: &mut BitModel) -> u32 {
        let zeros = model.share_of_zeros * (self.length >> BitModel::SHARE_BITS);
        let bit = self.value >= zeros;
        if bit {
            self.value -= zeros;
            self.length -= zeros;
        } else {
            self.length = zeros;
        }
        self.widen((self.length < 1 << 24) as u32 + (self.length < 1 << 16) as u32);
        model.count(bit);
        bit as u32
    }

    /// Returns the next `bits` raw bits, 1 to 32 of them. Data that LASzip did not write may give a little more than fits in them.
    #[inline(always)]
    pub(super) fn bits(&mut self, bits: u32) -> u32 {
        if bits <= 19 {
            return self.few_bits(bits);
        }
        let low = self.few_bits(16) & 0xffff;
        self.few_bits(bits - 16) << 16 | low
    }

    /// Returns the next 32 raw bits, each half cut to 16 bits.
    pub(super) fn word(&mut self) -> u32 {
        let low = self.few_bits(16) & 0xffff;
        self.few_bits(16) << 16 | low
    }

    #[inline(always)]
    fn few_bits(&mut self, bits: u32) -> u32 {
        self.length >>= bits;
        let number = self.value.checked_div(self.length).unwrap_or(0);
        self.value -= number * self.length;
        let shorter = |than: u32| (self.length < than) as u32;
        self.widen(shorter(1 << 24) + shorter(1 << 16) + shorter(1 << 8));
        number
    }
}

impl<R: Read + Seek> RangeDecoder<R> {
    /// Returns the source behind the last byte that was used.
    pub(super) fn into_source(mut self) -> io::Result<R> {
        let unused = self.filled.saturating_sub(self.at) as i64;
        self.source.seek(SeekFrom::Current(-unused))?;
        Ok(self.source)
    }
}
