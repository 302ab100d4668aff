//! The layer through which a job changes files: making, writing, renaming, removing them and bringing them to the disk.
//!
//! It adds nothing to the calls of the system. But builds for tests can write down every change, and then make up what a power
//! failure at any moment may leave of them (CONTRIBUTING.md). The test `rooms` finds changes that go around this layer.

use crate::fault::traced;
use crate::positional_io;
use std::fs::{self, File, Metadata};
use std::io::{ErrorKind, Result, Write};
use std::path::Path;

/// Creates the file at `path`, or empties it.
pub(crate) fn create(path: &Path) -> Result<File> {
    let open = || File::options().read(true).write(true).create(true).truncate(true).open(path);
    traced(open, |file| (format!("create {} {}", number(file), path.display()), &[]))
}

/// Opens the file at `path` for reading and writing, and creates it if it is not there.
pub(crate) fn open_or_create(path: &Path) -> Result<File> {
    match open(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => create(path),
        outcome => outcome,
    }
}

/// Opens the file at `path` for reading and writing.
pub(crate) fn open(path: &Path) -> Result<File> {
    File::options().read(true).write(true).open(path)
}

/// Writes all of `bytes` to `file`, from byte `at` on.
pub(crate) fn write_all_at(file: &File, bytes: &[u8], at: u64) -> Result<()> {
    let write = || positional_io::write_all_at(file, bytes, at);
    traced(write, |()| (format!("write {} {at} {}", number(file), bytes.len()), bytes))
}

/// Cuts `file` off after `length` bytes.
pub(crate) fn set_length(file: &File, length: u64) -> Result<()> {
    traced(|| file.set_len(length), |()| (format!("length {} {length}", number(file)), &[]))
}

/// Waits until what was written to `file` is on the disk.
pub(crate) fn sync(file: &File) -> Result<()> {
    traced(|| file.sync_all(), |()| (format!("sync {}", number(file)), &[]))
}

/// As [`sync`], without the times of the file.
pub(crate) fn sync_data(file: &File) -> Result<()> {
    traced(|| file.sync_data(), |()| (format!("sync {}", number(file)), &[]))
}

/// Gives the file at `from` the path `to`, in place of what is there.
pub(crate) fn rename(from: &Path, to: &Path) -> Result<()> {
    traced(|| fs::rename(from, to), |()| (format!("rename {}\t{}", from.display(), to.display()), &[]))
}

/// Removes the file at `path` if it exists.
pub(crate) fn remove_file(path: &Path) -> Result<()> {
    let remove = || fs::remove_file(path);
    unless_missing(traced(remove, |()| (format!("remove {}", path.display()), &[])))
}

/// Removes the folder at `path`, which must be empty.
pub(crate) fn remove_folder(path: &Path) -> Result<()> {
    traced(|| fs::remove_dir(path), |()| (format!("remove {}", path.display()), &[]))
}

/// Removes the folder at `path`, if it exists, with everything in it.
pub(crate) fn remove_tree(path: &Path) -> Result<()> {
    unless_missing(traced(|| fs::remove_dir_all(path), |()| (format!("remove {}", path.display()), &[])))
}

fn unless_missing(outcome: Result<()>) -> Result<()> {
    outcome.or_else(|e| if e.kind() == ErrorKind::NotFound { Ok(()) } else { Err(e) })
}

/// Creates the folder at `path`, and those above it, if need be, and waits until their names are on the disk: otherwise a power
/// failure could take a folder away with everything that was brought to the disk in it.
pub(crate) fn create_folder(path: &Path) -> Result<()> {
    if path.as_os_str().is_empty() || path.is_dir() {
        return Ok(());
    }
    let above = path.parent().unwrap_or(Path::new(""));
    create_folder(above)?;
    match traced(|| fs::create_dir(path), |()| (format!("folder {}", path.display()), &[])) {
        // Another thread was faster.
        Err(e) if e.kind() == ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        outcome => outcome.and_then(|()| match sync_folder(above) {
            // Somebody else's folder: one may create in it, but not open it.
            Err(e) if e.kind() == ErrorKind::PermissionDenied => Ok(()),
            synced => synced,
        }),
    }
}

/// Waits until the names in the folder at `path` are on the disk, on systems that can.
pub(crate) fn sync_folder(path: &Path) -> Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let folder = File::open(path)?;
    traced(|| folder.sync_all(), |()| (format!("sync-folder {}", path.display()), &[]))
}

/// Writes to a file from a position on, one piece after the other.
pub(crate) struct WriteFrom<'a> {
    pub(crate) file: &'a File,
    pub(crate) at: u64,
}

impl Write for WriteFrom<'_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        write_all_at(self.file, bytes, self.at)?;
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Returns what tells the file from others, whatever its name is.
fn number(file: &File) -> u64 {
    file.metadata().map_or(0, |data| inode(&data))
}

#[cfg(unix)]
fn inode(data: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(data)
}

#[cfg(not(unix))]
fn inode(_: &Metadata) -> u64 {
    0
}
