//! A range of a file's bytes as a stream.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use crate::remote::{RemoteStream, WholeFile};
use sys::fault;
use sys::positional_io::read_at;

/// The message for a file that ends before the size it had when it was opened.
pub(crate) const SHRUNK: &str = "it became shorter while it was read; run again when it is complete";

/// The number of bytes that a [`FileRange`] usually reads at once.
pub(crate) const READ_AHEAD: usize = 1 << 16;

/// Where the bytes of a range come from.
pub(crate) enum RangeSource {
    Local(File),
    Remote(RemoteStream),
    Whole(WholeFile),
}

impl RangeSource {
    fn read_at(&mut self, out: &mut [u8], at: u64) -> io::Result<usize> {
        match self {
            RangeSource::Local(file) => read_at(file, out, at),
            RangeSource::Remote(stream) => stream.read_at(out, at),
            RangeSource::Whole(file) => file.read_at(out, at),
        }
    }
}

/// A buffered reader of a range of a file. It ends where the range ends, and reads at most `read_ahead` of the bytes that a caller skips.
pub(crate) struct FileRange {
    source: RangeSource,
    /// The number of bytes to read at once.
    read_ahead: usize,
    /// The position in the file of the first byte after the buffer.
    next: u64,
    end: u64,
    buffer: Vec<u8>,
    /// The position in the buffer of the next byte to hand out.
    at: usize,
}

impl FileRange {
    /// Returns a reader of the bytes of `range` of a file.
    pub(crate) fn new(source: RangeSource, range: Range<u64>, read_ahead: usize) -> FileRange {
        FileRange { source, read_ahead, next: range.start, end: range.end, buffer: Vec::new(), at: 0 }
    }

    /// Reads into `out` past the buffer, at most to the end of the range. Fails if the file ends before the range does.
    fn read_direct(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let size = self.end.saturating_sub(self.next).min(out.len() as u64) as usize;
        if size == 0 {
            return Ok(0);
        }
        fault::read("read-input")?;
        match self.source.read_at(&mut out[..size], self.next)? {
            0 => Err(io::Error::other(SHRUNK)),
            count => {
                self.next += count as u64;
                Ok(count)
            }
        }
    }

    fn refill(&mut self) -> io::Result<()> {
        let mut buffer = std::mem::take(&mut self.buffer);
        self.at = 0;
        buffer.resize(self.read_ahead, 0);
        let count = self.read_direct(&mut buffer)?;
        buffer.truncate(count);
        self.buffer = buffer;
        Ok(())
    }
}

impl Read for FileRange {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.buffer.len() {
            if out.len() >= self.read_ahead {
                self.buffer.clear();
                self.at = 0;
                return self.read_direct(out);
            }
            self.refill()?;
        }
        let count = out.len().min(self.buffer.len() - self.at);
        out[..count].copy_from_slice(&self.buffer[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }

    #[inline]
    fn read_exact(&mut self, mut out: &mut [u8]) -> io::Result<()> {
        // The arithmetic decoder asks for single bytes.
        if let Some(bytes) = self.buffer.get(self.at..self.at + out.len()) {
            out.copy_from_slice(bytes);
            self.at += out.len();
            return Ok(());
        }
        while !out.is_empty() {
            match self.read(out) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => out = &mut out[count..],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

impl Seek for FileRange {
    /// Seeks to a position, which counts from the start of the file and not of the range.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let here = self.next - (self.buffer.len() - self.at) as u64;
        let target = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::Current(step) => here.checked_add_signed(step),
            SeekFrom::End(step) => self.end.checked_add_signed(step),
        };
        let target = target.ok_or(io::ErrorKind::InvalidInput)?;
        let first = self.next - self.buffer.len() as u64;
        if (first..=self.next).contains(&target) {
            self.at = (target - first) as usize;
        } else {
            (self.next, self.at) = (target, 0);
            self.buffer.clear();
        }
        Ok(target)
    }
}
