//! Files read at given positions: no shared seek position, no memory map, so that any thread may read and a file that
//! shrinks is an error, never a crash.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::input::file::range::{FileRange, SHRUNK};
use crate::{Error, Result};

/// A file open for reading, whose size is known.
pub(crate) struct RandomAccessFile {
    file: File,
    path: PathBuf,
    size: u64,
}

impl RandomAccessFile {
    /// Opens `path`, which must be a regular file.
    pub(crate) fn open(path: &Path) -> Result<RandomAccessFile> {
        // Before it is opened: a pipe would wait for somebody who writes.
        if !path.metadata().map_err(Error::io("read", path))?.is_file() {
            return Err(Error::input(path, "is not a regular file; give the point-cloud files themselves"));
        }
        let file = File::open(path).map_err(Error::io("read", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        Ok(RandomAccessFile { file, path: path.to_path_buf(), size })
    }

    /// Opens `path` again; an error where its size is no longer `size`.
    pub(crate) fn reopen(path: &Path, size: u64) -> Result<RandomAccessFile> {
        let file = RandomAccessFile::open(path)?;
        if file.size != size {
            let what = format!(
                "it has changed while it was in use, from {size} bytes to {}; run again when it is complete",
                file.size
            );
            return Err(Error::io("read", path)(io::Error::other(what)));
        }
        Ok(file)
    }

    /// The size in bytes when the file was opened.
    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// The file's path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Fills `buffer` from `offset` on.
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> Result<()> {
        crate::positional_io::read_exact_at(&self.file, buffer, offset).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Error::io("read", &self.path)(io::Error::other(SHRUNK)),
            _ => Error::io("read", &self.path)(error),
        })
    }

    /// The bytes of `range`, which the caller has checked against [`RandomAccessFile::size`].
    pub(crate) fn bytes(&self, range: std::ops::Range<u64>) -> Result<Vec<u8>> {
        let mut bytes = vec![0; (range.end - range.start) as usize];
        self.read_exact_at(&mut bytes, range.start)?;
        Ok(bytes)
    }

    /// A buffered reader of the bytes of `range`.
    pub(crate) fn range(&self, range: std::ops::Range<u64>) -> Result<FileRange> {
        let file = self.file.try_clone().map_err(Error::io("read", &self.path))?;
        Ok(FileRange::new(file, range))
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Seek, SeekFrom};

    use super::*;

    #[test]
    fn a_window_reads_and_seeks_like_the_bytes_it_shows() {
        let bytes: Vec<u8> = (0..300_000u32).map(|i| (i * 7 % 251) as u8).collect();
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), &bytes).unwrap();
        let file = RandomAccessFile::open(path.path()).unwrap();
        let mut window = file.range(1000..299_000).unwrap();
        let mut at = 1000;
        for (size, step) in [(1, 0), (70_000, 5), (3, -2000), (65_536, 100_000), (10, -60_000), (100_000, 0)] {
            let mut out = vec![0; size];
            window.read_exact(&mut out).unwrap();
            assert!(out == bytes[at..at + size], "{size} bytes at {at}");
            at = (at as i64 + size as i64 + step) as usize;
            assert_eq!(window.seek(SeekFrom::Current(step)).unwrap(), at as u64);
        }
        window.seek(SeekFrom::Start(298_990)).unwrap();
        assert_eq!(window.read_exact(&mut [0; 11]).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn a_file_that_shrinks_is_an_error_and_not_its_end() {
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), [1; 1000]).unwrap();
        let file = RandomAccessFile::open(path.path()).unwrap();
        let mut window = file.range(0..1000).unwrap();
        std::fs::write(path.path(), [1; 10]).unwrap();
        assert_eq!(window.read_exact(&mut [0; 20]).unwrap_err().kind(), io::ErrorKind::Other);
        assert_eq!(file.read_exact_at(&mut [0; 20], 0).unwrap_err().exit_code(), 1);
        assert_eq!(RandomAccessFile::reopen(path.path(), 1000).err().unwrap().exit_code(), 1);
    }
}
