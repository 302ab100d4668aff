//! Packs vertex attributes in the form of mode `ATTRIBUTES` of `EXT_meshopt_compression`, version 0.
//!
//! Vertices are packed in blocks of 256. Every byte of an element becomes a row of its own: its differences from vertex to vertex, those
//! below zero as odd numbers. Groups of sixteen differences take 0, 2, 4 or 8 bits each, whatever is least; differences that 2 or 4 bits
//! do not hold follow their group. Of equal choices the same is made as meshoptimizer makes, so the bytes are the same.

use bytemuck::{NoUninit, bytes_of, cast_slice};
use multiversion::multiversion;

/// The first byte: vertices, in version 0.
const HEADER: u8 = 0xa0;

/// The vertices in a block.
const BLOCK: usize = 256;

/// The differences in a group.
const GROUP: usize = 16;

/// The bytes that say how many bits the groups of a row take.
const ROW_HEADER: usize = BLOCK / GROUP / 4;

/// The most bytes of a packed row.
const MOST_PACKED: usize = ROW_HEADER + BLOCK;

/// The least bytes after the last block, in which the first vertex comes last.
const TAIL: usize = 32;

/// The most bytes in an element.
const LARGEST: usize = 16;

/// Differences of one byte.
type Row = [u8; BLOCK];

/// Appends the packed elements to `packed`: those of `values`, converted, in this `order` if there is one.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn encode_vertices<T: Copy, B: NoUninit>(
    values: &[T],
    order: Option<&[u32]>,
    convert: impl Fn(T) -> B,
    packed: &mut Vec<u8>,
) {
    const { assert!(size_of::<B>() <= LARGEST && size_of::<B>().is_multiple_of(4)) };
    let count = order.map_or(values.len(), <[u32]>::len);
    packed.push(HEADER);
    let mut first = None;
    let mut last = [0; LARGEST];
    let mut piece = Vec::with_capacity(BLOCK);
    let mut elements = Vec::with_capacity(BLOCK);
    let mut encoder = BlockEncoder { differences: [0; BLOCK * LARGEST], row: [0; BLOCK], packed: [0; MOST_PACKED] };
    for start in (0..count).step_by(BLOCK) {
        let end = (start + BLOCK).min(count);
        // In pieces that stay in the cache. Conversion alone, without a look-up, is done for many elements at once.
        piece.clear();
        match order {
            Some(order) => piece.extend(order[start..end].iter().map(|&v| values[v as usize])),
            None => piece.extend_from_slice(&values[start..end]),
        }
        elements.clear();
        elements.extend(piece.iter().map(|&value| convert(value)));
        let first = first.get_or_insert(elements[0]);
        if start == 0 {
            last[..size_of::<B>()].copy_from_slice(bytes_of(first));
        }
        encoder.add(cast_slice(&elements), size_of::<B>(), &mut last, packed);
    }
    let tail = packed.len() + TAIL.max(size_of::<B>());
    packed.resize(tail, 0);
    if let Some(first) = &first {
        packed[tail - size_of::<B>()..].copy_from_slice(bytes_of(first));
    }
}

/// The memory in which blocks are packed.
struct BlockEncoder {
    /// The differences of all bytes, in the order of the elements.
    differences: [u8; BLOCK * LARGEST],
    row: Row,
    packed: [u8; MOST_PACKED],
}

impl BlockEncoder {
    /// Appends a block of elements of this `size`, which comes after the element `last`, and sets `last`.
    #[inline(always)]
    fn add(&mut self, elements: &[u8], size: usize, last: &mut [u8; LARGEST], packed: &mut Vec<u8>) {
        let (first, others) = self.differences[..elements.len()].split_at_mut(size);
        subtract(first, &elements[..size], &last[..size]);
        subtract(others, &elements[size..], elements);
        last[..size].copy_from_slice(&elements[elements.len() - size..]);
        let differences = &self.differences[..elements.len()];
        // The last group of a block may lack some.
        let rows = elements.len() / size;
        let aligned = rows.next_multiple_of(GROUP);
        self.row[rows..aligned].fill(0);
        for byte in 0..size {
            match size {
                4 => pick::<4>(&mut self.row, differences, byte),
                8 => pick::<8>(&mut self.row, differences, byte),
                _ => {
                    self.row.iter_mut().zip(differences[byte..].iter().step_by(size)).for_each(|(to, &from)| *to = from)
                }
            }
            let length = pack_row(&self.row[..aligned], &mut self.packed);
            packed.extend_from_slice(&self.packed[..length]);
        }
    }
}

