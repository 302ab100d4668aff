//! One tile as a binary glTF 2.0 file.

use crate::Result;
use crate::output::Tile;
use crate::output::frame::Frame;
use crate::output::gltf::container::write_head;
use crate::output::gltf::document::DocumentBuilder;
use crate::output::gltf::encoding::Compression;
use crate::output::gltf::parts::{split, split_short};

/// The bytes of a GLB file. Its memory can be used again for the next tile.
#[derive(Debug, Default)]
pub struct Glb {
    head: Vec<u8>,
    binary: Vec<u8>,
}

impl Glb {
    /// Makes it that of `tile`. The same tile gives the same bytes. Unless `compression` is none, `frame` should be [`Frame::packed`].
    ///
    /// # Errors
    /// [`crate::Error::Config`] where a triangle is too long to be exact in f32 ([`Frame::longest_triangle`]) or the file would pass 4 GiB.
    pub fn encode(&mut self, frame: &Frame, tile: &Tile, compression: Compression) -> Result<()> {
        let parts = match compression {
            Compression::None => split(frame, tile)?,
            _ => split_short(frame, tile)?,
        };
        let mut document = DocumentBuilder::new(frame, compression, std::mem::take(&mut self.binary));
        for part in &parts {
            document.add_part(part)?;
        }
        self.head.clear();
        let (json, binary) = document.finish()?;
        write_head(json, binary.len() as u64, &mut self.head)?;
        self.binary = binary;
        Ok(())
    }

    /// The file's bytes, one piece after the other: joining them would be one copy more.
    pub fn pieces(&self) -> [&[u8]; 2] {
        [&self.head, &self.binary]
    }
}
