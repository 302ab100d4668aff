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
    /// A job stopped, and its complete phases are kept.
    #[error(
        "{why}\nwhat is done is kept in {} (phases complete: {phases}): {}, without --restart, to continue",
        name(job),
        again(why)
    )]
    Resumable {
        /// Why the job stopped.
        why: Box<Error>,
        /// The number of complete phases.
        phases: u64,
        /// The job directory.
        job: PathBuf,
    },
    /// What was read is other than the plan claims: a header is wrong, or a file bad that is to be left out. All inputs are measured, and the
    /// job starts again. A user sees this only if an input changes in between.
    #[error("an input changed while the job read it: run again")]
    OtherThanClaimed {
        /// Whether a file is bad, not a header wrong.
        is_bad_file: bool,
    },
    /// These inputs proved bad when all were measured, each for a reason, and the job is planned without them. No user sees this.
    #[error("{} inputs are bad", .0.len())]
    BadInputs(Vec<(PathBuf, String)>),
    /// What an interrupted run left is damaged, so the job starts over, or tasks say so. No user sees this.
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
            Error::InUse { .. } | Error::TooEarly(_) | Error::OtherThanClaimed { .. } => ErrorKind::Retry,
            Error::Resumable { why, .. } => why.kind(),
            Error::TooFine { .. } => ErrorKind::Usage,
            Error::NoTerrain(_) => ErrorKind::Input,
            Error::BadInputs(_) | Error::DamagedSteps => ErrorKind::Internal,
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
