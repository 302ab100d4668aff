//! Reading and writing at a position of a file. Several threads can share the file, because there is no common cursor.

use std::fs::File;
use std::io::{ErrorKind, Result};

/// Reads some bytes from byte `at` of `file` on and returns their number, which is 0 at the end of the file.
///
/// # Errors
/// The error of the operating system.
#[cfg(unix)]
pub fn read_at(file: &File, buffer: &mut [u8], at: u64) -> Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, at)
}

/// Reads some bytes from byte `at` of `file` on and returns their number, which is 0 at the end of the file.
///
/// # Errors
/// The error of the operating system.
#[cfg(windows)]
pub fn read_at(file: &File, buffer: &mut [u8], at: u64) -> Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, buffer, at)
}

#[cfg(unix)]
fn write_at(file: &File, buffer: &[u8], at: u64) -> Result<usize> {
    std::os::unix::fs::FileExt::write_at(file, buffer, at)
}

#[cfg(windows)]
fn write_at(file: &File, buffer: &[u8], at: u64) -> Result<usize> {
    std::os::windows::fs::FileExt::seek_write(file, buffer, at)
}

/// Fills `buffer` with the bytes from byte `at` of `file` on.
///
/// # Errors
/// The error of the operating system; `UnexpectedEof` if the file ends before the buffer is full.
pub fn read_exact_at(file: &File, mut buffer: &mut [u8], mut at: u64) -> Result<()> {
    while !buffer.is_empty() {
        match read_at(file, buffer, at) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(read) => {
                buffer = &mut buffer[read..];
                at += read as u64;
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// Writes all of `buffer` to `file`, from byte `at` on.
///
/// # Errors
/// The error of the operating system.
pub fn write_all_at(file: &File, mut buffer: &[u8], mut at: u64) -> Result<()> {
    while !buffer.is_empty() {
        match write_at(file, buffer, at) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(written) => {
                buffer = &buffer[written..];
                at += written as u64;
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}
