//! A tile as a PNG picture.
//!
//! The coder is `miniz_oxide` itself and not the crate `png`, whose coder other crates of a build can exchange: the bytes of a file must
//! not depend on that.

use crate::map_tiles::TILE;
use crate::map_tiles::encoding::HeightEncoding;
use crate::map_tiles::filling::fill;
use miniz_oxide::deflate::compress_to_vec_zlib;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Bytes of a pixel.
const CHANNELS: usize = 3;

/// How hard the coder tries.
const LEVEL: u8 = 6;

/// Returns the picture of a tile with these heights in metres, row by row from the north. Pixels without a height (NaN) get one from
/// those that have.
pub fn picture(mut heights: Vec<f64>, encoding: HeightEncoding) -> Vec<u8> {
    fill(&mut heights, TILE);
    let colors: Vec<[u8; CHANNELS]> = heights.iter().map(|height| encoding.color(*height)).collect();
    let mut bytes = SIGNATURE.to_vec();
    let side = (TILE as u32).to_be_bytes();
    // Eight bits for each of three colours, DEFLATE, filters by row, rows in order.
    push_chunk(b"IHDR", &[&side[..], &side, &[8, 2, 0, 0, 0]].concat(), &mut bytes);
    push_chunk(b"IDAT", &compress_to_vec_zlib(&filtered(colors.as_flattened()), LEVEL), &mut bytes);
    push_chunk(b"IEND", &[], &mut bytes);
    bytes
}

fn push_chunk(kind: &[u8; 4], content: &[u8], bytes: &mut Vec<u8>) {
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(kind);
    checksum.update(content);
    bytes.extend((content.len() as u32).to_be_bytes());
    bytes.extend(kind);
    bytes.extend(content);
    bytes.extend(checksum.finalize().to_be_bytes());
}

/// Returns the rows, each with its filter in front.
fn filtered(colors: &[u8]) -> Vec<u8> {
    const LENGTH: usize = TILE * CHANNELS;
    let mut bytes = Vec::with_capacity(colors.len() + TILE);
    let mut above = &[0; LENGTH][..];
    for row in colors.chunks_exact(LENGTH) {
        bytes.push(4);
        for at in 0..LENGTH {
            let left = if at < CHANNELS { 0 } else { row[at - CHANNELS] };
            let corner = if at < CHANNELS { 0 } else { above[at - CHANNELS] };
            bytes.push(row[at].wrapping_sub(paeth(left, above[at], corner)));
        }
        above = row;
    }
    bytes
}

/// Returns that of three bytes which is nearest to `left + above - corner` (PNG, filter 4).
fn paeth(left: u8, above: u8, corner: u8) -> u8 {
    let [a, b, c] = [left, above, corner].map(i16::from);
    let [off_left, off_above, off_corner] = [(b - c).abs(), (a - c).abs(), (a + b - 2 * c).abs()];
    if off_left <= off_above && off_left <= off_corner {
        left
    } else if off_above <= off_corner {
        above
    } else {
        corner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_reader_finds_the_heights() {
        let height = |n: usize| 300.0 + (n % TILE) as f64 * 0.37 + ((n / TILE) as f64 * 0.05).sin() * 9.0;
        let heights = |n: usize| if n % TILE < 30 { f64::NAN } else { height(n) };
        for encoding in [HeightEncoding::Terrarium, HeightEncoding::TerrainRgb] {
            let bytes = picture((0..TILE * TILE).map(heights).collect(), encoding);
            let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
            assert_eq!(reader.info().size(), (TILE as u32, TILE as u32));
            assert_eq!(reader.output_color_type(), (png::ColorType::Rgb, png::BitDepth::Eight));
            let mut colors = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut colors).unwrap();
            for (n, color) in colors.chunks_exact(3).enumerate().filter(|(n, _)| n % TILE >= 30) {
                assert_eq!(color, encoding.color(height(n)), "{n}");
            }
            // Where there is no terrain, it goes on.
            assert!((0..20).all(|n| colors[..3 * TILE][3 * n] == colors[90]));
        }
    }
}
