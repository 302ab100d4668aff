//! A quick look at the content of a file: its size, and a hash of its beginning, its end and samples between them.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64, xxh3_128};

use crate::ept::files::page;
use crate::ept::key::NodeKey;
use crate::ept::name::{NODES, PAGES, is_ept};
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

    /// As [`FileSamples::of`], of an EPT: its index, the first page of its hierarchy, which has the number of points of many nodes, and on this
    /// machine the names, sizes and times of all its files.
    fn of_ept(path: &Path) -> Result<FileSamples> {
        let index = FileSamples::of_one(path)?;
        let page = page(path, NodeKey::default())?;
        let page = page.as_ref();
        let files = if is_remote(path) { 0 } else { xxh3_64(files_beside(path)?.as_bytes()) };
        let parts = [index.samples, xxh3_64(page), files].map(u64::to_le_bytes).concat();
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

/// Returns a line for each file of the nodes and pages beside the index of an EPT: its name, its size, and when it was written, in whole seconds
/// since 1970.
fn files_beside(index: &Path) -> Result<String> {
    let mut lines = Vec::new();
    for folder in [NODES, PAGES].map(|name| index.with_file_name(name)) {
        let mut read = || -> std::io::Result<()> {
            for entry in folder.read_dir()? {
                let entry = entry?;
                let data = entry.metadata()?;
                let written = data.modified()?.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |time| time.as_secs());
                lines.push(format!("{} {} {written}\n", entry.file_name().to_string_lossy(), data.len()));
            }
            Ok(())
        };
        match read() {
            // Reading the data set names the files that are missing.
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            read => read.map_err(Error::io("read", &folder))?,
        }
    }
    lines.sort_unstable();
    Ok(lines.concat())
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::Duration;

    #[test]
    fn a_node_that_is_written_again_makes_another_data_set() {
        let folder = tempfile::tempdir().unwrap();
        let index = folder.path().join("ept.json");
        fs::write(&index, "{}").unwrap();
        for (name, file) in [(PAGES, "0-0-0-0.json"), (NODES, "0-0-0-0.bin"), (NODES, "1-0-0-0.bin")] {
            fs::create_dir_all(folder.path().join(name)).unwrap();
            fs::write(folder.path().join(name).join(file), "{}").unwrap();
        }
        let before = FileSamples::of(&index).unwrap();
        assert_eq!(FileSamples::of(&index).unwrap(), before);
        let node = fs::OpenOptions::new().write(true).open(folder.path().join(NODES).join("1-0-0-0.bin")).unwrap();
        node.set_modified(SystemTime::now() + Duration::from_secs(10)).unwrap();
        let after = FileSamples::of(&index).unwrap();
        assert_ne!(after, before);
        fs::remove_file(folder.path().join(NODES).join("1-0-0-0.bin")).unwrap();
        assert_ne!(FileSamples::of(&index).unwrap(), after);
    }
}
