//! Removing what only the steps need, at the end of a job.
//!
//! A kill may come at any time. While the journal is there, it says that the job is complete. After that the report in the results does:
//! what is left has neither a journal nor a note.

use crate::durable::atomic_file::{remove_file, remove_tree, sync_folder};
use crate::durable::directory::JobDirectory;
use crate::durable::listing::{entries, is_folder};
use crate::durable::lock::lock_file;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use sys::{Error, Result, disk, fault};

/// Removes everything in the job directory, which this process has locked.
///
/// # Errors
/// [`Error::Io`] if a file cannot be removed.
pub fn remove_job(directory: &JobDirectory) -> Result<()> {
    let (job, lock) = (directory.job(), lock_file(directory.job()));
    let last = [directory.plan(), directory.journal()];
    // Notes go first: without the journal, they would say that the job is still to be done.
    for path in entries(job)? {
        if path != lock && !last.contains(&path) && !is_folder(&path)? {
            remove(&path)?;
        }
    }
    sync_folder(job)?;
    // In parallel, because the system takes a while to free the cache of large files.
    let parts = [entries(&directory.parts())?, entries(&directory.points_by_part())?].concat();
    let files = parts.iter().map(|part| entries(part)).collect::<Result<Vec<_>>>()?.concat();
    files.par_iter().try_for_each(|file| remove(file))?;
    last.iter().try_for_each(|file| remove(file))?;
    for folder in [directory.output().directory(), &directory.parts(), &directory.points_by_part(), job] {
        entries(folder)?.iter().try_for_each(|path| remove_folder(path))?;
    }
    // The lock goes last, because it marks the directory as a job's own: a kill or a power failure before that leaves what the
    // next job may take.
    sync_folder(job)?;
    match disk::remove_tree(job) {
        // This process still has the lock. The folder is empty when it ends, and the next job takes an empty one.
        Err(_) if only_open_files_are_left(job) => Ok(()),
        outcome => outcome.map_err(Error::io("remove", job)),
    }
}

/// Removes the folder at `path`, if it is one, with everything in it.
fn remove_folder(path: &Path) -> Result<()> {
    if is_folder(path)? {
        remove_tree(path)?;
        fault::point("cleaning");
    }
    Ok(())
}

fn remove(file: &Path) -> Result<()> {
    remove_file(file)?;
    fault::point("cleaning");
    Ok(())
}

/// Tells whether nothing is left in `folder` but files that were removed while a process had them open: NFS keeps them until they are
/// closed, under names of its own.
fn only_open_files_are_left(folder: &Path) -> bool {
    let is_open = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".nfs"));
    disk::list(folder).is_ok_and(|left| !left.is_empty() && left.iter().all(is_open))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn files_that_nfs_keeps_while_they_are_open_are_told_from_others() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!only_open_files_are_left(folder.path()));
        fs::write(folder.path().join(".nfs0000000001c6a1f200000001"), "").unwrap();
        assert!(only_open_files_are_left(folder.path()));
        fs::write(folder.path().join("lock"), "").unwrap();
        assert!(!only_open_files_are_left(folder.path()));
    }
}
