//! Reading parts of the job's own finished files through memory maps.
//!
//! Only files that this process writes under its lock are mapped, never a user's. Mapped pages count as resident memory, so they go whenever
//! a few MiB of a file have been looked at.

use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::io::Result;
use std::ops::Deref;
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::address_space;
use sys::positional_io::read_exact_at;

/// The pages of a file are removed whenever about this many bytes of it may be resident.
const MOST_RESIDENT: usize = 4 << 20;

/// Bytes around a part that Linux maps with it if they are in the file cache.
const MAPPED_AROUND: usize = 64 << 10;

/// A part of a file.
#[derive(Debug)]
pub enum FilePart<'a> {
    /// A part of the map.
    Mapped(&'a [u8]),
    /// A copy, where the file is not mapped.
    Read(Vec<u8>),
}

impl Deref for FilePart<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            FilePart::Mapped(bytes) => bytes,
            FilePart::Read(bytes) => bytes,
        }
    }
}

/// A finished file that is mapped as a whole, if the system can.
#[derive(Debug, Default)]
pub struct MappedFile {
    map: Option<Mmap>,
    /// Bytes that may have become resident since pages were last removed.
    resident: AtomicUsize,
}

impl MappedFile {
    /// Maps `file`. What is read of it must not change any more; other parts may be freed.
    pub fn new(file: &File) -> MappedFile {
        let length = file.metadata().map_or(0, |meta| meta.len());
        // Where the address space is limited, the steps need it for more than this.
        if address_space::left().is_some_and(|left| left.bytes / 4 < length) {
            return MappedFile::default();
        }
        // SAFETY: The file is finished: nothing writes to it or shortens it while the map exists, a part of it is freed only when
        // nobody reads that part any more, and the lock of the job keeps other runs of the program out of the folder.
        let map = unsafe { MmapOptions::new().map(file) };
        MappedFile { map: map.ok(), resident: AtomicUsize::new(0) }
    }

    /// Returns `length` bytes of `file`, which must be the file that is mapped, from byte `at` on.
    ///
    /// # Errors
    /// What the operating system tells; `UnexpectedEof` if the file ends before the last byte.
    pub fn part(&self, file: &File, at: u64, length: usize) -> Result<FilePart<'_>> {
        // Some file systems cannot map files, and a plain read tells why a disk cannot be read.
        if let Some(part) = self.mapped(at, length) {
            return Ok(FilePart::Mapped(part));
        }
        let mut bytes = vec![0; length];
        read_exact_at(file, &mut bytes, at)?;
        Ok(FilePart::Read(bytes))
    }

    /// Returns a part of the map after loading its pages, or `None` if that fails for any reason.
    fn mapped(&self, at: u64, length: usize) -> Option<&[u8]> {
        let map = self.map.as_ref()?;
        let start = usize::try_from(at).ok()?;
        let part = map.get(start..start.checked_add(length)?)?;
        let loaded = length + MAPPED_AROUND;
        if self.resident.fetch_add(loaded, Ordering::Relaxed) > MOST_RESIDENT {
            self.resident.store(loaded, Ordering::Relaxed);
            remove_pages(map);
        }
        load_pages(map, start, length).ok()?;
        Some(part)
    }
}

/// Loads the pages of a part of the map. If a page cannot be read, this fails; touching the page later would kill the process. It
/// also fails before Linux 5.14, which does not know the advice.
#[cfg(target_os = "linux")]
fn load_pages(map: &Mmap, start: usize, length: usize) -> Result<()> {
    map.advise_range(memmap2::Advice::PopulateRead, start, length)
}

/// Other systems have no such advice: there a disk that fails later ends the process, and the job can go on from its journal.
#[cfg(not(target_os = "linux"))]
fn load_pages(_map: &Mmap, _start: usize, _length: usize) -> Result<()> {
    Ok(())
}

/// Takes the pages of the map out of this process. They stay in the system's file cache, and come back when they are touched. If the
/// cache has dropped one by then and the disk fails, that ends the process, and the job can go on from its journal.
#[cfg(unix)]
fn remove_pages(map: &Mmap) {
    // SAFETY: The map is a shared, read-only map of a file of which nothing changes that anybody reads: a page that comes back has
    // the same bytes. So the slices that other threads hold stay valid.
    let removed = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
    // If the system refuses, the pages stay resident, which costs memory and nothing else.
    let _ = removed;
}

#[cfg(not(unix))]
fn remove_pages(_map: &Mmap) {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{ErrorKind, Write};

    fn file_of(bytes: &[u8]) -> File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    #[test]
    fn parts_of_any_size_and_place_hold_what_was_written() {
        let bytes: Vec<u8> = (0..400_000u32).map(|i| ((i * 7919) >> 8) as u8).collect();
        let file = file_of(&bytes);
        for map in [MappedFile::new(&file), MappedFile::default()] {
            for (first, count) in [(0, 0), (400_000, 0), (0, 1), (1, 3), (1023, 9_000), (5, 399_995), (0, 400_000)] {
                assert_eq!(&map.part(&file, first as u64, count).unwrap()[..], &bytes[first..first + count]);
            }
            for (first, count) in [(400_000, 1), (399_999, 2), (200_000, 200_001), (1 << 40, 10_000)] {
                let error = map.part(&file, first, count).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{first}, {count}");
            }
        }
    }

    #[test]
    fn parts_stay_as_they_are_when_pages_are_removed() {
        let bytes: Vec<u8> = (0..3 * MOST_RESIDENT as u32).map(|i| (i.wrapping_mul(7919) >> 8) as u8).collect();
        let file = file_of(&bytes);
        let map = MappedFile::new(&file);
        let parts: Vec<_> = (0..12).map(|i| map.part(&file, i << 20, 1 << 20).unwrap()).collect();
        for (part, expected) in parts.iter().zip(bytes.chunks(1 << 20)) {
            assert_eq!(&part[..], expected);
        }
    }
}
