//! Whole numbers of a given width, one after the other: the first in the lowest bits of the first word. Several lanes of words stand side by
//! side, so that one instruction serves them all (D. Lemire and L. Boytsov, "Decoding billions of integers per second through
//! vectorization", 2015).

use multiversion::multiversion;

/// Values of a lane: their bits fill whole words, whatever their width.
pub(crate) const PIECE: usize = 32;

/// Writes 256 values of `width` bits to `packed`, which has 32 bytes for each bit.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn pack_group(values: &[u32], width: u32, packed: &mut [u8]) {
    pack::<8>(values, width, packed);
}

/// Reads what [`pack_group`] wrote. `width` is not zero.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn unpack_group(packed: &[u8], width: u32, values: &mut [u32]) {
    unpack::<8>(packed, width, values);
}

/// Writes values of `width` bits to `packed`, of which each lane has 32: 4 bytes for each bit.
#[inline(always)]
pub(crate) fn pack<const LANES: usize>(values: &[u32], width: u32, packed: &mut [u8]) {
    let (mut words, mut filled) = ([0; LANES], 0);
    let mut places = packed.chunks_exact_mut(4 * LANES);
    for row in values.as_chunks::<LANES>().0 {
        (0..LANES).for_each(|lane| words[lane] |= row[lane] << filled);
        filled += width;
        if filled >= u32::BITS {
            let Some(place) = places.next() else { return };
            place.as_chunks_mut().0.iter_mut().zip(words).for_each(|(place, word)| *place = word.to_le_bytes());
            filled -= u32::BITS;
            words = if filled == 0 { [0; LANES] } else { row.map(|value| value >> (width - filled)) };
        }
    }
}

/// Reads what [`pack`] wrote. `width` is not zero.
#[inline(always)]
pub(crate) fn unpack<const LANES: usize>(packed: &[u8], width: u32, values: &mut [u32]) {
    let mask = u32::MAX >> (u32::BITS - width);
    let mut packed = packed.chunks_exact(4 * LANES).map(|bytes| {
        let bytes = bytes.as_chunks().0;
        std::array::from_fn(|lane| u32::from_le_bytes(bytes[lane]))
    });
    let (mut words, mut used): ([u32; LANES], u32) = ([0; LANES], u32::BITS);
    for row in values.as_chunks_mut::<LANES>().0 {
        if used == u32::BITS {
            (words, used) = (packed.next().unwrap_or([0; LANES]), 0);
        }
        *row = words.map(|word| word >> used);
        used += width;
        if used > u32::BITS {
            used -= u32::BITS;
            words = packed.next().unwrap_or([0; LANES]);
            (0..LANES).for_each(|lane| row[lane] |= words[lane] << (width - used));
        }
        row.iter_mut().for_each(|value| *value &= mask);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_follow_one_another_in_each_lane() {
        let values: Vec<u32> = (0..256).map(|i| i % 8).collect();
        let mut packed = [0; 3 * 32];
        pack_group(&values, 3, &mut packed);
        // Lane 5 has 32 times the value 5 (101), and lane 0 nothing.
        let word = |at: usize| u32::from_le_bytes(packed[4 * at..4 * at + 4].try_into().unwrap());
        assert_eq!([word(5), word(13), word(21)], [0x6db6_db6d, 0xdb6d_b6db, 0xb6db_6db6]);
        assert_eq!([word(0), word(8), word(16)], [0; 3]);
    }
}
