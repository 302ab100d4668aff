//! Adaptive models: how probable symbols are, by how often each came so far.

/// The number of bits of a place in the scale on which symbols have their shares.
const PLACE_BITS: u32 = 15;

/// The shares of symbols. `SYMBOLS` is a power of two, at least the number of symbols. `TABLE` is twice the number of equal parts of the
/// scale for which a table has the first symbol; the second half stays zero, and only makes places past the scale harmless.
#[derive(Clone)]
pub(super) struct SymbolModel<const SYMBOLS: usize, const TABLE: usize> {
    /// The number of symbols until shares are computed anew, and how many that was the last time.
    until_update: u32,
    cycle: u32,
    symbols: u32,
    total: u32,
    /// Where the share of each symbol begins (low half) and ends (high half). The last one ends beyond all places.
    ends: [u32; SYMBOLS],
    counts: [u16; SYMBOLS],
    table: [u16; TABLE],
}

/// A model of at most 256 symbols.
pub(super) type ByteModel = SymbolModel<256, 1024>;
/// A model of 256 symbols in 2 kB: a record may have thousands of extra bytes.
pub(super) type ExtraByteModel = SymbolModel<256, 256>;
/// A model of the number of bits of an integer, 33 symbols at most.
pub(super) type LengthModel = SymbolModel<64, 512>;
/// A model of at most 16 symbols.
pub(super) type SmallModel = SymbolModel<16, 64>;
/// A model of the 516 ways in which a GPS time goes on.
pub(super) type TimeModel = SymbolModel<1024, 2048>;

/// The number of cells that are filled at once. Most symbols have fewer, and the next symbol overwrites what is too much.
const FILL: usize = 8;

impl<const SYMBOLS: usize, const TABLE: usize> SymbolModel<SYMBOLS, TABLE> {
    /// The number of bits of a place within a cell of the table.
    const CELL_BITS: u32 = PLACE_BITS + 1 - TABLE.trailing_zeros();

    /// Returns a model in which `symbols` symbols are equally probable, at least 2 and at most `SYMBOLS`.
    pub(super) fn new(symbols: u32) -> SymbolModel<SYMBOLS, TABLE> {
        let mut model = SymbolModel {
            until_update: 0,
            cycle: symbols,
            symbols,
            total: 0,
            ends: [0xffff_0000; SYMBOLS],
            counts: [1; SYMBOLS],
            table: [0; TABLE],
        };
        model.update();
        model.cycle = (symbols + 6) / 2;
        model.until_update = model.cycle;
        model
    }

    /// Returns the symbol at `place`, and where its share begins and ends.
    #[inline(always)]
    pub(super) fn find(&self, place: u32) -> (usize, u32, u32) {
        let mut symbol = self.table[(place >> Self::CELL_BITS) as usize & (TABLE - 1)] as usize & (SYMBOLS - 1);
        let mut ends = self.ends[symbol];
        // This usually ends at once. It does end, because the last share does beyond all places, which are less than 2^16.
        while place >= ends >> 16 {
            symbol = (symbol + 1) & (SYMBOLS - 1);
            ends = self.ends[symbol];
        }
        (symbol, ends & 0xffff, ends >> 16)
    }

    #[inline(always)]
    pub(super) fn count(&mut self, symbol: usize) {
        self.counts[symbol & (SYMBOLS - 1)] += 1;
        self.until_update -= 1;
        if self.until_update == 0 {
            self.update();
        }
    }

    /// Computes the shares from the counts.
    #[cold]
    #[inline(never)]
    fn update(&mut self) {
        let symbols = (self.symbols as usize).min(SYMBOLS);
        let counts = &mut self.counts[..symbols];
        self.total += self.cycle;
        if self.total > 1 << PLACE_BITS {
            counts.iter_mut().for_each(|count| *count = count.div_ceil(2));
            self.total = counts.iter().map(|&count| count as u32).sum();
        }
        let scale = (1 << 31) / self.total;
        let (mut sum, mut begin) = (0, 0);
        for (ends, &count) in self.ends.iter_mut().zip(counts.iter()) {
            sum += count as u32;
            let end = (scale * sum) >> (31 - PLACE_BITS);
            *ends = begin | end << 16;
            begin = end;
        }
        self.ends[symbols - 1] |= 0xffff_0000;
        self.fill_table(symbols);
        self.cycle = (5 * self.cycle / 4).min((self.symbols + 6) * 8);
        self.until_update = self.cycle;
    }

    /// Gives each cell the symbol of its first place.
    fn fill_table(&mut self, symbols: usize) {
        let mut from = 0;
        for (symbol, ends) in self.ends[..symbols].iter().enumerate() {
            let to = ((ends >> 16).div_ceil(1 << Self::CELL_BITS) as usize).min(TABLE / 2 + 1);
            self.table[from..from + FILL].fill(symbol as u16);
            if to > from + FILL {
                self.table[from + FILL..to].fill(symbol as u16);
            }
            from = to;
        }
    }
}

/// The shares of 0 and 1.
pub(super) struct BitModel {
    /// The share of 0 in 2^[`BitModel::SHARE_BITS`]; neither 0 nor all of it.
    pub(super) share_of_zeros: u32,
    zeros: u32,
    total: u32,
    cycle: u32,
    until_update: u32,
}

impl BitModel {
    /// The number of bits of a share.
    pub(super) const SHARE_BITS: u32 = 13;

    pub(super) fn new() -> BitModel {
        BitModel { share_of_zeros: 1 << (BitModel::SHARE_BITS - 1), zeros: 1, total: 2, cycle: 4, until_update: 4 }
    }

    #[inline(always)]
    pub(super) fn count(&mut self, bit: bool) {
        self.zeros += !bit as u32;
        self.until_update -= 1;
        if self.until_update == 0 {
            self.update();
        }
    }

    #[cold]
    fn update(&mut self) {
        self.total += self.cycle;
        if self.total > 1 << BitModel::SHARE_BITS {
            self.total = self.total.div_ceil(2);
            self.zeros = self.zeros.div_ceil(2);
            self.total += (self.zeros == self.total) as u32;
        }
        self.share_of_zeros = (self.zeros * ((1 << 31) / self.total)) >> (31 - BitModel::SHARE_BITS);
        self.cycle = (5 * self.cycle / 4).min(64);
        self.until_update = self.cycle;
    }
}

/// A model that is made when it is first used. Most of those of a chunk never are.
#[derive(Clone, Default)]
pub(super) struct LazyModel(Option<Box<ByteModel>>);

impl LazyModel {
    pub(super) const fn new() -> LazyModel {
        LazyModel(None)
    }

    /// Returns the model, which always has this number of symbols.
    #[inline(always)]
    pub(super) fn of(&mut self, symbols: u32) -> &mut ByteModel {
        match &mut self.0 {
            Some(model) => model,
            none => LazyModel::make(none, symbols),
        }
    }

    #[cold]
    #[inline(never)]
    fn make(none: &mut Option<Box<ByteModel>>, symbols: u32) -> &mut ByteModel {
        none.insert(Box::new(ByteModel::new(symbols)))
    }
}
