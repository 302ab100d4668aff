//! What can go wrong with a written terrain, beyond what every crate can meet.

use std::path::PathBuf;
use sys::ErrorKind;
use sys::terminal::name;

/// The result of what fails with an error of a written terrain.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a terrain cannot be read, or there is no verdict about it. `Display` says what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What every crate can meet.
    #[error(transparent)]
    System(#[from] sys::Error),
    /// A job has not put all its results in place.
    #[error(
        "{}: a job is under way here, or was stopped, so its results are not all in place: run the job again, or wait for it",
        name(directory)
    )]
    Unfinished {
        /// The output directory.
        directory: PathBuf,
    },
}

impl Error {
    /// Returns what kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::System(error) => error.kind(),
            Error::Unfinished { .. } => ErrorKind::Retry,
        }
    }
}
