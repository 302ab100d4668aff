//! What the bands of a picture mean.

use crate::errors::{PhotoError, if_there};
use crate::image::Image;
use tiff::tags::Tag;

const COMPRESSION_NONE: u16 = 1;
const COMPRESSION_JPEG: u16 = 7;
/// None, LZW, JPEG, DEFLATE by both of its numbers, and PackBits.
const COMPRESSIONS: [u16; 6] = [COMPRESSION_NONE, 5, COMPRESSION_JPEG, 8, 32946, 32773];
const BLACK_IS_ZERO: u16 = 1;
const RGB: u16 = 2;
const PALETTE: u16 = 3;
const YCBCR: u16 = 6;
/// In pieces of one band each.
const PLANAR: u16 = 2;
/// Kinds of extra bands: alpha with colours that are multiplied by it, and without.
const ALPHA: [u16; 2] = [1, 2];

/// The bands of a picture, eight bits each, side by side in each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bands {
    /// How many there are.
    pub(crate) count: usize,
    /// The band that says where there is a picture.
    alpha: Option<usize>,
    /// Whether the first three are red, green and blue; else the first one is grey.
    is_colored: bool,
    /// The value of all bands where there is no picture.
    nodata: Option<u8>,
    /// Whether pieces are JPEG.
    pub(crate) is_jpeg: bool,
    /// Whether the colours in JPEG pieces are to be made from luminance and chrominance.
    pub(crate) is_ycbcr: bool,
}

impl Bands {
    /// Returns the bands of an image, or what is wrong with it.
    pub(crate) fn of(image: &mut Image) -> Result<Bands, PhotoError> {
        let mut number = |tag, default| match image.find_tag(tag)? {
            Some(value) => value.into_u16().map_err(PhotoError::from),
            None => Ok(default),
        };
        let (count, photometric) =
            (number(Tag::SamplesPerPixel, 1)?, number(Tag::PhotometricInterpretation, BLACK_IS_ZERO)?);
        let (planar, compression) = (number(Tag::PlanarConfiguration, 1)?, number(Tag::Compression, COMPRESSION_NONE)?);
        let mut numbers = |tag| if_there(image.get_tag_u16_vec(tag));
        let (bits, formats, extra) =
            (numbers(Tag::BitsPerSample)?, numbers(Tag::SampleFormat)?, numbers(Tag::ExtraSamples)?);
        if bits.iter().any(|bits| *bits != 8) || bits.is_empty() || formats.iter().any(|format| *format != 1) {
            return Err(
                "its bands are not unsigned 8-bit: convert them, for example with `gdal_translate -ot Byte -scale`"
                    .into(),
            );
        }
        if photometric == PALETTE {
            return Err("it has a palette: convert it to RGB, for example with `gdal_translate -expand rgb`".into());
        }
        if !COMPRESSIONS.contains(&compression) {
            return Err(format!(
                "its compression is not supported ({compression}): use another one, for example with `gdal_translate -co \
                 COMPRESS=DEFLATE`"
            )
            .into());
        }
        let is_jpeg = compression == COMPRESSION_JPEG;
        let is_ycbcr = photometric == YCBCR;
        let is_known = [BLACK_IS_ZERO, RGB].contains(&photometric) || (is_ycbcr && is_jpeg);
        if !is_known {
            return Err(format!("its colour type is not supported ({photometric}), only grey, RGB and RGBA").into());
        }
        if planar == PLANAR && count > 1 {
            return Err(
                "its bands are stored in separate planes: interleave them, for example with `gdal_translate -co \
                        INTERLEAVE=PIXEL`"
                    .into(),
            );
        }
        let count = usize::from(count);
        let first_extra = count.saturating_sub(extra.len());
        let alpha = extra.iter().position(|kind| ALPHA.contains(kind)).map(|at| first_extra + at);
        let is_colored = first_extra >= 3 || (alpha.is_none() && count >= 3);
        let nodata = if_there(image.get_tag_ascii_string(Tag::GdalNodata))?;
        let nodata = nodata.trim_matches(['\0', ' ']).parse().ok();
        Ok(Bands { count, alpha, is_colored, nodata, is_jpeg, is_ycbcr })
    }

    /// Returns the colour of a pixel with these values; `None` where there is no picture.
    pub(crate) fn color(&self, pixel: &[u8]) -> Option<[u8; 3]> {
        let [first, ..] = *pixel else { return None };
        let color = match pixel {
            [red, green, blue, ..] if self.is_colored => [*red, *green, *blue],
            _ => [first; 3],
        };
        let is_clear = self.alpha.is_some_and(|alpha| pixel.get(alpha) == Some(&0));
        let is_nodata = self.nodata.is_some_and(|nodata| color == [nodata; 3]);
        (!is_clear && !is_nodata).then_some(color)
    }
}
