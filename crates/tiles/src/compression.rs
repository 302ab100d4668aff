//! How tiles are packed.

use serde::{Deserialize, Serialize};

/// How a tile is packed. Positions are exact in all cases: rounding finds the lattice integers again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Quantized, then packed by the codecs of `EXT_meshopt_compression`.
    Meshopt,
    /// Positions in 16 bits if the tile is narrow enough, else in single precision; normals and colours in 8 bits
    /// (`KHR_mesh_quantization`).
    Quantized,
    /// Plain glTF: positions and normals in single precision, colours in 16 bits.
    None,
}

/// How the user wants tiles to be packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CompressionChoice {
    /// [`Compression::Meshopt`] if only 3D Tiles are written, whose viewers know it; else [`Compression::Quantized`].
    #[default]
    Auto,
    /// [`Compression::Meshopt`].
    Meshopt,
    /// [`Compression::Quantized`].
    Quantized,
    /// [`Compression::None`].
    None,
}
