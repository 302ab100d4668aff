//! Packing bytes that hardly ever repeat, such as differences of coordinates: deflate (RFC 1951) with the codes of Huffman (1952) and without references.
//!
//! On meshes that is smaller than what fast coders make with references, and takes a third of the time.

/// Bytes that share a code: a part of a mesh whose numbers are much alike.
const BLOCK: usize = 1 << 14;

/// The longest code of a byte. Four of them fit into what the writer collects.
const LONGEST: u8 = 14;

/// The longest code of a length of codes.
const LONGEST_OF_LENGTHS: u8 = 7;

/// The symbol at the end of a block.
const END: usize = 256;

/// The order in which a block names the lengths of the codes of lengths.
const LENGTH_ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

/// Returns bytes in the format of deflate.
pub(crate) fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut writer = BitWriter { bytes: Vec::with_capacity(bytes.len() * 3 / 4 + 512), bits: 0, count: 0 };
    let mut blocks = bytes.chunks(BLOCK).peekable();
    if bytes.is_empty() {
        add_block(&mut writer, &[], true);
    }
    while let Some(block) = blocks.next() {
        add_block(&mut writer, block, blocks.peek().is_none());
    }
    writer.finish()
}

fn add_block(writer: &mut BitWriter, block: &[u8], is_last: bool) {
    let lengths = lengths(&counts(block), LONGEST);
    const DYNAMIC: u32 = 2;
    writer.add(u32::from(is_last), 1);
    writer.add(DYNAMIC, 2);
    // No symbol beyond the end of a block, and one distance, which is not used.
    writer.add(0, 5);
    writer.add(0, 5);
    add_lengths(writer, &lengths);
    let codes = codes(&lengths);
    let (fours, rest) = block.as_chunks::<4>();
    for four in fours {
        // Joined in pairs, so that a code does not wait for the one before.
        let [a, b, c, d] = four.map(|byte| Bits::of(codes[usize::from(byte)]));
        writer.collect(a.before(b).before(c.before(d)));
        writer.flush();
    }
    rest.iter().map(|&byte| usize::from(byte)).chain([END]).for_each(|symbol| {
        writer.collect(Bits::of(codes[symbol]));
        writer.flush();
    });
}

/// Returns how often each symbol occurs in a block.
fn counts(block: &[u8]) -> [u32; END + 1] {
    // Several lists, so that no byte waits for an equal one shortly before: of small numbers of two bytes, every second byte is zero.
    let mut lists = [[0u32; END + 1]; 8];
    let (eights, rest) = block.as_chunks::<8>();
    for eight in eights {
        lists.iter_mut().zip(eight).for_each(|(list, &byte)| list[usize::from(byte)] += 1);
    }
    rest.iter().for_each(|&byte| lists[0][usize::from(byte)] += 1);
    let mut counts = [0; END + 1];
    for list in lists {
        counts.iter_mut().zip(list).for_each(|(count, more)| *count += more);
    }
    counts[END] = 1;
    counts
}

/// Returns the lengths of the codes of symbols that occur so often, 0 for those that do not.
fn lengths(counts: &[u32], longest: u8) -> Vec<u8> {
    let mut counts = counts.to_vec();
    loop {
        let lengths = lengths_of_any(&counts);
        if lengths.iter().all(|length| *length <= longest) {
            return lengths;
        }
        // The rarer ones come closer to the others.
        counts.iter_mut().filter(|count| **count > 0).for_each(|count| *count = *count / 2 + 1);
    }
}

/// The same, however long they become.
fn lengths_of_any(counts: &[u32]) -> Vec<u8> {
    let mut lengths = vec![0; counts.len()];
    let mut leaves: Vec<(u32, usize)> = counts.iter().copied().zip(0..).filter(|(count, _)| *count > 0).collect();
    leaves.sort_unstable();
    if let [(_, only)] = leaves[..] {
        lengths[only] = 1;
        return lengths;
    }
    // Nodes are the leaves, then pairs of nodes in ascending order of their counts: the least two nodes are always at the front of either.
    let mut weights: Vec<u32> = leaves.iter().map(|(count, _)| *count).collect();
    let mut parents = vec![0; 2 * leaves.len()];
    let (mut leaf, mut pair) = (0, leaves.len());
    while weights.len() + 1 < 2 * leaves.len() {
        let mut weight = 0;
        for _ in 0..2 {
            let takes_leaf = leaf < leaves.len() && (pair >= weights.len() || weights[leaf] <= weights[pair]);
            let least = if takes_leaf { &mut leaf } else { &mut pair };
            weight += weights[*least];
            parents[*least] = weights.len();
            *least += 1;
        }
        weights.push(weight);
    }
    let mut depths = vec![0u8; weights.len()];
    for node in (0..weights.len().saturating_sub(1)).rev() {
        depths[node] = depths[parents[node]].saturating_add(1);
    }
    leaves.iter().zip(depths).for_each(|((_, symbol), depth)| lengths[*symbol] = depth);
    lengths
}

/// A code: its bits, the first one last, and how many they are.
type Code = (u16, u8);

/// Returns the codes of these lengths.
fn codes(lengths: &[u8]) -> Vec<Code> {
    let mut next = [0u16; 16];
    for length in 1..16 {
        let shorter = lengths.iter().filter(|known| usize::from(**known) == length - 1 && **known > 0).count() as u16;
        next[length] = (next[length - 1] + shorter) << 1;
    }
    let code = |&length: &u8| {
        let code = &mut next[usize::from(length)];
        *code += 1;
        if length == 0 { (0, 0) } else { ((*code - 1).reverse_bits() >> (16 - length), length) }
    };
    lengths.iter().map(code).collect()
}

