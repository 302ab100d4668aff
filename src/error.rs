//! What can go wrong, in sentences a user can act on, and the exit code of each.

use std::path::{Path, PathBuf};

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Every failure of a job. `Display` gives a full sentence: which file, which record or line, what is wrong, what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused something that may succeed later (exit code 1).
    #[error("cannot {action} {}: {source}{}", path.display(), remedy(source))]
    Io {
        /// What was tried, as a verb: "read", "create", "write".
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Another process works in the job directory (exit code 1).
    #[error("{} is working in {}: wait for it, or choose another [output] directory", process(holder), directory.display())]
    InUse {
        /// The job directory.
        directory: PathBuf,
        /// The process id of the holder; empty if it has not said so yet.
        holder: String,
    },
    /// The job does not fit the memory it was given (exit code 1).
    #[error("not enough memory: {0}")]
    Memory(String),
    /// The process was asked to stop (exit code 1).
    #[error("interrupted")]
    Interrupted,
    /// A job stopped, and what it has finished is kept (exit code as of the reason).
    #[error("{why}\nfinished steps are kept in {} ({steps}): run the same command again to go on", job.display())]
    Resumable {
        /// Why it stopped.
        why: Box<Error>,
        /// How many steps are finished.
        steps: u64,
        /// The job directory.
        job: PathBuf,
    },
    /// The command line or the configuration is wrong (exit code 2).
    #[error("{0}")]
    Config(String),
    /// The mesh has a triangle too long for single precision at the resolution of the job (exit code 2).
    #[error("{what}: set a coarser [input] resolution, narrower bounds, or leave out the classes that are no terrain")]
    TooFine {
        /// Whether the resolution of z is meant, not that of x and y.
        vertical: bool,
        /// How long it is, and what would fit.
        what: String,
    },
    /// An input file cannot be used (exit code 3).
    #[error("{}: {what}", path.display())]
    Input {
        /// The input file.
        path: PathBuf,
        /// The record or line, what is wrong with it and what to do.
        what: String,
    },
    /// The inputs are readable, but there is nothing to triangulate in them (exit code 3).
    #[error("{0}")]
    NoTerrain(String),
    /// Something this program guarantees does not hold (exit code 4).
    #[error("internal check failed: {0}; please report this with the configuration and the input")]
    Broken(String),
}

fn process(holder: &str) -> String {
    if holder.is_empty() { "another process".into() } else { format!("process {holder}") }
}

/// What to do about a failure of the operating system, where something can be said.
fn remedy(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            "; make room or choose another [output] directory, and run again"
        }
        std::io::ErrorKind::FileTooLarge => "; raise the limit on the size of files (ulimit -f), and run again",
        std::io::ErrorKind::PermissionDenied => "; check who may read and write there",
        _ => "",
    }
}

impl Error {
    /// The process exit code: 1 may be retried, 2 usage or configuration, 3 bad input, 4 internal invariant broken.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Io { .. } | Error::InUse { .. } | Error::Memory(_) | Error::Interrupted => 1,
            Error::Resumable { why, .. } => why.exit_code(),
            Error::Config(_) | Error::TooFine { .. } => 2,
            Error::Input { .. } | Error::NoTerrain(_) => 3,
            Error::Broken(_) => 4,
        }
    }

    /// An I/O failure while doing `action` ("read", "write" ...) to `path`; for `map_err`.
    pub fn io(action: &'static str, path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.as_ref().to_path_buf();
        move |source| Error::Io { action, path, source }
    }

    /// An input file that cannot be used, and why.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Error {
        Error::Input { path: path.as_ref().to_path_buf(), what: what.into() }
    }
}
