//! Reading parts of the job's own files through memory maps, a block at a time.
//!
//! A map is made for one block, is read, and goes: so mapped pages never add up to more than the blocks that threads work on. Only
//! files that this process writes under its lock are mapped, never a user's.

use crate::positional_io::read_exact_at;
use bytemuck::Pod;
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::ops::Deref;

/// Blocks of fewer bytes than this are read into memory, which takes less time than mapping them.
const LEAST_MAPPED: usize = 16 << 10;

/// Values that lie in a block of a file, to be read as a slice.
#[derive(Debug)]
pub struct MappedSlice<T>(Values<T>);

#[derive(Debug)]
enum Values<T> {
    Mapped(Mmap),
    Read(Vec<T>),
}

impl<T: Pod> MappedSlice<T> {
    /// Maps `count` values from byte `at` of `file` on. Few values, and values that are not aligned in the file, are read instead.
    ///
    /// # Errors
    /// What the operating system says; `UnexpectedEof` if the file ends before the last value.
    pub fn read(file: &File, at: u64, count: usize) -> Result<MappedSlice<T>> {
        let length = count.checked_mul(size_of::<T>()).ok_or(ErrorKind::UnexpectedEof)?;
        if length >= LEAST_MAPPED {
            if at.is_multiple_of(align_of::<T>() as u64) {
                return Ok(MappedSlice(Values::Mapped(map(file, at, length)?)));
            }
            // A damaged count must not ask for all the memory there is.
            holds(file, at, length)?;
        }
        let mut values = vec![T::zeroed(); count];
        read_exact_at(file, bytemuck::cast_slice_mut(&mut values), at)?;
        Ok(MappedSlice(Values::Read(values)))
    }
}

impl<T: Pod> Deref for MappedSlice<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            Values::Mapped(map) => bytemuck::cast_slice(map),
            Values::Read(values) => values,
        }
    }
}

/// Checks that the file has `length` bytes from byte `at` on.
fn holds(file: &File, at: u64, length: usize) -> Result<()> {
    let end = at.checked_add(length as u64).ok_or(ErrorKind::UnexpectedEof)?;
    if file.metadata()?.len() < end { Err(ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

fn map(file: &File, at: u64, length: usize) -> Result<Mmap> {
    // Reading a mapped page beyond the end of the file would kill the process.
    holds(file, at, length)?;
    // SAFETY: The bytes of the map do not change while it exists. This process has written them already, it never writes to the
    // same place twice or shortens the file while it has readers, and its lock keeps other runs of the program out of the folder.
    let map = unsafe { MmapOptions::new().offset(at).len(length).map(file)? };
    load_pages(&map, file, at)?;
    Ok(map)
}

/// Loads all pages of the map. A disk that cannot be read becomes an error here; later it would kill the process.
#[cfg(target_os = "linux")]
fn load_pages(map: &Mmap, file: &File, at: u64) -> Result<()> {
    const EFAULT: i32 = 14;
    match map.advise(memmap2::Advice::PopulateRead) {
        Err(e) if e.raw_os_error() == Some(EFAULT) => {
            // A plain read tells the reason.
            read_exact_at(file, &mut vec![0; map.len()], at)?;
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

    #[test]
    fn wide_values_need_not_be_aligned_in_the_file() {
        let mut file = tempfile::tempfile().unwrap();
        let values: Vec<[i128; 3]> = (0..2_000).map(|value| [value, -value, 1 << 100]).collect();
        file.write_all(&[0; 8]).unwrap();
        file.write_all(bytemuck::cast_slice(&values)).unwrap();
        for (first, count) in [(0, 0), (0, 1), (3, 7), (0, 2_000), (1, 1_999)] {
            let at = 8 + first as u64 * size_of::<[i128; 3]>() as u64;
            let slice = MappedSlice::<[i128; 3]>::read(&file, at, count).unwrap();
            assert_eq!(&slice[..], &values[first..first + count]);
        }
    }
}
