//! A quick look at the content of a file: its size, and a hash of its beginning, its end and samples between them.

use std::fs::File;
use std::path::Path;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64, xxh3_128};

use crate::ept::files::page;
use crate::ept::key::NodeKey;
use crate::ept::name::is_ept;
use crate::remote::identity;
use crate::remote::name::is_remote;
use sys::positional_io::read_exact_at;
use sys::{Error, Result, fault};

/// Bytes that are hashed at the beginning and at the end of a file.
const END_BYTES: u64 = 64 << 10;
/// Bytes of a sample between them.
const SAMPLE_BYTES: u64 = 4 << 10;
/// The number of samples between them.
const SAMPLES: u64 = 16;

/// The size of a file, and a hash of samples of its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FileSamples {
    /// Its size in bytes.
    pub bytes: u64,
    /// The XXH3 of its beginning, its end and samples between them.
    pub samples: u64,
}

impl FileSamples {
    /// Looks at the file at `path`. Of one of another machine, what its server says of it stands for samples.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub fn of(path: &Path) -> Result<FileSamples> {
        if is_ept(path) {
            return FileSamples::of_ept(path);
        }
        FileSamples::of_one(path)
    }

    /// As [`FileSamples::of`], of an EPT: its index, and the first page of its hierarchy, which has the number of points of many nodes.
    fn of_ept(path: &Path) -> Result<FileSamples> {
        let index = FileSamples::of_one(path)?;
        let page = page(path, NodeKey::default())?;
        let page = page.as_ref();
        let parts = [index.samples, xxh3_64(page)].map(u64::to_le_bytes).concat();
        Ok(FileSamples { bytes: index.bytes + page.len() as u64, samples: xxh3_64(&parts) })
    }

    fn of_one(path: &Path) -> Result<FileSamples> {
        if is_remote(path) {
            return identity(path).map(|(bytes, samples)| FileSamples { bytes, samples });
        }
        let file = File::open(path).map_err(Error::io("read", path))?;
        let bytes = file.metadata().map_err(Error::io("read", path))?.len();
        let samples = hash_of_samples(&file, bytes).map_err(Error::io("read", path))?;
        Ok(FileSamples { bytes, samples })
    }
}

/// Returns a text of 32 hexadecimal digits that tells these files from others, whatever their names and their order.
pub fn fingerprint_of(mut files: Vec<FileSamples>) -> String {
    files.sort_unstable();
    let bytes = files.iter().flat_map(|file| [file.bytes, file.samples]).flat_map(u64::to_le_bytes);
    format!("{:032x}", xxh3_128(&bytes.collect::<Vec<u8>>()))
}

fn hash_of_samples(file: &File, bytes: u64) -> std::io::Result<u64> {
    let last = bytes.saturating_sub(END_BYTES);
    let between = (1..=SAMPLES).map(|i| (last / (SAMPLES + 1) * i, SAMPLE_BYTES));
    let (mut hasher, mut buffer) = (Xxh3::new(), Vec::new());
    for (at, length) in [(0, END_BYTES), (last, END_BYTES)].into_iter().chain(between) {
        buffer.resize(length.min(bytes - at) as usize, 0);
        fault::read("read-input")?;
        read_exact_at(file, &mut buffer, at)?;
        hasher.update(&buffer);
    }
    Ok(hasher.digest())
}
