//! Packing a block, and unpacking one of heights: the predictor for floating-point numbers (Adobe, "TIFF Technical Note 3") or for bytes, then DEFLATE.
//!
//! The coder is `miniz_oxide` itself, not `flate2`, whose coder other crates of a build can exchange: the bytes of a file must not depend
//! on that.

use crate::raster::BLOCK;
use crate::raster::options::RasterCompression;
use crate::raster::products::RasterProduct;
use miniz_oxide::deflate::core::{
    CompressionStrategy, CompressorOxide, TDEFLFlush, compress_to_output, create_comp_flags_from_zip_params,
};
use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;

/// With the strategy below it only says that a run may begin a byte later if it is longer then.
const LEVEL: i32 = 6;

/// A header and a checksum around the data, as TIFF wants it.
const WITH_HEADER: i32 = 15;

/// Returns the bytes of a block of [`BLOCK`] rows and columns in a file of `product`. Cells of bytes are rounded to whole numbers.
pub fn packed(cells: &[f32], product: RasterProduct, compression: RasterCompression) -> Vec<u8> {
    match (compression, product.is_bytes()) {
        (RasterCompression::Deflate, false) => deflated(&predicted(cells)),
        (RasterCompression::None, false) => cells.iter().flat_map(|cell| cell.to_le_bytes()).collect(),
        (RasterCompression::Deflate, true) => deflated(&differences(bytes(cells))),
        (RasterCompression::None, true) => bytes(cells),
    }
}

/// Returns the heights of a packed block; `None` if the bytes are no such block.
pub(crate) fn unpacked(bytes: &[u8], compression: RasterCompression) -> Option<Vec<f32>> {
    const BYTES: usize = BLOCK * BLOCK * size_of::<f32>();
    match compression {
        RasterCompression::Deflate => {
            let bytes = decompress_to_vec_zlib_with_limit(bytes, BYTES).ok()?;
            (bytes.len() == BYTES).then(|| restored(bytes))
        }
        RasterCompression::None => {
            let (numbers, rest) = bytes.as_chunks::<4>();
            let is_whole = numbers.len() == BLOCK * BLOCK && rest.is_empty();
            is_whole.then(|| numbers.iter().map(|number| f32::from_le_bytes(*number)).collect())
        }
    }
}

/// Undoes [`predicted`].
fn restored(mut bytes: Vec<u8>) -> Vec<f32> {
    let mut cells = Vec::with_capacity(BLOCK * BLOCK);
    for row in bytes.chunks_exact_mut(4 * BLOCK) {
        let mut last = 0u8;
        for byte in row.iter_mut() {
            last = last.wrapping_add(*byte);
            *byte = last;
        }
        let number = |n: usize| f32::from_be_bytes([0, 1, 2, 3].map(|place| row[place * BLOCK + n]));
        cells.extend((0..BLOCK).map(number));
    }
    cells
}

fn bytes(cells: &[f32]) -> Vec<u8> {
    // The conversion keeps within 0 and 255.
    cells.iter().map(|cell| (cell + 0.5) as u8).collect()
}

/// Returns each byte of every row as the difference to the one before.
fn differences(mut cells: Vec<u8>) -> Vec<u8> {
    for row in cells.chunks_exact_mut(BLOCK) {
        for at in (1..row.len()).rev() {
            row[at] = row[at].wrapping_sub(row[at - 1]);
        }
    }
    cells
}

/// Returns the bytes, packed. The coder looks for runs of one byte and for nothing else that repeats: the last bits of heights are as good
/// as random. That takes half the time of its fourth level and gives as many bytes, within a hundredth.
fn deflated(bytes: &[u8]) -> Vec<u8> {
    let flags = create_comp_flags_from_zip_params(LEVEL, WITH_HEADER, CompressionStrategy::RLE as i32);
    let (mut coder, mut packed) = (CompressorOxide::new(flags), Vec::with_capacity(bytes.len()));
    // It fails only if its output is refused.
    compress_to_output(&mut coder, bytes, TDEFLFlush::Finish, |output| {
        packed.extend_from_slice(output);
        true
    });
    packed
}

/// Returns the bytes of every row by their place in their number, the first those with the sign, and each byte as the difference to the one
/// before.
fn predicted(cells: &[f32]) -> Vec<u8> {
    let mut bytes = vec![0; size_of_val(cells)];
    for (row, bytes) in cells.chunks_exact(BLOCK).zip(bytes.chunks_exact_mut(4 * BLOCK)) {
        let mut planes = bytes.chunks_exact_mut(BLOCK);
        for place in 0..4 {
            let Some(plane) = planes.next() else { continue };
            plane.iter_mut().zip(row).for_each(|(byte, cell)| *byte = cell.to_be_bytes()[place]);
        }
        for at in (1..bytes.len()).rev() {
            bytes[at] = bytes[at].wrapping_sub(bytes[at - 1]);
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use miniz_oxide::inflate::decompress_to_vec_zlib;

    #[test]
    fn a_packed_block_comes_back() {
        let cells: Vec<f32> = (0..BLOCK * BLOCK).map(|n| (n % 777) as f32 * 0.37 - 9.0).collect();
        let bytes = packed(&cells, RasterProduct::Height, RasterCompression::Deflate);
        assert!(bytes.len() < 2 * cells.len());
        let mut bytes = decompress_to_vec_zlib(&bytes).unwrap();
        let mut restored = Vec::new();
        for row in bytes.chunks_exact_mut(4 * BLOCK) {
            (1..row.len()).for_each(|at| row[at] = row[at].wrapping_add(row[at - 1]));
            let cell = |n: usize| f32::from_be_bytes([0, 1, 2, 3].map(|place| row[place * BLOCK + n]));
            restored.extend((0..BLOCK).map(cell));
        }
        assert_eq!(restored, cells);
        let shades: Vec<f32> = cells.iter().map(|cell| (cell.abs() % 255.0).floor()).collect();
        let plain = packed(&shades, RasterProduct::Hillshade, RasterCompression::None);
        assert!(plain.iter().zip(&shades).all(|(byte, shade)| f32::from(*byte) == *shade));
        let mut bytes =
            decompress_to_vec_zlib(&packed(&shades, RasterProduct::Hillshade, RasterCompression::Deflate)).unwrap();
        for row in bytes.chunks_exact_mut(BLOCK) {
            (1..row.len()).for_each(|at| row[at] = row[at].wrapping_add(row[at - 1]));
        }
        assert_eq!(bytes, plain);
        assert_eq!(packed(&cells, RasterProduct::Height, RasterCompression::None)[4..8], cells[1].to_le_bytes());
    }
}
