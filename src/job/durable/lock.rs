//! The lock that keeps a second process out of a job directory.

use crate::disk::WriteFrom;
use crate::{Error, Result, disk};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// A held lock. The system releases it with the process, so a kill leaves nothing to clean up.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Creates the job directory `job` if need be and takes its lock. The lock file also marks the directory as a job's own.
    ///
    /// # Errors
    /// [`Error::Io`] if the directory or the file cannot be made, [`Error::InUse`] if another process holds the lock,
    /// [`Error::Config`] if the directory is not a job directory.
    pub fn take(job: &Path) -> Result<Lock> {
        // A kill can leave an empty directory.
        let is_new = disk::list(job).map_err(Error::io("read", job))?.is_empty();
        disk::create_folder(job).map_err(Error::io("create the directory", job))?;
        let path = lock_file(job);
        if !is_new && !disk::exists(&path).map_err(Error::io("read", &path))? {
            return Err(Error::Config(format!(
                "{} exists and is not a job directory of this program: choose another [output] directory",
                job.display()
            )));
        }
        let mut file = disk::open_or_create(&path).map_err(Error::io("open", &path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                file.read_to_string(&mut holder).map_err(Error::io("read", &path))?;
                return Err(Error::InUse { directory: job.into(), holder });
            }
            // Some network file systems have no locks: there a second job goes unnoticed.
            Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => {
                return Err(Error::io("lock", &path)(e));
            }
            _ => {}
        }
        let process = || write!(WriteFrom { file: &file, at: 0 }, "{}", std::process::id());
        match disk::set_length(&file, 0).and_then(|()| process()) {
            // The lock holds all the same, and this process may be the one that makes room.
            Err(e) if matches!(e.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {}
            outcome => outcome.map_err(Error::io("write", &path))?,
        }
        Ok(Lock { _file: file })
    }
}

/// Returns the path of the lock file of a job directory.
pub fn lock_file(job: &Path) -> PathBuf {
    job.join("lock")
}
