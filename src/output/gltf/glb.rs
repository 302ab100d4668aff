//! One tile as a binary glTF 2.0 file.

use crate::output::Tile;
use crate::output::frame::Frame;
use crate::output::gltf::document::Document;
use crate::output::gltf::encoding::Compression;
use crate::output::gltf::parts::{split, split_short};
use crate::{Error, Result};

pub(crate) const MAGIC: u32 = u32::from_le_bytes(*b"glTF");
pub(crate) const VERSION: u32 = 2;
pub(crate) const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
pub(crate) const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

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
    /// [`Error::Config`] where a triangle is too long to be exact in f32 ([`Frame::longest_triangle`]) or the file would pass 4 GiB.
    pub fn encode(&mut self, frame: &Frame, tile: &Tile, compression: Compression) -> Result<()> {
        let parts = match compression {
            Compression::None => split(frame, tile)?,
            _ => split_short(frame, tile)?,
        };
        let mut document = Document::new(frame, compression, std::mem::take(&mut self.binary));
        for part in &parts {
            document.add_part(part)?;
        }
        self.head.clear();
        write_container(document.json().to_string().into_bytes(), document.binary.len() as u64, &mut self.head)?;
        self.binary = document.binary;
        Ok(())
    }

    /// The file's bytes, one piece after the other: joining them would be one copy more.
    pub fn pieces(&self) -> [&[u8]; 2] {
        [&self.head, &self.binary]
    }
}

/// Header, JSON chunk and the head of the binary chunk, whose `length` bytes are to follow.
pub(crate) fn write_container(mut json: Vec<u8>, length: u64, out: &mut Vec<u8>) -> Result<()> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = if length == 0 { 0 } else { 8 + length };
    let total = 20 + json.len() as u64 + binary;
    let total = u32::try_from(total).map_err(|_| {
        Error::Config(format!(
            "a GLB file of {total} bytes would pass the limit of 4 GiB: set a smaller max_points_per_tile"
        ))
    })?;
    for word in [MAGIC, VERSION, total, json.len() as u32, JSON_CHUNK] {
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.extend_from_slice(&json);
    if length > 0 {
        out.extend_from_slice(&(length as u32).to_le_bytes());
        out.extend_from_slice(&BIN_CHUNK.to_le_bytes());
    }
    Ok(())
}
