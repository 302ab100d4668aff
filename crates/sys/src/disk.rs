//! The layer through which a job changes files: making, writing, renaming, removing them and bringing them to the disk. It also
//! tells what is there, so that an error never passes for "nothing is there".
//!
//! It adds little to the calls of the system. But builds for tests can write down every change, and then make up what a power
//! failure at any moment may leave of them (CONTRIBUTING.md). The test `architecture` finds changes that go around this layer.

use crate::fault::traced;
use crate::{fault, positional_io};
use std::borrow::Borrow;
use std::fs::{self, File, Metadata};
use std::io::{ErrorKind, Result, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Creates the file at `path`, or empties it.
pub fn create(path: &Path) -> Result<File> {
    let open = || File::options().read(true).write(true).create(true).truncate(true).open(path);
    traced(open, |file| (format!("create {} {}", number(file), path.display()), &[]))
}

/// Opens the file at `path` for reading and writing, and creates it if it is not there.
pub fn open_or_create(path: &Path) -> Result<File> {
    match open(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => create(path),
        outcome => outcome,
    }
}

/// Opens the file at `path` for reading and writing.
pub fn open(path: &Path) -> Result<File> {
    File::options().read(true).write(true).open(path)
}

/// Writes all of `bytes` to `file`, from byte `at` on.
pub fn write_all_at(file: &File, bytes: &[u8], at: u64) -> Result<()> {
    let write = || positional_io::write_all_at(file, bytes, at);
    traced(write, |()| (format!("write {} {at} {}", number(file), bytes.len()), bytes))
}

/// Cuts `file` off after `length` bytes.
pub fn set_length(file: &File, length: u64) -> Result<()> {
    traced(|| file.set_len(length), |()| (format!("length {} {length}", number(file)), &[]))
}

/// Gives the space of `ranges` of `file` back to the disk: they read as zeros afterwards. Returns the number of bytes. A system or a
/// file system that cannot do it keeps them, which costs space and nothing else.
pub fn free(file: &File, ranges: &[Range<u64>]) -> Result<u64> {
    let mut freed = 0;
    for range in ranges {
        let length = range.end - range.start;
        let punch = || punch_hole(file, range.start, length);
        match traced(punch, |()| (format!("free {} {} {length}", number(file), range.start), &[])) {
            Err(e) if e.kind() == ErrorKind::Unsupported => return Ok(freed),
            outcome => outcome?,
        }
        freed += length;
    }
    Ok(freed)
}

#[cfg(target_os = "linux")]
fn punch_hole(file: &File, at: u64, length: u64) -> Result<()> {
    use rustix::fs::{FallocateFlags, fallocate};
    use rustix::io::{Errno, retry_on_intr};
    let flags = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
    retry_on_intr(|| fallocate(file, flags, at, length)).map_err(|code| match code {
        Errno::OPNOTSUPP | Errno::NOSYS => ErrorKind::Unsupported.into(),
        code => code.into(),
    })
}

#[cfg(not(target_os = "linux"))]
fn punch_hole(_: &File, _: u64, _: u64) -> Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Has the system begin to bring what was written to `file` to the disk, if it can, so that a [`sync`] later waits less. Nothing depends
/// on it.
pub fn begin_sync(file: &File) {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{Advice, fadvise};
        // Linux begins to write the pages that are not on the disk yet, and keeps them in memory meanwhile.
        let _ = fadvise(file, 0, None, Advice::DontNeed);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = file;
}

/// Waits until what was written to `file` is on the disk.
pub fn sync(file: &File) -> Result<()> {
    traced(|| file.sync_all(), |()| (format!("sync {}", number(file)), &[]))
}

/// As [`sync`], without the times of the file.
pub fn sync_data(file: &File) -> Result<()> {
    traced(|| file.sync_data(), |()| (format!("sync {}", number(file)), &[]))
}

/// Gives the file at `from` the path `to`, in place of what is there.
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    traced(|| fs::rename(from, to), |()| (format!("rename {}\t{}", from.display(), to.display()), &[]))
}

/// Gives the file at `from` the path `to` too, in place of what is there. Where the file system has no hard links, `to` becomes a copy.
/// `partial` is a path on the same file system for the meantime, which nothing else has.
pub fn link(from: &Path, to: &Path, partial: &Path) -> Result<()> {
    remove_file(partial)?;
    let copy = || fs::copy(from, partial).and_then(|_| File::open(partial)?.sync_all());
    let linked = || match fs::hard_link(from, partial) {
        Err(e) if !matches!(e.kind(), ErrorKind::NotFound | ErrorKind::StorageFull) => copy(),
        outcome => outcome,
    };
    traced(linked, |()| (format!("link {}\t{}", from.display(), partial.display()), &[]))?;
    rename(partial, to)?;
    // Where both were links to one file already, nothing was renamed.
    remove_file(partial)
}

