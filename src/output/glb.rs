//! One tile as a binary glTF 2.0 file.

use super::Tile;
use super::document::Document;
use super::encoding::Compression;
use super::frame::Frame;
use super::parts::{split, split_short};
use crate::{Error, Result};

pub(super) const MAGIC: u32 = u32::from_le_bytes(*b"glTF");
pub(super) const VERSION: u32 = 2;
pub(super) const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
pub(super) const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// The bytes of the GLB file of `tile`, into `out`, which is cleared first and can be used again for the next tile.
/// The same tile gives the same bytes. Unless `compression` is none, `frame` should be [`Frame::packed`].
///
/// Fails where a triangle is too long to be exact in f32 ([`Frame::longest_triangle`]) or the file would pass 4 GiB.
pub fn encode_tile(frame: &Frame, tile: &Tile, compression: Compression, out: &mut Vec<u8>) -> Result<()> {
    let parts = match compression {
        Compression::None => split(frame, tile)?,
        _ => split_short(frame, tile)?,
    };
    let mut document = Document::new(frame, compression);
    for part in &parts {
        document.add_part(part)?;
    }
    out.clear();
    write_container(document.json().to_string().into_bytes(), document.binary.len() as u64, out)?;
    out.extend_from_slice(&document.binary);
    Ok(())
}

/// Header, JSON chunk and the head of the binary chunk, whose `length` bytes are to follow.
pub(super) fn write_container(mut json: Vec<u8>, length: u64, out: &mut Vec<u8>) -> Result<()> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = if length == 0 { 0 } else { 8 + length };
    let total = 20 + json.len() as u64 + binary;
    let total = u32::try_from(total).map_err(|_| {
        Error::Config(format!(
            "a GLB file of {total} bytes would pass the limit of 4 GiB: set a smaller sites_per_tile"
        ))
    })?;
    out.reserve(total as usize);
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
