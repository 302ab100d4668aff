//! A file that any thread may read at any position, of this machine or of another one.

use std::fs::File;
use std::io::{self, Read, Seek};
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::file::range::{FileRange, READ_AHEAD, RangeSource, SHRUNK};
use crate::remote::name::is_remote;
use crate::remote::{HeldFile, WholeFile, to_hold};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, fault};

/// A file that is open for reading and whose size is known.
pub(crate) struct RandomAccessFile {
    content: Content,
    path: PathBuf,
    size: u64,
}

/// Where the bytes are.
enum Content {
    Local(File),
    Remote(HeldFile),
    /// All of them are in memory.
    Whole(WholeFile),
}

impl RandomAccessFile {
    /// Returns a file of another machine that has been fetched whole. `path` is what messages call it.
    pub(crate) fn of_whole(path: PathBuf, file: WholeFile) -> RandomAccessFile {
        RandomAccessFile { size: file.bytes().len() as u64, content: Content::Whole(file), path }
    }

    /// Opens `path`, which must be a regular file, or a file of another machine.
    pub(crate) fn open(path: &Path) -> Result<RandomAccessFile> {
        if is_remote(path) {
            let file = HeldFile::open(path)?;
            return Ok(RandomAccessFile {
                path: path.to_path_buf(),
                size: file.size(),
                content: Content::Remote(file),
            });
        }
        // Ask before opening: opening a pipe would wait until another process writes to it.
        if !path.metadata().map_err(Error::io("read", path))?.is_file() {
            return Err(Error::input(path, kind_text(path)));
        }
        let file = File::open(path).map_err(Error::io("read", path))?;
        let size = file.metadata().map_err(Error::io("read", path))?.len();
        Ok(RandomAccessFile { content: Content::Local(file), path: path.to_path_buf(), size })
    }

    /// Opens `path` again. Fails if the file no longer has `size` bytes.
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

    /// Returns the size in bytes that the file had when it was opened.
    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Returns the file's path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether every read that nobody has prepared takes the time of a request.
    pub(crate) fn is_remote(&self) -> bool {
        matches!(self.content, Content::Remote(_))
    }

    /// Returns what the user should know about the file besides what it holds.
    pub(crate) fn doubt(&self) -> Option<&'static str> {
        match &self.content {
            Content::Local(_) | Content::Whole(_) => None,
            Content::Remote(file) => file.doubt(),
        }
    }

    /// Says that these runs of ranges will each be held with [`RandomAccessFile::hold`], about in this order, and no others: of a file of
    /// another machine they then come ahead of time.
    pub(crate) fn expect(&self, runs: impl Iterator<Item = Vec<Range<u64>>>) {
        if let Content::Remote(file) = &self.content {
            file.expect(runs.flat_map(|ranges| to_hold(ranges.into_iter())).collect());
        }
    }

    /// Brings the bytes of these ranges, which are in their order, into memory until the file is closed, if it is of another machine.
    pub(crate) fn hold(&self, ranges: impl Iterator<Item = Range<u64>>) -> Result<()> {
        match &self.content {
            Content::Local(_) | Content::Whole(_) => Ok(()),
            Content::Remote(file) => file.hold(&to_hold(ranges)),
        }
    }

    /// Fills `buffer` with the bytes from position `offset` on.
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> Result<()> {
        let outcome = fault::read("read-input").and_then(|()| match &self.content {
            Content::Local(file) => read_exact_at(file, buffer, offset),
            Content::Remote(file) => file.read_exact_at(buffer, offset).map_err(io::Error::other),
            Content::Whole(file) => file.read_at(buffer, offset).and_then(|count| match count == buffer.len() {
                true => Ok(()),
                false => Err(io::ErrorKind::UnexpectedEof.into()),
            }),
        });
        outcome.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => Error::io("read", &self.path)(io::Error::other(SHRUNK)),
            _ => Error::io("read", &self.path)(error),
        })
    }

    /// Returns the bytes of `range`. The caller has checked the range against [`RandomAccessFile::size`].
    pub(crate) fn bytes(&self, range: Range<u64>) -> Result<Vec<u8>> {
        let mut bytes = vec![0; (range.end - range.start) as usize];
        self.read_exact_at(&mut bytes, range.start)?;
        Ok(bytes)
    }

    /// Returns a buffered reader of the bytes of `range`.
    pub(crate) fn range(&self, range: Range<u64>) -> Result<FileRange> {
        self.range_with(range, READ_AHEAD)
    }

    /// As [`RandomAccessFile::range`], for a caller who knows what he skips: at most `read_ahead` bytes of that are read.
    #[cfg_attr(not(feature = "remote"), allow(unreachable_code, reason = "then no file is remote"))]
    pub(crate) fn range_with(&self, range: Range<u64>, read_ahead: usize) -> Result<FileRange> {
        let source = match &self.content {
            Content::Local(file) => RangeSource::Local(file.try_clone().map_err(Error::io("read", &self.path))?),
            Content::Remote(file) => RangeSource::Remote(file.stream(range.clone())),
            Content::Whole(file) => RangeSource::Whole(file.clone()),
        };
        Ok(FileRange::new(source, range, read_ahead))
    }
}

