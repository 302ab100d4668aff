//! The pages of an SQLite database, written one after the other.

use std::fs::File;
use sys::disk::write_all_at;

/// The bytes of a page.
pub(super) const PAGE: usize = 4096;

/// The number of the page that SQLite locks, and never uses: the one from 1 GiB on.
const LOCKED_PAGE: u32 = (1 << 30) / PAGE as u32 + 1;

/// Pages are written to the disk when there are so many bytes of them.
const BUFFER: usize = 1 << 20;

/// Writes pages from the second on. The first has the schema and is known last.
pub(super) struct PageFile<'a> {
    file: &'a File,
    /// Pages that are not written yet.
    buffer: Vec<u8>,
    /// The number of the next page; the first page of a file is 1.
    next: u64,
}

impl<'a> PageFile<'a> {
    /// Returns the pages of an empty file.
    pub(super) fn new(file: &'a File) -> PageFile<'a> {
        PageFile { file, buffer: Vec::with_capacity(BUFFER + PAGE), next: 2 }
    }

    /// Returns the number that the next page will have, so that the page before can name it.
    ///
    /// # Errors
    /// That of the disk; one that says that the file has too many pages.
    pub(super) fn next_number(&mut self) -> std::io::Result<u32> {
        if self.next == u64::from(LOCKED_PAGE) {
            self.add_next(&[0; PAGE])?;
        }
        let too_many = |_| std::io::Error::other("a GeoPackage holds no more than 16 TiB");
        u32::try_from(self.next).map_err(too_many)
    }

    /// Returns the number of the page that is added after that with this number.
    pub(super) fn after(number: u32) -> u32 {
        let next = number.saturating_add(1);
        if next == LOCKED_PAGE { LOCKED_PAGE + 1 } else { next }
    }

    /// Adds a page and returns its number.
    ///
    /// # Errors
    /// As [`PageFile::next_number`].
    pub(super) fn add(&mut self, page: &[u8; PAGE]) -> std::io::Result<u32> {
        let number = self.next_number()?;
        self.add_next(page)?;
        Ok(number)
    }

    fn add_next(&mut self, page: &[u8; PAGE]) -> std::io::Result<()> {
        self.buffer.extend_from_slice(page);
        self.next += 1;
        if self.buffer.len() >= BUFFER { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        let at = (self.next - 1) * PAGE as u64 - self.buffer.len() as u64;
        write_all_at(self.file, &self.buffer, at)?;
        self.buffer.clear();
        Ok(())
    }

    /// Writes what is left, and then the first page, which `first` makes of the number of all pages. Returns that number.
    ///
    /// # Errors
    /// That of the disk.
    pub(super) fn finish(mut self, first: impl FnOnce(u32) -> [u8; PAGE]) -> std::io::Result<u32> {
        self.flush()?;
        // A page with a greater number could not be added.
        let pages = u32::try_from(self.next - 1).unwrap_or(u32::MAX);
        write_all_at(self.file, &first(pages), 0)?;
        Ok(pages)
    }
}
