//! Reading parts of the job's own files through memory maps, a block at a time.
//!
//! A map is made for one block, is read, and goes: so mapped pages never add up to more than the blocks that threads work on. Only
//! files that this process writes under its lock are mapped, never a user's.

use crate::positional_io::read_exact_at;
use bytemuck::Pod;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
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
        let bytes = if length < LEAST_MAPPED { read(file, at, length)? } else { map(file, at, length)? };
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

fn map(file: &File, at: u64, length: usize) -> Result<Bytes> {
    // Reading a mapped page beyond the end of the file would kill the process.
    let end = at.checked_add(length as u64).ok_or(ErrorKind::UnexpectedEof)?;
    if file.metadata()?.len() < end {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    // SAFETY: The bytes of the map do not change while it exists. This process has written them already, it never writes to the
    // same place twice or shortens the file while it has readers, and its lock keeps other runs of the program out of the folder.
    let map = unsafe { MmapOptions::new().offset(at).len(length).map(file)? };
    load_pages(&map, file, at)?;
    Ok(Bytes::Mapped(map))
}

/// Loads all pages of the map. A disk that cannot be read becomes an error here; later it would kill the process.
#[cfg(target_os = "linux")]
fn load_pages(map: &Mmap, file: &File, at: u64) -> Result<()> {
    const EFAULT: i32 = 14;
    match map.advise(memmap2::Advice::PopulateRead) {
        Err(e) if e.raw_os_error() == Some(EFAULT) => {
            // A plain read tells the reason.
            read(file, at, map.len())?;
            Err(Error::other("a part of the file cannot be mapped"))
        }
        // Linux before 5.14 does not know the advice: pages come when they are touched.
        _ => Ok(()),
    }
}

#[cfg(not(target_os = "linux"))]
fn load_pages(_map: &Mmap, _file: &File, _at: u64) -> Result<()> {
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
