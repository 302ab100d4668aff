//! Pieces of a picture that are JPEG.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The bytes of the marker at the beginning of a JPEG, and of the one at its end.
const MARKER: usize = 2;

/// Returns the bytes of all pixels of a piece that has these columns, rows and bands, or a sentence that says why it cannot be read. `tables` are
/// what all pieces of the file have in common, or are empty.
pub(crate) fn decode(tables: &[u8], piece: &[u8], size: [usize; 3], is_ycbcr: bool) -> Result<Vec<u8>, String> {
    let [width, height, bands] = size;
    let data = join(tables, piece);
    // Code for single processors is not compiled in, and unsafe code has no other results.
    let options = DecoderOptions::default()
        .set_use_unsafe(false)
        .set_strict_mode(true)
        .set_max_width(width)
        .set_max_height(height);
    let mut headers = JpegDecoder::new_with_options(ZCursor::new(&data), options);
    headers.decode_headers().map_err(|e| e.to_string())?;
    let stored = headers.input_colorspace().ok_or("it has no colour space")?;
    let wanted = if is_ycbcr && bands == 3 { ColorSpace::RGB } else { stored };
    if headers.dimensions() != Some((width, height)) || wanted.num_components() != bands {
        return Err(format!("it is not a picture of {width} x {height} pixels with {bands} bands, as the tags say"));
    }
    JpegDecoder::new_with_options(ZCursor::new(&data), options.jpeg_set_out_colorspace(wanted))
        .decode()
        .map_err(|e| e.to_string())
}

/// Returns a whole JPEG: the tables without their end, then the piece without its beginning.
fn join(tables: &[u8], piece: &[u8]) -> Vec<u8> {
    match tables.len().checked_sub(MARKER) {
        Some(end) if end > 0 => [&tables[..end], piece.get(MARKER..).unwrap_or_default()].concat(),
        _ => piece.to_vec(),
    }
}