/// Adds the lengths of the codes of all symbols, and that of the only distance: none.
fn add_lengths(writer: &mut BitWriter, lengths: &[u8]) {
    let mut symbols: Vec<(usize, u32)> = Vec::new();
    let all = [lengths, &[0]].concat();
    for run in all.chunk_by(|a, b| a == b) {
        let mut left = run.len();
        while left > 0 {
            let (symbol, extra, taken) = match (run[0], left) {
                (0, 11..) => (18, left.min(138) - 11, left.min(138)),
                (0, 3..) => (17, left - 3, left),
                // It stands for as many more of the one before.
                (_, 3..) if left < run.len() => (16, left.min(6) - 3, left.min(6)),
                (length, _) => (usize::from(length), 0, 1),
            };
            symbols.push((symbol, extra as u32));
            left -= taken;
        }
    }
    let mut counts = [0; 19];
    symbols.iter().for_each(|(symbol, _)| counts[*symbol] += 1);
    let of_lengths = self::lengths(&counts, LONGEST_OF_LENGTHS);
    let named = LENGTH_ORDER.iter().rposition(|&symbol| of_lengths[symbol] > 0).map_or(4, |last| (last + 1).max(4));
    writer.add(named as u32 - 4, 4);
    LENGTH_ORDER[..named].iter().for_each(|&symbol| writer.add(of_lengths[symbol].into(), 3));
    let codes = codes(&of_lengths);
    for (symbol, extra) in symbols {
        writer.collect(Bits::of(codes[symbol]));
        writer.flush();
        let bits = match symbol {
            16 => 2,
            17 => 3,
            18 => 7,
            _ => 0,
        };
        writer.add(extra, bits);
    }
}

/// Some bits, the first one last.
#[derive(Clone, Copy)]
struct Bits {
    bits: u64,
    count: u32,
}

impl Bits {
    #[inline(always)]
    fn of((bits, count): Code) -> Bits {
        Bits { bits: bits.into(), count: count.into() }
    }

    #[inline(always)]
    fn before(self, next: Bits) -> Bits {
        Bits { bits: self.bits | next.bits << self.count, count: self.count + next.count }
    }
}

/// Bits, from the lowest of each byte on.
struct BitWriter {
    bytes: Vec<u8>,
    bits: u64,
    /// The number of bits that wait; fewer than eight after a flush.
    count: u32,
}

impl BitWriter {
    fn add(&mut self, bits: u32, count: u8) {
        self.bits |= u64::from(bits) << self.count;
        self.count += u32::from(count);
        self.flush();
    }

    #[inline(always)]
    fn collect(&mut self, Bits { bits, count }: Bits) {
        self.bits |= bits << self.count;
        self.count += count;
    }

    /// Writes all whole bytes.
    #[inline(always)]
    fn flush(&mut self) {
        let whole = self.count / 8;
        let end = self.bytes.len() + whole as usize;
        // All eight in one go, and then back to those that are complete.
        self.bytes.extend(self.bits.to_le_bytes());
        self.bytes.truncate(end);
        self.bits >>= 8 * whole;
        self.count -= 8 * whole;
    }

    fn finish(mut self) -> Vec<u8> {
        self.add(0, 7);
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Read;

    /// Reads deflate by two decoders.
    fn inflated(packed: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        flate2::read::DeflateDecoder::new(packed).read_to_end(&mut bytes).unwrap();
        assert_eq!(miniz_oxide::inflate::decompress_to_vec(packed).unwrap(), bytes);
        bytes
    }

    proptest! {
        #[test]
        fn bytes_come_back(bytes in prop::collection::vec(0u8..=255, 0..60_000), most in 1u8..=255, skew in 0u32..12) {
            // Few symbols, and some far rarer than others.
            let mut count = 0u32;
            let bytes: Vec<u8> = bytes.into_iter().map(|byte| {
                count += 1;
                (byte % most).min(count.trailing_zeros() as u8 * (skew as u8 + 1))
            }).collect();
            prop_assert_eq!(inflated(&deflated(&bytes)), bytes);
        }

        #[test]
        fn codes_are_no_longer_than_they_may_be(powers in prop::collection::vec(0u32..28, 1..257), longest in 9u8..15) {
            let counts: Vec<u32> = powers.iter().map(|power| (1 << power) >> 6).collect();
            let lengths = lengths(&counts, longest);
            let used = lengths.iter().filter(|length| **length > 0).count();
            prop_assert!(lengths.iter().zip(&counts).all(|(length, count)| *length <= longest && (*length > 0) == (*count > 0)));
            let share: u32 = lengths.iter().filter(|length| **length > 0).map(|length| 1u32 << (16 - length)).sum();
            prop_assert!(used < 2 || share == 1 << 16, "{share}");
        }
    }

    #[test]
    fn any_length_comes_back() {
        for length in [0, 1, 2, 3, 4, 5, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK] {
            for step in [0, 1, 7] {
                let bytes: Vec<u8> = (0..length).map(|i| (i * step % 251) as u8).collect();
                assert_eq!(inflated(&deflated(&bytes)), bytes);
            }
        }
    }

    #[test]
    fn rare_bytes_cost_what_huffman_says() {
        // Half zeros, a quarter ones, an eighth twos, and so on: as many bits as that has.
        let bytes: Vec<u8> = (1u32..=1 << 14).map(|i| i.trailing_zeros() as u8).collect();
        assert!((deflated(&bytes).len() as i64 - (2 << 14) / 8).abs() < 100);
    }
}