/// Writes the differences of bytes: 0, 1, 2 for 0, -1, 1.
#[inline(always)]
fn subtract(differences: &mut [u8], bytes: &[u8], before: &[u8]) {
    for ((difference, &byte), &before) in differences.iter_mut().zip(bytes).zip(before) {
        let step = byte.wrapping_sub(before);
        *difference = step << 1 ^ (step as i8 >> 7) as u8;
    }
}

/// Writes one byte of each element.
#[inline(always)]
fn pick<const SIZE: usize>(row: &mut Row, elements: &[u8], byte: usize) {
    let (elements, _) = elements.as_chunks::<SIZE>();
    for (to, element) in row.iter_mut().zip(elements) {
        *to = element[byte];
    }
}

/// Writes a packed row, and returns its length.
#[inline(always)]
fn pack_row(row: &[u8], packed: &mut [u8; MOST_PACKED]) -> usize {
    let (groups, _) = row.as_chunks::<GROUP>();
    let header = groups.len().div_ceil(4);
    packed[..ROW_HEADER].fill(0);
    let mut length = header;
    let mut last = Bits::Eight;
    for (g, group) in groups.iter().enumerate() {
        let halves = [0, 8].map(|at| word(&group[at..at + 8]));
        if halves == [0; 2] {
            last = Bits::None;
            continue;
        }
        last = Bits::least(halves, last);
        packed[g / 4] |= (last as u8) << (g % 4 * 2);
        let room = &mut packed[length..];
        length += match last {
            Bits::Two => pack_group(group, halves, TWO, room),
            Bits::Four => pack_group(group, halves, FOUR, room),
            _ => {
                room[..GROUP].copy_from_slice(group);
                GROUP
            }
        };
    }
    length
}

/// How many bits the differences of a group take, as the header has it.
#[derive(Clone, Copy, PartialEq)]
enum Bits {
    None = 0,
    Two = 1,
    Four = 2,
    Eight = 3,
}

impl Bits {
    /// Returns the bits with which a group takes the least room. Of equal choices the one of the `last` group is made.
    #[inline(always)]
    fn least(halves: [u64; 2], last: Bits) -> Bits {
        let [two, four] = [TWO, FOUR].map(|width| {
            let large: u32 = halves.iter().map(|&half| counted(width.large(half))).sum();
            width.bytes as u32 + large
        });
        if four < two.min(GROUP as u32) || four == two && last == Bits::Four && two < GROUP as u32 {
            Bits::Four
        } else if two < GROUP as u32 {
            Bits::Two
        } else {
            Bits::Eight
        }
    }
}

/// A number of bits.
#[derive(Clone, Copy)]
struct Width {
    bits: u32,
    /// The number that says that the difference follows.
    large: u8,
    /// The bytes of sixteen numbers.
    bytes: usize,
}

const TWO: Width = Width { bits: 2, large: 3, bytes: 4 };
const FOUR: Width = Width { bits: 4, large: 15, bytes: 8 };

/// The number 1 in each byte.
const ONES: u64 = 0x0101_0101_0101_0101;

impl Width {
    /// Returns the highest bit of each of eight bytes that does not fit.
    #[inline(always)]
    fn large(self, bytes: u64) -> u64 {
        const HIGH: u64 = ONES << 7;
        // No sum leaves its byte.
        (((bytes & !HIGH) + (0x80 - u64::from(self.large)) * ONES) | bytes) & HIGH
    }