/// Tells whether both paths surely lead to one file.
pub fn is_one_file(a: &Path, b: &Path) -> Result<bool> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let [a, b] = [a.metadata()?, b.metadata()?];
        Ok((a.dev(), a.ino()) == (b.dev(), b.ino()))
    }
    #[cfg(not(unix))]
    Ok(a.canonicalize()? == b.canonicalize()?)
}

/// Removes the file at `path` if it exists.
pub fn remove_file(path: &Path) -> Result<()> {
    let remove = || fs::remove_file(path);
    unless_missing(traced(remove, |()| (format!("remove {}", path.display()), &[])))
}

/// Removes the folder at `path`, which must be empty.
pub fn remove_folder(path: &Path) -> Result<()> {
    traced(|| fs::remove_dir(path), |()| (format!("remove {}", path.display()), &[]))
}

/// Removes the folder at `path`, if it exists, with everything in it.
pub fn remove_tree(path: &Path) -> Result<()> {
    unless_missing(traced(|| fs::remove_dir_all(path), |()| (format!("remove {}", path.display()), &[])))
}

fn unless_missing(outcome: Result<()>) -> Result<()> {
    outcome.or_else(|e| if e.kind() == ErrorKind::NotFound { Ok(()) } else { Err(e) })
}

/// Creates the folder at `path`, and those above it, if need be, and waits until their names are on the disk: otherwise a power
/// failure could take a folder away with everything that was brought to the disk in it.
pub fn create_folder(path: &Path) -> Result<()> {
    if path.as_os_str().is_empty() || is_folder(path)? {
        return Ok(());
    }
    let above = path.parent().unwrap_or(Path::new(""));
    create_folder(above)?;
    match traced(|| fs::create_dir(path), |()| (format!("folder {}", path.display()), &[])) {
        // Another thread was faster.
        Err(e) if e.kind() == ErrorKind::AlreadyExists && is_folder(path)? => Ok(()),
        outcome => outcome.and_then(|()| match sync_folder(above) {
            // Somebody else's folder: one may create in it, but not open it.
            Err(e) if e.kind() == ErrorKind::PermissionDenied => Ok(()),
            synced => synced,
        }),
    }
}

/// Waits until the names in the folder at `path` are on the disk, on systems that can.
pub fn sync_folder(path: &Path) -> Result<()> {
    OpenFolder::open(path)?.sync()
}

/// A folder that can be synced without opening it again, which could fail.
pub struct OpenFolder {
    path: PathBuf,
    /// `None` on systems that cannot sync a folder.
    handle: Option<File>,
}

impl OpenFolder {
    /// Opens the folder at `path`.
    pub fn open(path: &Path) -> Result<OpenFolder> {
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        let handle = cfg!(unix).then(|| File::open(path)).transpose()?;
        Ok(OpenFolder { path: path.into(), handle })
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Waits until the names in the folder are on the disk.
    pub fn sync(&self) -> Result<()> {
        match &self.handle {
            Some(folder) => traced(|| folder.sync_all(), |()| (format!("sync-folder {}", self.path.display()), &[])),
            None => Ok(()),
        }
    }
}

/// Returns what the system says of what is at `path`, or where a link at `path` leads. `None` if nothing is there.
pub fn metadata(path: &Path) -> Result<Option<Metadata>> {
    unless_nothing(fault::read("stat").and_then(|()| fs::metadata(path)))
}

/// As [`metadata`], of a link itself.
pub fn link_metadata(path: &Path) -> Result<Option<Metadata>> {
    unless_nothing(fault::read("stat").and_then(|()| fs::symlink_metadata(path)))
}

fn unless_nothing(outcome: Result<Metadata>) -> Result<Option<Metadata>> {
    match outcome {
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
        outcome => outcome.map(Some),
    }
}

/// Tells whether something is at `path`.
pub fn exists(path: &Path) -> Result<bool> {
    metadata(path).map(|data| data.is_some())
}

/// Tells whether a folder is at `path`.
pub fn is_folder(path: &Path) -> Result<bool> {
    metadata(path).map(|data| data.is_some_and(|data| data.is_dir()))
}

/// Returns the paths of everything in the folder at `path`; nothing if there is no such folder.
pub fn list(path: &Path) -> Result<Vec<PathBuf>> {
    match fault::read("list").and_then(|()| fs::read_dir(path)) {
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        entries => entries?.map(|entry| entry.map(|entry| entry.path())).collect(),
    }
}

/// Writes to a file from a position on, one piece after the other.
pub struct WriteFrom<F> {
    /// The file.
    pub file: F,
    /// Where the next piece goes, in bytes.
    pub at: u64,
}

impl<F: Borrow<File>> Write for WriteFrom<F> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        write_all_at(self.file.borrow(), bytes, self.at)?;
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
