//! Files that appear under their name only when they are whole and on the disk.
//!
//! A step writes a file under its partial name ([`write_pending`]). [`publish`] brings it to the disk and then renames it.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::ScopedJoinHandle;
use sys::disk::WriteFrom;
use sys::{Error, Result, disk};
use tiles::checksums::Checksum;
use xxhash_rust::xxh3::Xxh3;

/// A file that a step has written under its [`partial_path`], until [`publish`] gives it its name.
#[derive(Clone, Debug)]
pub struct PendingFile {
    /// Its final path.
    pub path: PathBuf,
    /// Its size in bytes.
    pub bytes: u64,
    /// The checksum of its content.
    pub checksum: Checksum,
}

/// Writes `content` under the [`partial_path`] of `path`.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_pending(path: &Path, content: &[u8]) -> Result<PendingFile> {
    write_pending_pieces(path, &[content])
}

/// Writes the concatenated `pieces` under the [`partial_path`] of `path`.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_pending_pieces(path: &Path, pieces: &[&[u8]]) -> Result<PendingFile> {
    let mut writer = PendingWriter::create(path)?;
    pieces.iter().try_for_each(|piece| writer.write(piece))?;
    writer.finish()
}

/// Writes a pending file, one piece after the other.
pub struct PendingWriter {
    path: PathBuf,
    partial: PathBuf,
    writer: BufWriter<WriteFrom<File>>,
    hasher: Xxh3,
    bytes: u64,
}

/// The system begins at once to bring files of so many bytes or more to the disk. So little is left to wait for at the end of a job.
const WORTH_BEGINNING: u64 = 256 << 10;

impl PendingWriter {
    /// Creates the pending file of `path`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(path: &Path) -> Result<PendingWriter> {
        const BUFFER: usize = 1 << 20;
        let partial = partial_path(path);
        let file = disk::create(&partial).map_err(Error::io("write", &partial))?;
        let writer = BufWriter::with_capacity(BUFFER, WriteFrom { file, at: 0 });
        Ok(PendingWriter { path: path.into(), partial, writer, hasher: Xxh3::new(), bytes: 0 })
    }

    /// Appends a piece.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&mut self, piece: &[u8]) -> Result<()> {
        self.hasher.update(piece);
        self.bytes += piece.len() as u64;
        self.writer.write_all(piece).map_err(Error::io("write", &self.partial))
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<PendingFile> {
        self.writer.flush().map_err(Error::io("write", &self.partial))?;
        if self.bytes >= WORTH_BEGINNING {
            disk::begin_sync(&self.writer.get_ref().file);
        }
        Ok(PendingFile { path: self.path, bytes: self.bytes, checksum: Checksum::of_hasher(&self.hasher) })
    }
}

/// Returns the pending file of `path` when something else has written it under its [`partial_path`].
///
/// # Errors
/// [`Error::Io`] if the file cannot be read.
pub fn find_pending(path: &Path) -> Result<PendingFile> {
    let partial = partial_path(path);
    let (bytes, checksum) = Checksum::of_file(&partial).map_err(Error::io("read", &partial))?;
    Ok(PendingFile { path: path.into(), bytes, checksum })
}

/// Returns the name under which the file at `path` waits until it is whole.
pub fn partial_path(path: &Path) -> PathBuf {
    // A world file has the name of its picture but for the ending, and others that of the scene of all tiles.
    const SAME_NAMES: [&str; 7] = ["pgw", "tif", "pmtiles", "xml", "dxf", "obj", "ply"];
    let ending = path.extension().and_then(|ending| SAME_NAMES.into_iter().find(|same| ending == *same));
    match ending {
        Some(ending) => path.with_extension(format!("{ending}.partial")),
        None => path.with_extension("partial"),
    }
}

/// How many threads wait for the disk at the same time.
const PARALLEL_SYNCS: usize = 8;

/// Gives pending files their names. A file is on the disk before its name is, and all names are on the disk before this returns.
///
/// # Errors
/// [`Error::Io`] if a file cannot be synced or renamed.
pub fn publish(paths: &[PathBuf]) -> Result<()> {
    sync_partial_files(paths)?;
    for path in paths {
        disk::rename(&partial_path(path), path).map_err(Error::io("rename the finished file to", path))?;
    }
    let folders: BTreeSet<&Path> = paths.iter().filter_map(|path| path.parent()).collect();
    folders.into_iter().try_for_each(sync_folder)
}

/// Brings pending files to the disk on several threads: overlapping waits take little longer than one.
fn sync_partial_files(paths: &[PathBuf]) -> Result<()> {
    let next = AtomicUsize::new(0);
    let left = || paths.get(next.fetch_add(1, Ordering::Relaxed));
    let sync = || std::iter::from_fn(left).try_for_each(|path| sync_file(&partial_path(path)));
    std::thread::scope(|scope| {
        // If a thread cannot be started, the others do its share.
        let start = |_| std::thread::Builder::new().spawn_scoped(scope, sync).ok();
        let others: Vec<_> = (1..PARALLEL_SYNCS.min(paths.len())).filter_map(start).collect();
        let join = |other: ScopedJoinHandle<_>| other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        others.into_iter().map(join).fold(sync(), Result::and)
    })
}

fn sync_file(path: &Path) -> Result<()> {
    let file = disk::open(path).map_err(Error::io("open", path))?;
    disk::sync(&file).map_err(Error::io("write", path))
}

/// Brings the names in `folder` to the disk.
///
/// # Errors
/// [`Error::Io`] if that fails.
pub fn sync_folder(folder: &Path) -> Result<()> {
    disk::sync_folder(folder).map_err(Error::io("write", folder))
}

/// Creates the folder at `path`, and those above it, if need be.
///
/// # Errors
/// [`Error::Io`] if it cannot be made.
pub fn create_folder(path: &Path) -> Result<()> {
    disk::create_folder(path).map_err(Error::io("create the directory", path))
}

/// Creates the folder that the file at `path` is to be in, and those above it, if need be.
///
/// # Errors
/// [`Error::Io`] if it cannot be made.
pub fn create_folder_of(path: &Path) -> Result<()> {
    path.parent().map_or(Ok(()), create_folder)
}

/// Removes the folder at `path`, if it exists, with everything in it.
///
/// # Errors
/// [`Error::Io`] if it cannot be removed.
pub fn remove_tree(path: &Path) -> Result<()> {
    disk::remove_tree(path).map_err(Error::io("remove", path))
}

/// Removes the file at `path` if it exists.
///
/// # Errors
/// [`Error::Io`] if it cannot be removed.
pub fn remove_file(path: &Path) -> Result<()> {
    disk::remove_file(path).map_err(Error::io("remove", path))
}