/// Opens a file of this machine, or one by URL that is called `path` in public.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Config`] if there is none at a URL; [`Error::Input`] if it is no regular file.
pub fn open_bytes(path: &Path) -> Result<impl Read + Seek + Send + use<>> {
    let file = RandomAccessFile::open(path)?;
    file.range(0..file.size())
}

/// Returns a sentence about what is at `path` if it is there and no regular file.
pub fn not_a_file(path: &Path) -> Option<String> {
    let is_other = path.metadata().is_ok_and(|meta| !meta.is_file());
    is_other.then(|| format!("{} {}", path.display(), kind_text(path)))
}

/// Says what is at `path`, which is no regular file.
fn kind_text(path: &Path) -> &'static str {
    if path.is_dir() {
        "is a directory, not a regular file; name the point clouds in it"
    } else if is_pipe(path) {
        "is a pipe, not a regular file, and cannot be read twice; save its output to a file, and name that"
    } else {
        "is a device, not a regular file; name a point cloud"
    }
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|meta| meta.file_type().is_fifo() || meta.file_type().is_socket())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Seek, SeekFrom};

    use super::*;
    use sys::ErrorKind;

    #[test]
    fn a_range_reads_and_seeks_like_its_bytes() {
        let bytes: Vec<u8> = (0..300_000u32).map(|i| (i * 7 % 251) as u8).collect();
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), &bytes).unwrap();
        let file = RandomAccessFile::open(path.path()).unwrap();
        let mut range = file.range(1000..299_000).unwrap();
        let mut at = 1000;
        for (size, step) in [(1, 0), (70_000, 5), (3, -2000), (65_536, 100_000), (10, -60_000), (100_000, 0)] {
            let mut out = vec![0; size];
            range.read_exact(&mut out).unwrap();
            assert!(out == bytes[at..at + size], "{size} bytes at {at}");
            at = (at as i64 + size as i64 + step) as usize;
            assert_eq!(range.seek(SeekFrom::Current(step)).unwrap(), at as u64);
        }
        range.seek(SeekFrom::Start(298_990)).unwrap();
        assert_eq!(range.read_exact(&mut [0; 11]).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn a_file_that_shrinks_is_an_error_and_not_the_end_of_its_data() {
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), [1; 1000]).unwrap();
        let file = RandomAccessFile::open(path.path()).unwrap();
        let mut range = file.range(0..1000).unwrap();
        std::fs::write(path.path(), [1; 10]).unwrap();
        assert_eq!(range.read_exact(&mut [0; 20]).unwrap_err().kind(), io::ErrorKind::Other);
        assert_eq!(file.read_exact_at(&mut [0; 20], 0).unwrap_err().kind(), ErrorKind::Retry);
        assert_eq!(RandomAccessFile::reopen(path.path(), 1000).err().unwrap().kind(), ErrorKind::Retry);
    }
}
