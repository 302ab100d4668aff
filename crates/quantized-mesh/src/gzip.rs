//! Packing a file with gzip (RFC 1952), with the same bytes from every build.

use miniz_oxide::deflate::compress_to_vec;

/// The effort of the coder.
const LEVEL: u8 = 1;

/// The header: DEFLATE, no name, no time, an unknown system.
const HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];

/// Returns the bytes as a file of gzip.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut file = HEADER.to_vec();
    file.extend(compress_to_vec(bytes, LEVEL));
    file.extend(crc32fast::hash(bytes).to_le_bytes());
    // The format has the size modulo 2^32.
    file.extend((bytes.len() as u32).to_le_bytes());
    file
}
