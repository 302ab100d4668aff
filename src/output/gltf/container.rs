//! The two chunks of a GLB file.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use serde::Deserialize;

use crate::output::gltf::glb::{BIN_CHUNK, JSON_CHUNK, MAGIC, VERSION};
use crate::{Error, Result};

/// The two chunks of a GLB file.
pub(crate) struct Container {
    file: File,
    json: Vec<u8>,
    binary_start: u64,
    /// Bytes in the binary chunk.
    pub(crate) binary_length: u64,
}

impl Container {
    /// Reads all but the binary chunk and checks the lengths against the file's size.
    pub(crate) fn open(path: &Path) -> Result<Container> {
        // Before it is opened: a pipe would wait for somebody who writes.
        if !path.metadata().map_err(Error::io("open", path))?.is_file() {
            return Err(Error::input(path, "is not a regular file"));
        }
        let mut file = File::open(path).map_err(Error::io("open", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        let damaged = |what: &str| Error::input(path, format!("not a whole GLB file: {what}"));
        if size < 20 {
            return Err(damaged("shorter than its header"));
        }
        let [magic, version, total, json_length, json_kind] = read_words(&mut file).map_err(Error::io("read", path))?;
        if magic != MAGIC || version != VERSION || json_kind != JSON_CHUNK {
            return Err(damaged("it does not start as glTF 2.0"));
        }
        if total as u64 != size {
            return Err(damaged(&format!("its header says {total} bytes, it has {size}")));
        }
        let json_end = 20 + json_length as u64;
        if json_end > size {
            return Err(damaged("its JSON chunk goes past the end"));
        }
        let mut json = vec![0; json_length as usize];
        file.read_exact(&mut json).map_err(Error::io("read", path))?;
        let mut container = Container { file, json, binary_start: json_end + 8, binary_length: 0 };
        if json_end + 8 <= size {
            let [length, kind] = read_words(&mut container.file).map_err(Error::io("read", path))?;
            if kind != BIN_CHUNK || container.binary_start + length as u64 != size {
                return Err(damaged("its second chunk is not binary data up to the end"));
            }
            container.binary_length = length as u64;
        }
        Ok(container)
    }

    /// The JSON chunk as a `T`.
    pub(crate) fn document<'a, T: Deserialize<'a>>(&'a self, path: &Path) -> Result<T> {
        serde_json::from_slice(&self.json)
            .map_err(|e| Error::input(path, format!("its JSON chunk is not one of this program: {e}")))
    }

    /// The binary chunk.
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

fn read_words<const N: usize>(file: &mut File) -> std::io::Result<[u32; N]> {
    let mut words = [[0u8; 4]; N];
    file.read_exact(words.as_flattened_mut())?;
    Ok(words.map(u32::from_le_bytes))
}
