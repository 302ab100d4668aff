//! What can go wrong with a job, beyond what every crate can meet.

use std::path::PathBuf;
use sys::ErrorKind;
use sys::terminal::name;

/// The result of what fails with an error of the job.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a job, or one of its tasks, failed. `Display` says what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What every crate can meet.
    #[error(transparent)]
    System(#[from] sys::Error),
    /// Another process works in the job directory.
    #[error("{} is working in {}: wait for it, or choose another [output] directory", working(holder), name(directory))]
    InUse {
        /// The job directory.
        directory: PathBuf,
        /// Which process it is, on which machine; empty if it has not written it yet.
        holder: String,
    },
    /// A task came before what it needs was done.
    #[error("{0}")]
    TooEarly(String),
    /// A job stopped, and its finished steps are kept.
    #[error("{why}\nfinished steps are kept in {} ({steps}): {}, without --restart, to go on", name(job), again(why))]
    Resumable {
        /// Why the job stopped.
        why: Box<Error>,
        /// The number of finished steps.
        steps: u64,
        /// The job directory.
        job: PathBuf,
    },
    /// What was read contradicts the headers, so a job of several parts starts again as one part. No user sees this.
    #[error("what was read contradicts the header of a file")]
    NeedsOnePart,
    /// What an interrupted run left is damaged, so the job starts over. No user sees this.
    #[error("what the interrupted run left is damaged")]
    DamagedSteps,
    /// The mesh has a triangle too long for single precision at the resolution of the job.
    #[error(
        "{what}: set a coarser [input] resolution or narrower bounds, or leave out the classes that are not terrain"
    )]
    TooFine {
        /// Whether the resolution of z is too fine, not that of x and y.
        vertical: bool,
        /// How long the triangle is, and how long it may be.
        what: String,
    },
    /// The inputs are readable, but they hold nothing to triangulate.
    #[error("{0}")]
    NoTerrain(String),
}

impl Error {
    /// Returns what kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::System(error) => error.kind(),
            Error::InUse { .. } | Error::TooEarly(_) => ErrorKind::Retry,
            Error::Resumable { why, .. } => why.kind(),
            Error::TooFine { .. } => ErrorKind::Usage,
            Error::NoTerrain(_) => ErrorKind::Input,
            Error::NeedsOnePart | Error::DamagedSteps => ErrorKind::Internal,
        }
    }
}

fn working(holder: &str) -> &str {
    if holder.is_empty() { "another process" } else { holder }
}

fn again(why: &Error) -> &'static str {
    match why {
        Error::System(sys::Error::Config(_)) => "correct the configuration and run the same command again",
        _ => "run the same command again",
    }
}
