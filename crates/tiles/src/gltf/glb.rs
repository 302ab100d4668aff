//! Encodes one tile as a binary glTF 2.0 file.

use crate::compression::Compression;
use crate::frame::Frame;
use crate::gltf::container::write_head;
use crate::gltf::document::{DocumentBuilder, TriangleSorters};
use crate::gltf::split_nodes::{split, split_short};
use crate::tile::Tile;
use sys::Result;

/// Encodes GLB files one after the other, in the same memory.
#[derive(Debug, Default)]
pub struct GlbEncoder {
    head: Vec<u8>,
    binary: Vec<u8>,
    /// Memory for the places of vertices in scenes that are bent.
    steps: Vec<[f64; 3]>,
    sorters: TriangleSorters,
}

impl GlbEncoder {
    /// Encodes the file of `tile`, a planar mesh, whose rights `copyright` tells. The same tile gives the same bytes. Unless `compression` is
    /// none, `frame` should be [`Frame::packed`].
    ///
    /// # Errors
    /// [`sys::Error::Config`] if a triangle is too long to be exact in f32 ([`Frame::longest_triangle`]) or the file would pass 4 GiB.
    pub fn encode(
        &mut self,
        frame: &Frame,
        tile: &Tile,
        compression: Compression,
        copyright: Option<&str>,
    ) -> Result<()> {
        let steps = std::mem::take(&mut self.steps);
        let parts = match compression {
            Compression::None => split(frame, tile, steps)?,
            _ => split_short(frame, tile, steps)?,
        };
        let mut document = DocumentBuilder::new(frame, compression, std::mem::take(&mut self.binary));
        for part in &parts {
            document.add_part(part, &mut self.sorters)?;
        }
        self.head.clear();
        let (json, binary) = document.finish(copyright)?;
        write_head(json, binary.len() as u64, &mut self.head)?;
        self.binary = binary;
        self.steps = parts.into_iter().find_map(|part| part.bent).unwrap_or_default();
        Ok(())
    }

    /// Returns the file's bytes in two pieces, one after the other: joining them would be one more copy.
    pub fn pieces(&self) -> [&[u8]; 2] {
        [&self.head, &self.binary]
    }
}
