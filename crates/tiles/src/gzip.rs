//! Packing bytes as gzip (RFC 1952), by the same coder everywhere.

use crate::huffman::deflated;
use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec_with_limit;

/// How all begin: the number of the format, its only method, and no names or comments.
const MAGIC: [u8; 4] = [0x1f, 0x8b, 8, 0];

/// Bytes before what is deflated: [`MAGIC`], no time, no effort, and a system that is not told.
const HEAD: usize = 10;

/// Returns bytes in the format of gzip, without a time. The coder tries as hard as `level` says: 1 is fast, 6 is usual.
pub fn gzipped(bytes: &[u8], level: u8) -> Vec<u8> {
    wrapped(bytes, &compress_to_vec(bytes, level))
}

/// The same, fast and small for bytes that hardly ever repeat, such as those of meshes.
pub fn gzipped_mesh(bytes: &[u8]) -> Vec<u8> {
    wrapped(bytes, &deflated(bytes))
}

/// Returns bytes in the format of gzip that are deflated already.
fn wrapped(bytes: &[u8], deflated: &[u8]) -> Vec<u8> {
    const UNKNOWN_SYSTEM: u8 = 255;
    let mut packed = Vec::with_capacity(HEAD + deflated.len() + 8);
    packed.extend(MAGIC);
    packed.extend([0, 0, 0, 0, 0, UNKNOWN_SYSTEM]);
    packed.extend(deflated);
    packed.extend(crc32fast::hash(bytes).to_le_bytes());
    // The format has the length modulo 2^32.
    packed.extend((bytes.len() as u32).to_le_bytes());
    packed
}

/// Returns how many bytes a mesh had before it was packed here, by the length and the last four bytes of what it was packed into; `None` if this cannot be.
pub fn unpacked_length(packed: u64, end: [u8; 4]) -> Option<u64> {
    let length = u64::from(u32::from_le_bytes(end));
    // A byte takes a bit at least and two bytes at most, with its share of the codes of a block; the ends add some bytes.
    const BESIDE: u64 = 1024;
    (length / 8 <= packed && packed / 2 <= length + BESIDE).then_some(length)
}

/// Returns what was packed here; `None` if these are not such bytes, or stand for more than `most`.
pub fn gunzipped(packed: &[u8], most: usize) -> Option<Vec<u8>> {
    let (head, rest) = packed.split_first_chunk::<HEAD>()?;
    let (deflated, checks) = rest.split_last_chunk::<8>()?;
    let bytes = decompress_to_vec_with_limit(deflated, most).ok()?;
    let checks = checks.as_chunks::<4>().0;
    let is_whole =
        checks == [crc32fast::hash(&bytes).to_le_bytes(), (bytes.len() as u32).to_le_bytes()] && head[..4] == MAGIC;
    is_whole.then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_no_mesh_can_have_are_none() {
        let length = |packed: u64, unpacked: u32| unpacked_length(packed, unpacked.to_le_bytes());
        assert_eq!([length(1_000, 1 << 20), length(1 << 20, 1_000)], [None; 2]);
        for bytes in [
            vec![],
            vec![7],
            vec![7; 1 << 20],
            (0..1 << 16).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect(),
        ] {
            let packed = gzipped_mesh(&bytes);
            assert_eq!(length(packed.len() as u64, bytes.len() as u32), Some(bytes.len() as u64));
        }
    }

    #[test]
    fn bytes_come_back_or_are_refused() {
        let bytes: Vec<u8> = (0..5000u32).map(|i| ((i * i) >> 5) as u8).collect();
        for packed in [gzipped(&bytes, 6), gzipped_mesh(&bytes)] {
            assert_eq!(gunzipped(&packed, bytes.len()).as_ref(), Some(&bytes));
            assert_eq!(gunzipped(&packed, bytes.len() - 1), None);
            let end = *packed.last_chunk().unwrap();
            assert_eq!(unpacked_length(packed.len() as u64, end), Some(bytes.len() as u64));
            for at in [0, 2, 40, packed.len() - 8, packed.len() - 1] {
                let mut damaged = packed.clone();
                damaged[at] ^= 1;
                assert_ne!(gunzipped(&damaged, usize::MAX).as_ref(), Some(&bytes), "{at}");
            }
            assert!((0..packed.len()).step_by(97).all(|end| gunzipped(&packed[..end], usize::MAX).is_none()));
        }
    }
}