    /// Returns eight numbers one after the other, the first in the highest bits of the first byte.
    #[inline(always)]
    fn joined(self, bytes: u64, large: u64) -> u64 {
        // All bits of the bytes that do not fit.
        let full = (large >> 7) * 0xff;
        let numbers = (bytes | full) & (u64::from(self.large) * ONES);
        let pairs = (numbers << self.bits | numbers >> 8) & 0x00ff_00ff_00ff_00ff;
        match self.bits {
            2 => {
                let fours = (pairs << 4 | pairs >> 16) & 0x0000_00ff_0000_00ff;
                fours | fours >> 24
            }
            _ => {
                let joined = (pairs | pairs >> 8) & 0x0000_ffff_0000_ffff;
                joined | joined >> 16
            }
        }
    }
}

/// Returns how many bytes have their highest bit set, of bytes that have no other.
#[inline(always)]
fn counted(high: u64) -> u32 {
    ((high >> 7).wrapping_mul(ONES) >> 56) as u32
}

#[inline(always)]
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}

/// Writes a group in numbers of few bits, then what does not fit them. Returns the number of bytes.
#[inline(always)]
fn pack_group(group: &[u8; GROUP], halves: [u64; 2], width: Width, room: &mut [u8]) -> usize {
    let large = halves.map(|half| width.large(half));
    let half = width.bytes / 2;
    for k in 0..2 {
        let joined = width.joined(halves[k], large[k]).to_le_bytes();
        room[k * half..(k + 1) * half].copy_from_slice(&joined[..half]);
    }
    let mut length = width.bytes;
    for (k, mut left) in (0..).zip(large) {
        while left != 0 {
            room[length] = group[8 * k + left.trailing_zeros() as usize / 8];
            length += 1;
            left &= left - 1;
        }
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The bytes are those of meshoptimizer, and it reads the same elements from them.
    fn check<const SIZE: usize>(elements: &[[u8; SIZE]])
    where
        [u8; SIZE]: Default + NoUninit,
    {
        let mut ours = vec![7];
        encode_vertices(elements, None, |element| element, &mut ours);
        assert_eq!(ours.remove(0), 7);
        assert_eq!(ours, meshopt::encode_vertex_buffer_level(elements, 0, Some(0)).unwrap());
        let read: Vec<[u8; SIZE]> = meshopt::decode_vertex_buffer(&ours, elements.len()).unwrap();
        assert_eq!(read, elements);
        let order: Vec<u32> = (0..elements.len() as u32).rev().collect();
        let mut turned = Vec::new();
        encode_vertices(elements, Some(&order), |element| element, &mut turned);
        let read: Vec<[u8; SIZE]> = meshopt::decode_vertex_buffer(&turned, elements.len()).unwrap();
        assert!(read.iter().eq(elements.iter().rev()));
    }

    fn check_all(bytes: &[u8]) {
        check::<4>(bytes.as_chunks().0);
        check::<8>(bytes.as_chunks().0);
        check::<12>(bytes.as_chunks().0);
        check::<16>(bytes.as_chunks().0);
    }

    #[test]
    fn any_number_of_elements_packs() {
        for count in [0, 1, 2, 15, 16, 17, 255, 256, 257, 300, 512, 1000] {
            check_all(&vec![0; 16 * count]);
            check_all(&(0..16 * count as u32).map(|i| ((i * i) >> 3) as u8).collect::<Vec<_>>());
        }
    }

    proptest! {
        #[test]
        fn bytes_are_those_of_meshoptimizer(
            // Differences that take few bits, mixed with larger ones, in groups of sixteen.
            groups in prop::collection::vec((prop::sample::select(vec![1u8, 2, 3, 7, 8, 9, 128]), 0u32..20, any::<u64>()), 0..150),
        ) {
            let mut bytes = vec![0u8; 64 * groups.len()];
            for (i, (most, rare, seed)) in groups.into_iter().enumerate() {
                let mut state = seed;
                for at in 64 * i..64 * (i + 1) {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    let draw = (state >> 33) as u32;
                    let step = if draw % 20 < rare { (draw >> 8) as u8 } else { (draw >> 8) as u8 % most };
                    bytes[at] = if at < 4 { step } else { bytes[at - 4].wrapping_add(step) };
                }
            }
            check_all(&bytes);
        }
    }
}
