//! Reading and writing at a position of a file that several threads share, without a common cursor.

use std::fs::File;
use std::io::Result;

/// Fills `buffer` from byte `at` of `file` on.
///
/// # Errors
/// What the operating system says; `UnexpectedEof` if the file ends before the buffer is full.
#[cfg(unix)]
pub fn read_exact_at(file: &File, buffer: &mut [u8], at: u64) -> Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, at)
}

/// Writes all of `buffer` from byte `at` of `file` on.
///
/// # Errors
/// What the operating system says.
#[cfg(unix)]
pub fn write_all_at(file: &File, buffer: &[u8], at: u64) -> Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, buffer, at)
}

/// Fills `buffer` from byte `at` of `file` on.
///
/// # Errors
/// What the operating system says; `UnexpectedEof` if the file ends before the buffer is full.
#[cfg(windows)]
pub fn read_exact_at(file: &File, mut buffer: &mut [u8], mut at: u64) -> Result<()> {
    use std::os::windows::fs::FileExt;
    while !buffer.is_empty() {
        let read = file.seek_read(buffer, at)?;
        if read == 0 {
            return Err(std::io::ErrorKind::UnexpectedEof.into());
        }
        buffer = &mut buffer[read..];
        at += read as u64;
    }
    Ok(())
}

/// Writes all of `buffer` from byte `at` of `file` on.
///
/// # Errors
/// What the operating system says.
#[cfg(windows)]
pub fn write_all_at(file: &File, mut buffer: &[u8], mut at: u64) -> Result<()> {
    use std::os::windows::fs::FileExt;
    while !buffer.is_empty() {
        let written = file.seek_write(buffer, at)?;
        buffer = &buffer[written..];
        at += written as u64;
    }
    Ok(())
}
