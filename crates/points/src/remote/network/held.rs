//! A file of another machine that is open: what of it is in memory, and streams of its bytes.

use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crate::remote::network::file::RemoteFile;
use crate::remote::network::read_plan::joined;
use crate::remote::network::window::{Pending, Window};
use sys::Result;

/// A read of fewer bytes fetches so many, because the next one is likely to be near.
const BLOCK: u64 = 1 << 16;

/// The most windows of small reads that are held.
const MOST_BLOCKS: usize = 8;

/// The most bytes that are held at once for a range. A longer one comes as a stream.
pub(crate) const LONGEST_HELD: u64 = 1 << 23;

/// The greatest window of a stream.
const LONGEST_WINDOW: u64 = 1 << 22;

/// A file that is open. It holds bytes for those who read it until it is dropped.
pub(crate) struct HeldFile {
    file: Arc<RemoteFile>,
    /// What was asked for with [`HeldFile::hold`].
    held: Mutex<Vec<Arc<Window>>>,
    /// What small reads have brought, the latest last.
    blocks: Mutex<Vec<Arc<Window>>>,
}

impl HeldFile {
    /// Opens the file with this public name.
    ///
    /// # Errors
    /// As [`RemoteFile::open`].
    pub(crate) fn open(name: &Path) -> Result<HeldFile> {
        let file = RemoteFile::open(name)?;
        let blocks = file.take_beginning().into_iter().collect();
        Ok(HeldFile { file, held: Mutex::new(Vec::new()), blocks: Mutex::new(blocks) })
    }

    /// Returns its size in bytes.
    pub(crate) fn size(&self) -> u64 {
        self.file.size()
    }

    /// Returns what the user should know about it.
    pub(crate) fn doubt(&self) -> Option<&'static str> {
        const DOUBT: &str = "its server sends neither ETag nor Last-Modified, so a change is noticed only in its size and its first 32 KiB";
        (!self.file.is_sure()).then_some(DOUBT)
    }

    /// Says that `ranges` will be held or read, as [`RemoteFile::expect`] does.
    pub(crate) fn expect(&self, ranges: Vec<Range<u64>>) {
        self.file.expect(ranges);
    }

    /// Fetches these ranges, all at the same time, and holds them.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the server does not hand them out, [`sys::Error::Interrupted`] if the process is to stop.
    pub(crate) fn hold(&self, ranges: &[Range<u64>]) -> Result<()> {
        let missing = ranges.iter().filter(|range| !self.has(range)).cloned();
        let pending: Vec<_> = missing.map(|range| (self.file.fetch_to_keep(range.clone()), range)).collect();
        for (pending, range) in pending {
            let window = self.file.wait(&pending, &range)?;
            self.held.lock().unwrap_or_else(PoisonError::into_inner).push(window);
        }
        Ok(())
    }

    /// Returns whether all bytes of a range are in memory.
    fn has(&self, range: &Range<u64>) -> bool {
        let length = (range.end - range.start) as usize;
        self.window_at(range.start)
            .is_some_and(|window| window.from(range.start).is_some_and(|rest| rest.len() >= length))
    }

    /// Returns what is in memory from position `at` on.
    fn window_at(&self, at: u64) -> Option<Arc<Window>> {
        let find = |windows: &Mutex<Vec<Arc<Window>>>| {
            let windows = windows.lock().unwrap_or_else(PoisonError::into_inner);
            let with = windows.iter().filter_map(|window| Some((window.from(at)?.len(), window)));
            with.max_by_key(|(rest, _)| *rest).map(|(_, window)| window.clone())
        };
        find(&self.held).or_else(|| find(&self.blocks))
    }

    /// Fills `buffer` with the bytes from position `at` on, which lie in the file.
    ///
    /// # Errors
    /// As [`HeldFile::hold`].
    pub(crate) fn read_exact_at(&self, mut buffer: &mut [u8], mut at: u64) -> Result<()> {
        while !buffer.is_empty() {
            let window = match self.window_at(at) {
                Some(window) => window,
                None => self.bring(at..at + buffer.len() as u64)?,
            };
            let bytes = window.from(at).unwrap_or_default();
            let count = bytes.len().min(buffer.len());
            if count == 0 {
                return Err(sys::Error::Broken(format!("nothing came from byte {at} on")));
            }
            let (filled, rest) = buffer.split_at_mut(count);
            filled.copy_from_slice(&bytes[..count]);
            (buffer, at) = (rest, at + count as u64);
        }
        Ok(())
    }

    /// Fetches a range, and what follows a short one.
    fn bring(&self, range: Range<u64>) -> Result<Arc<Window>> {
        let is_short = range.end - range.start < BLOCK;
        let range = if is_short { range.start..(range.start + BLOCK).min(self.size()).max(range.end) } else { range };
        let window = self.file.wait(&self.file.fetch(range.clone()), &range)?;
        if is_short {
            let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
            if blocks.len() == MOST_BLOCKS {
                blocks.remove(0);
            }
            blocks.push(window.clone());
        }
        Ok(window)
    }

    /// Returns a stream of the bytes up to position `end`.
    pub(crate) fn stream(&self, range: Range<u64>) -> RemoteStream {
        let window = self.window_at(range.start);
        RemoteStream { file: self.file.clone(), window, ahead: None, length: BLOCK, end: range.end }
    }
}

/// A stream of the bytes of a file. Its windows grow as long as it is read on, and the next one comes meanwhile.
pub(crate) struct RemoteStream {
    file: Arc<RemoteFile>,
    /// What is being read.
    window: Option<Arc<Window>>,
    /// What comes next.
    ahead: Option<(Range<u64>, Pending)>,
    /// The bytes of the next window.
    length: u64,
    end: u64,
}

impl RemoteStream {
    /// Reads some bytes from position `at` on, at most to the end of the stream; none behind it.
    ///
    /// # Errors
    /// Holds the error of the crate, which [`sys::Error::io`] finds in it.
    pub(crate) fn read_at(&mut self, out: &mut [u8], at: u64) -> io::Result<usize> {
        if at >= self.end || out.is_empty() {
            return Ok(0);
        }
        let is_here = self.window.as_ref().is_some_and(|window| window.from(at).is_some());
        if !is_here {
            self.window = Some(self.next_window(at).map_err(io::Error::other)?);
        }
        let bytes = self.window.as_ref().and_then(|window| window.from(at)).unwrap_or_default();
        let count = bytes.len().min(out.len()).min((self.end - at) as usize);
        out[..count].copy_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn next_window(&mut self, at: u64) -> Result<Arc<Window>> {
        let is_next = |(range, _): &(Range<u64>, Pending)| range.contains(&at);
        let (range, pending, goes_on) = match self.ahead.take().filter(is_next) {
            Some((range, pending)) => (range, pending, true),
            None => {
                let range = at..(at + self.length).min(self.end);
                (range.clone(), self.file.fetch(range), self.window.is_some())
            }
        };
        if goes_on && range.end < self.end {
            self.length = (self.length * 2).min(LONGEST_WINDOW);
            let next = range.end..(range.end + self.length).min(self.end);
            self.ahead = Some((next.clone(), self.file.fetch(next)));
        }
        self.file.wait(&pending, &range)
    }
}

/// Joins the ranges that a decoder reads one after the other to what is best held at once. Those that are too long are left out.
pub(crate) fn to_hold(ranges: impl Iterator<Item = Range<u64>>) -> Vec<Range<u64>> {
    let short = ranges.filter(|range| (1..=LONGEST_HELD).contains(&(range.end - range.start)));
    joined(short, LONGEST_HELD)
}
