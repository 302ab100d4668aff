//! Reading parts of the job's own files through memory maps, a block at a time.
//!
//! A map is made for one block, is read, and goes: so mapped pages never add up to more than the blocks that threads look at. Only
//! files that this process writes under its lock are mapped, never a user's.

use crate::positional_io::read_exact_at;
use bytemuck::Pod;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::io::{ErrorKind, Result};
use std::marker::PhantomData;
use std::ops::Deref;

/// Blocks of fewer bytes than this are read into memory, which takes less time than mapping them.
const LEAST_MAPPED: usize = 16 << 10;

/// Values that lie in a block of a file, to be read as a slice.
#[derive(Debug)]
pub struct MappedSlice<T> {
    bytes: Bytes,
    values: PhantomData<T>,
}

#[derive(Debug)]
enum Bytes {
    Mapped(Mmap),
    /// Words of 16 bytes keep values of any type aligned; the block may end within the last one.
    Read(Vec<u128>, usize),
}

impl<T: Pod> MappedSlice<T> {
    /// Maps `count` values from byte `at` of `file` on. `at` must be a multiple of the values' alignment.
    ///
    /// # Errors
    /// What the operating system says; `UnexpectedEof` if the file ends before the last value.
    pub fn read(file: &File, at: u64, count: usize) -> Result<MappedSlice<T>> {
        let length = count.checked_mul(size_of::<T>()).ok_or(ErrorKind::UnexpectedEof)?;
        let mapped = if length < LEAST_MAPPED { None } else { map(file, at, length) };
        // Some file systems cannot map files, and a disk that cannot be read is told by a plain read.
        let bytes = mapped.map_or_else(|| read(file, at, length), Ok)?;
        Ok(MappedSlice { bytes, values: PhantomData })
    }
}

impl<T: Pod> Deref for MappedSlice<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(match &self.bytes {
            Bytes::Mapped(map) => map,
            Bytes::Read(words, length) => &bytemuck::cast_slice(words)[..*length],
        })
    }
}

fn read(file: &File, at: u64, length: usize) -> Result<Bytes> {
    let mut words = vec![0u128; length.div_ceil(size_of::<u128>())];
    read_exact_at(file, &mut bytemuck::cast_slice_mut(&mut words)[..length], at)?;
    Ok(Bytes::Read(words, length))
}

/// Maps the block and loads its pages. Returns `None` if that fails for any reason.
fn map(file: &File, at: u64, length: usize) -> Option<Bytes> {
    // Reading a mapped page beyond the end of the file would kill the process.
    let end = at.checked_add(length as u64)?;
    if file.metadata().ok()?.len() < end {
        return None;
    }
    // SAFETY: The bytes of the map do not change while it exists. This process has written them already, it never writes to the
    // same place twice or shortens the file while it has readers, and its lock keeps other runs of the program out of the folder.
    let map = unsafe { MmapOptions::new().offset(at).len(length).map(file).ok()? };
    // If a page cannot be read, this fails here; touching the page later would kill the process.
    load_pages(&map).ok()?;
    Some(Bytes::Mapped(map))
}

/// Loads all pages of the map. Fails before Linux 5.14, which does not know the advice.
#[cfg(target_os = "linux")]
fn load_pages(map: &Mmap) -> Result<()> {
    map.advise(memmap2::Advice::PopulateRead)
}

/// Other systems have no such advice: there a disk that fails later ends the process, and the job can go on from its journal.
#[cfg(not(target_os = "linux"))]
fn load_pages(_map: &Mmap) -> Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn blocks_of_any_size_and_place_hold_what_was_written() {
        let mut file = tempfile::tempfile().unwrap();
        let values: Vec<u32> = (0..100_000).collect();
        file.write_all(bytemuck::cast_slice(&values)).unwrap();
        for (first, count) in [(0, 0), (100_000, 0), (0, 1), (1, 3), (1023, 9_000), (5, 99_995), (0, 100_000)] {
            let slice = MappedSlice::<u32>::read(&file, first as u64 * 4, count).unwrap();
            assert_eq!(&slice[..], &values[first..first + count]);
        }
        for (first, count) in [(100_000, 1), (99_999, 2), (50_000, 50_001), (1 << 40, 10_000)] {
            let error = MappedSlice::<u32>::read(&file, first * 4, count).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{first}, {count}");
        }
        assert!(MappedSlice::<u32>::read(&file, 0, usize::MAX).is_err());
    }
}
