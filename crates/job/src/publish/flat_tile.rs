//! Tiles for `terrain.glb` where the tiles themselves follow the curve of the earth: viewers of one file know no globe.

use std::path::Path;
use sys::{Error, Result};
use tiles::Compression;
use tiles::frame::Frame;
use tiles::gltf::glb::GlbEncoder;
use tiles::gltf::read::read_tile;
use tiles::lod::join::Joining;

/// The way from the scene of the tiles to one that is the plane of the source.
pub(crate) struct FlatScene<'a> {
    /// The frame of the tiles.
    pub bent: &'a Frame,
    /// The frame of the flat scene.
    pub flat: Frame,
    /// How the tiles are packed.
    pub compression: Compression,
}

impl FlatScene<'_> {
    /// Returns the tile at `path` as a GLB file of the flat scene. It is not packed with meshopt.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] if the tile cannot be read or is damaged, [`Error::Config`] if a triangle is too long for f32.
    pub(crate) fn tile(&self, path: &Path) -> Result<Vec<u8>> {
        let file = read_tile(path)?;
        let mut joining = Joining::new(self.bent, file.parts.iter().map(|part| part.positions.len()).sum());
        joining.add(file).map_err(|what| Error::input(path, what.to_string()))?;
        let tile = joining.finish().into_tile();
        let compression = match self.compression {
            Compression::Meshopt => Compression::Quantized,
            plain => plain,
        };
        let mut glb = GlbEncoder::default();
        glb.encode(&self.flat, &tile, compression, None)?;
        Ok(glb.pieces().concat())
    }
}
