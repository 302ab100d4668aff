//! A pixel of the preview.

use bytemuck::{Pod, Zeroable};

/// One pixel of a tile, in plain bytes so that a tile's pixels can be kept on disk.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct PreviewPixel {
    /// The number of the pixel, row by row from the north-west corner.
    pub pixel: u32,
    /// The east and north components of the unit normal, 32767 for 1.
    pub slope: [i16; 2],
    /// The sRGB colour.
    pub color: [u8; 3],
    /// 1 for the look of a vertex, in a pixel whose centre no triangle may cover.
    pub(super) dot: u8,
}
