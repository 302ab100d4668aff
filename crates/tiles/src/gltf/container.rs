//! The outer form of a GLB file: a header and two chunks, one of JSON and one of binary data.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

use serde::Deserialize;

use crate::compression::Compression;
use sys::{Error, Result, fault};

const MAGIC: u32 = u32::from_le_bytes(*b"glTF");
const VERSION: u32 = 2;
const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BIN_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// What a GLB file is read from: a file, or memory.
trait Bytes: Read + Seek + Send {}

impl<T: Read + Seek + Send> Bytes for T {}

/// An open GLB file: its JSON chunk, and where its binary chunk is.
pub(crate) struct GlbFile {
    file: Box<dyn Bytes>,
    json: Vec<u8>,
    binary_start: u64,
    /// Bytes in the binary chunk.
    pub(crate) binary_length: u64,
}

impl GlbFile {
    /// Reads everything except the binary chunk, and checks the lengths against the file's size.
    pub(crate) fn open(path: &Path) -> Result<GlbFile> {
        // This comes before opening, which would wait for a writer if the file is a pipe.
        if !path.metadata().map_err(Error::io("open", path))?.is_file() {
            return Err(Error::input(path, "is not a regular file"));
        }
        let file = fault::read("read-result").and_then(|()| File::open(path)).map_err(Error::io("open", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        GlbFile::of(path, Box::new(file), size)
    }

    /// Takes `bytes` as the file that is called `path`.
    pub(crate) fn in_memory(path: &Path, bytes: Vec<u8>) -> Result<GlbFile> {
        let size = bytes.len() as u64;
        GlbFile::of(path, Box::new(Cursor::new(bytes)), size)
    }

    fn of(path: &Path, mut file: Box<dyn Bytes>, size: u64) -> Result<GlbFile> {
        let damaged = |what: &str| Error::input(path, format!("not a whole GLB file: {what}"));
        if size < 20 {
            return Err(damaged("shorter than its header"));
        }
        let [magic, version, total, json_length, json_kind] =
            read_words(&mut *file).map_err(Error::io("read", path))?;
        if magic != MAGIC || version != VERSION || json_kind != JSON_CHUNK {
            return Err(damaged("it does not start as glTF 2.0"));
        }
        if total as u64 != size {
            return Err(damaged(&format!("its header says {total} bytes, but it has {size}")));
        }
        let json_end = 20 + json_length as u64;
        if json_end > size {
            return Err(damaged("its JSON chunk goes past the end"));
        }
        let mut json = vec![0; json_length as usize];
        file.read_exact(&mut json).map_err(Error::io("read", path))?;
        let mut container = GlbFile { file, json, binary_start: json_end + 8, binary_length: 0 };
        if json_end + 8 <= size {
            let [length, kind] = read_words(&mut *container.file).map_err(Error::io("read", path))?;
            if kind != BIN_CHUNK || container.binary_start + length as u64 != size {
                return Err(damaged("its second chunk is not binary data up to the end"));
            }
            container.binary_length = length as u64;
        }
        Ok(container)
    }

    /// Parses the JSON chunk.
    pub(crate) fn document<'a, T: Deserialize<'a>>(&'a self, path: &Path) -> Result<T> {
        serde_json::from_slice(&self.json)
            .map_err(|e| Error::input(path, format!("its JSON chunk is not one of this program: {e}")))
    }

    /// Returns how a tile of this program is packed, by the extensions that it names.
    pub(crate) fn compression(&self) -> Compression {
        let names = |extension: &str| memchr::memmem::find(&self.json, extension.as_bytes()).is_some();
        match (names("EXT_meshopt_compression"), names("KHR_mesh_quantization")) {
            (true, _) => Compression::Meshopt,
            (false, true) => Compression::Quantized,
            (false, false) => Compression::None,
        }
    }

    /// Reads the binary chunk.
    pub(crate) fn binary(&mut self, path: &Path) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        bytes
            .try_reserve_exact(self.binary_length as usize)
            .map_err(|_| Error::Memory(format!("{} needs {} bytes to read", path.display(), self.binary_length)))?;
        self.file.seek(SeekFrom::Start(self.binary_start)).map_err(Error::io("read", path))?;
        (&mut self.file).take(self.binary_length).read_to_end(&mut bytes).map_err(Error::io("read", path))?;
        match bytes.len() as u64 == self.binary_length {
            true => Ok(bytes),
            false => Err(Error::input(path, "ends inside its binary chunk")),
        }
    }
}

fn read_words<const N: usize>(file: &mut dyn Bytes) -> std::io::Result<[u32; N]> {
    let mut words = [[0u8; 4]; N];
    file.read_exact(words.as_flattened_mut())?;
    Ok(words.map(u32::from_le_bytes))
}

/// Writes the header, the JSON chunk and the head of the binary chunk. The `length` bytes of that chunk must follow.
pub(crate) fn write_head(mut json: Vec<u8>, length: u64, out: &mut Vec<u8>) -> Result<()> {
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
