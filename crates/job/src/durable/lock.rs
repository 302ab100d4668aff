//! The locks of a job directory: one process has it alone, or the tasks of a job share it.

use crate::{Error, Result};
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};
use sys::disk;
use sys::disk::WriteFrom;

/// A held lock. The system releases it with the process, so a kill leaves nothing to clean up.
#[derive(Debug)]
pub struct Lock {
    _file: File,
    is_real: bool,
}

/// A process that was killed may hold its lock for so long, while the system takes its memory back.
const DYING: Duration = Duration::from_secs(1);

/// Between two tries to take a lock.
const BETWEEN_TRIES: Duration = Duration::from_millis(50);

/// What the lock file says while tasks share the lock.
const TASKS: &str = "another task of this job";

impl Lock {
    /// Creates the job directory `job` if need be and takes its lock. The lock file also marks the directory as a job's own.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the directory or the file cannot be made, [`Error::InUse`] if another process holds the lock,
    /// [`sys::Error::Config`] if the directory is not a job directory.
    pub fn take(job: &Path) -> Result<Lock> {
        // A kill can leave an empty directory.
        let is_new = disk::list(job).map_err(sys::Error::io("read", job))?.is_empty();
        let path = lock_file(job);
        if !is_new && !disk::exists(&path).map_err(sys::Error::io("read", &path))? {
            return Err(sys::Error::Config(format!(
                "{} exists and is not a job directory of this program: choose another [output] directory",
                job.display()
            ))
            .into());
        }
        let begun = Instant::now();
        loop {
            match Lock::take_within(job) {
                Err(Error::InUse { .. }) if begun.elapsed() < DYING => thread::sleep(BETWEEN_TRIES),
                outcome => return outcome,
            }
        }
    }

    /// Creates the folder `job` within a job directory if need be and takes its lock. Whatever is there is the job's own: a power failure
    /// may have left other files and lost the lock file.
    ///
    /// # Errors
    /// As [`Lock::take`].
    pub fn take_within(job: &Path) -> Result<Lock> {
        disk::create_folder(job).map_err(sys::Error::io("create the directory", job))?;
        let path = lock_file(job);
        let file = disk::open_or_create(&path).map_err(sys::Error::io("open", &path))?;
        let is_real = is_held(file.try_lock(), &file, job)?;
        say_who(&file, &path, &this_process())?;
        Ok(Lock { _file: file, is_real })
    }

    /// Shares the lock of the job directory `job`, which must be there, with other tasks of the job.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the file cannot be opened, [`Error::InUse`] if a process has it alone.
    pub fn share(job: &Path) -> Result<Lock> {
        let path = lock_file(job);
        let mut file = disk::open(&path).map_err(sys::Error::io("open", &path))?;
        let is_real = is_held(file.try_lock_shared(), &file, job)?;
        // All tasks write the same, and only the first has to.
        if holder(&mut file).map_err(sys::Error::io("read", &path))? != TASKS {
            say_who(&file, &path, TASKS)?;
        }
        Ok(Lock { _file: file, is_real })
    }

    /// Tells whether the file system has locks. Where it has none, a second process goes unnoticed.
    pub fn is_real(&self) -> bool {
        self.is_real
    }
}

/// Tells whether the lock is held, or the file system has none.
fn is_held(outcome: std::result::Result<(), TryLockError>, mut file: &File, job: &Path) -> Result<bool> {
    let path = lock_file(job);
    match outcome {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => {
            let holder = holder(&mut file).map_err(sys::Error::io("read", &path))?;
            Err(Error::InUse { directory: job.into(), holder })
        }
        Err(TryLockError::Error(e)) if has_no_locks(&e) => Ok(false),
        Err(TryLockError::Error(e)) => Err(sys::Error::io("lock", &path)(e).into()),
    }
}

fn holder(file: &mut impl Read) -> io::Result<String> {
    let mut holder = String::new();
    file.read_to_string(&mut holder).map(|_| holder)
}

/// Tells whether the file system has no locks, as some network file systems.
#[cfg(target_os = "linux")]
fn has_no_locks(error: &io::Error) -> bool {
    error.kind() == ErrorKind::Unsupported || error.raw_os_error() == Some(rustix::io::Errno::NOLCK.raw_os_error())
}

#[cfg(not(target_os = "linux"))]
fn has_no_locks(error: &io::Error) -> bool {
    error.kind() == ErrorKind::Unsupported
}

/// Writes down who has the lock, for the message to others.
fn say_who(file: &File, path: &Path, who: &str) -> sys::Result<()> {
    match disk::set_length(file, 0).and_then(|()| write!(WriteFrom { file, at: 0 }, "{who}")) {
        // The lock holds all the same, and this process may be the one that makes room.
        Err(e) if matches!(e.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => Ok(()),
        outcome => outcome.map_err(sys::Error::io("write", path)),
    }
}

/// Returns what tells this process from others, on other machines too.
fn this_process() -> String {
    let variable = |name: &str| std::env::var(name).ok().filter(|text| !text.is_empty());
    let host = host_name().or_else(|| variable("HOSTNAME")).unwrap_or_else(|| "this machine".into());
    let job = variable("SLURM_JOB_ID").or_else(|| variable("AWS_BATCH_JOB_ID"));
    let job = job.map(|job| format!(", job {job}")).unwrap_or_default();
    format!("process {} on {host}{job}", std::process::id())
}

#[cfg(target_os = "linux")]
fn host_name() -> Option<String> {
    rustix::system::uname().nodename().to_str().ok().map(str::to_owned)
}

#[cfg(not(target_os = "linux"))]
fn host_name() -> Option<String> {
    None
}

/// Returns the path of the lock file of a job directory.
pub fn lock_file(job: &Path) -> PathBuf {
    job.join("lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_share_what_one_process_may_have_alone() {
        let folder = tempfile::tempdir().unwrap();
        let job = folder.path().join("job");
        assert!(Lock::share(&job).is_err() && !job.exists(), "a task makes no job");
        let alone = Lock::take(&job).unwrap();
        let refused = Lock::share(&job).unwrap_err().to_string();
        assert!(refused.contains(&format!("process {} on", std::process::id())), "{refused}");
        drop(alone);
        let tasks = [Lock::share(&job).unwrap(), Lock::share(&job).unwrap()];
        let refused = Lock::take(&job).unwrap_err();
        assert!(
            refused.to_string().contains("task of this job") && refused.kind() == sys::ErrorKind::Retry,
            "{refused}"
        );
        drop(tasks);
        Lock::take(&job).unwrap();
    }
}
