//! Packing bytes as gzip (RFC 1952), by the same coder everywhere.

use crate::huffman::deflated;
use miniz_oxide::deflate::compress_to_vec;

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
    let mut packed = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, UNKNOWN_SYSTEM];
    packed.extend(deflated);
    packed.extend(crc32fast::hash(bytes).to_le_bytes());
    // The format has the length modulo 2^32.
    packed.extend((bytes.len() as u32).to_le_bytes());
    packed
}
