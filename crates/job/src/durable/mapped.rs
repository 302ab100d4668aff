//! Reading parts of the job's own files through memory maps, a block at a time.
//!
//! Only files that this process writes under its lock are mapped, never a user's. Mapped pages count as resident memory, so they go
//! soon: a map of one block with the block, and those of a whole file whenever a few MiB of it have been looked at. Removing pages
//! interrupts all threads, so small blocks are not worth a map of their own.

use bytemuck::Pod;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::io::{ErrorKind, Result};
use std::marker::PhantomData;
use std::ops::Deref;
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::address_space;
use sys::positional_io::read_exact_at;

/// Blocks of fewer bytes than this are read into memory, which takes less time than a map of their own.
const LEAST_MAPPED: usize = 256 << 10;

/// The pages of a whole file are removed whenever about this many bytes of it may be resident.
const MOST_RESIDENT: usize = 4 << 20;

/// Bytes around a part that Linux maps with it if they are in the file cache.
const MAPPED_AROUND: usize = 64 << 10;

/// Values that lie in a block of a file, to be read as a slice.
#[derive(Debug)]
pub struct MappedSlice<'a, T> {
    bytes: Bytes<'a>,
    values: PhantomData<T>,
}

#[derive(Debug)]
enum Bytes<'a> {
    /// A map of this block.
    Mapped(Mmap),
    /// A part of the map of a whole file.
    Part(&'a [u8]),
    /// Words of 16 bytes keep values of any type aligned; the block may end within the last one.
    Read(Vec<u128>, usize),
}

impl<T: Pod> MappedSlice<'static, T> {
    /// Maps `count` values from byte `at` of `file` on. `at` must be a multiple of the values' alignment.
    ///
    /// # Errors
    /// What the operating system says; `UnexpectedEof` if the file ends before the last value.
    pub fn read(file: &File, at: u64, count: usize) -> Result<MappedSlice<'static, T>> {
        let length = byte_length::<T>(count)?;
        let mapped = if length < LEAST_MAPPED { None } else { map_block(file, at, length) };
        // Some file systems cannot map files, and a plain read tells why a disk cannot be read.
        let bytes = mapped.map_or_else(|| read(file, at, length), Ok)?;
        Ok(MappedSlice { bytes, values: PhantomData })
    }
}

impl<T: Pod> Deref for MappedSlice<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(match &self.bytes {
            Bytes::Mapped(map) => map,
            Bytes::Part(bytes) => bytes,
            Bytes::Read(words, length) => &bytemuck::cast_slice(words)[..*length],
        })
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

    /// Returns `count` values from byte `at` of `file` on, which must be the file that is mapped. `at` must be a multiple of the
    /// values' alignment.
    ///
    /// # Errors
    /// As [`MappedSlice::read`].
    pub fn slice<T: Pod>(&self, file: &File, at: u64, count: usize) -> Result<MappedSlice<'_, T>> {
        let length = byte_length::<T>(count)?;
        match self.part(at, length) {
            Some(part) => Ok(MappedSlice { bytes: Bytes::Part(part), values: PhantomData }),
            None => MappedSlice::read(file, at, count),
        }
    }

    /// Returns a part of the map after loading its pages, or `None` if that fails for any reason.
    fn part(&self, at: u64, length: usize) -> Option<&[u8]> {
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

fn byte_length<T>(count: usize) -> Result<usize> {
    count.checked_mul(size_of::<T>()).ok_or_else(|| ErrorKind::UnexpectedEof.into())
}

fn read(file: &File, at: u64, length: usize) -> Result<Bytes<'static>> {
    let mut words = vec![0u128; length.div_ceil(size_of::<u128>())];
    read_exact_at(file, &mut bytemuck::cast_slice_mut(&mut words)[..length], at)?;
    Ok(Bytes::Read(words, length))
}

/// Maps the block and loads its pages. Returns `None` if that fails for any reason.
fn map_block(file: &File, at: u64, length: usize) -> Option<Bytes<'static>> {
    // Reading a mapped page beyond the end of the file would kill the process.
    let end = at.checked_add(length as u64)?;
    if file.metadata().ok()?.len() < end {
        return None;
    }
    // SAFETY: The bytes of the map do not change while it exists. This process has written them already, it never writes to the
    // same place twice, shortens the file or frees the place while it has readers, and its lock keeps other runs of the program out
    // of the folder.
    let map = unsafe { MmapOptions::new().offset(at).len(length).map(file).ok()? };
    load_pages(&map, 0, length).ok()?;
    Some(Bytes::Mapped(map))
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
    use std::io::Write;

    #[test]
    fn blocks_of_any_size_and_place_hold_what_was_written() {
        let mut file = tempfile::tempfile().unwrap();
        let values: Vec<u32> = (0..100_000).collect();
        file.write_all(bytemuck::cast_slice(&values)).unwrap();
        let whole = MappedFile::new(&file);
        for (first, count) in [(0, 0), (100_000, 0), (0, 1), (1, 3), (1023, 9_000), (5, 99_995), (0, 100_000)] {
            let slice = MappedSlice::<u32>::read(&file, first as u64 * 4, count).unwrap();
            assert_eq!(&slice[..], &values[first..first + count]);
            let part = whole.slice::<u32>(&file, first as u64 * 4, count).unwrap();
            assert_eq!(&part[..], &values[first..first + count]);
        }
        for (first, count) in [(100_000, 1), (99_999, 2), (50_000, 50_001), (1 << 40, 10_000)] {
            let error = MappedSlice::<u32>::read(&file, first * 4, count).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{first}, {count}");
            let error = whole.slice::<u32>(&file, first * 4, count).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{first}, {count}");
        }
        assert!(MappedSlice::<u32>::read(&file, 0, usize::MAX).is_err());
    }

    #[test]
    fn slices_stay_as_they_are_when_pages_are_removed() {
        let mut file = tempfile::tempfile().unwrap();
        let values: Vec<u32> = (0..3 * MOST_RESIDENT as u32 / 4).collect();
        file.write_all(bytemuck::cast_slice(&values)).unwrap();
        let whole = MappedFile::new(&file);
        let blocks: Vec<_> = (0..12).map(|i| whole.slice::<u32>(&file, i << 20, 1 << 18).unwrap()).collect();
        for (block, expected) in blocks.iter().zip(values.chunks(1 << 18)) {
            assert_eq!(&block[..], expected);
        }
    }
}
