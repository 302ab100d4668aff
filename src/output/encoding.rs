//! How vertices and triangles become bytes: the choices, and the rounding of normals and colours.

use serde::{Deserialize, Serialize};

/// How a tile is packed. Positions are exact in all of them: rounding finds the lattice integers again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Quantized, then packed by the codecs of `EXT_meshopt_compression`.
    Meshopt,
    /// Positions in 16 bits, normals and colours in 8 (`KHR_mesh_quantization`).
    Quantized,
    #[default]
    /// Plain glTF: positions and normals in single precision, colours in 16 bits.
    None,
}

/// The normal x, y up, z of a mesh in signed bytes, 127 for 1, whose node stretches it by 1, `anisotropy`, 1: readers divide
/// normals by that. The fourth byte is padding.
#[inline(always)]
pub(super) fn normal_bytes([x, y, z]: [f32; 3], anisotropy: f32) -> [i8; 4] {
    let y = y * anisotropy;
    let scale = 127.0 / (x * x + y * y + z * z).sqrt();
    let byte = |v: f32| (v * scale).round() as i8;
    [byte(x), byte(y), byte(z), 0]
}

/// A linear colour in bytes, opaque.
pub(super) fn color_bytes([r, g, b]: [u16; 3]) -> [u8; 4] {
    let byte = |v: u16| ((v as u32 * 255 + 32767) / 65535) as u8;
    [byte(r), byte(g), byte(b), u8::MAX]
}
