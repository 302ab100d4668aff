//! The errors of the program: those of the libraries, and its own. Each ends the program with an exit code.

use crate::exit_code::exit_code;
use sys::ErrorKind;

/// The result of what fails with an error of the program.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a command failed. `Display` says what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What every crate can meet.
    #[error(transparent)]
    System(#[from] sys::Error),
    /// A job failed.
    #[error(transparent)]
    Job(#[from] job::Error),
    /// There is no verdict about results.
    #[error(transparent)]
    Verify(#[from] verify::Error),
    /// Tasks of a phase failed, and have said why.
    #[error(
        "the phase {phase} is not complete: of {count} tasks these failed: {}; {}",
        list(failed),
        if *code == exit_code(ErrorKind::Retry) { "run the same command again to continue" } else { "see their messages" }
    )]
    Tasks {
        /// The phase.
        phase: &'static str,
        /// The numbers of the tasks.
        failed: Vec<u32>,
        /// How many tasks the phase has.
        count: u32,
        /// The worst of their exit codes.
        code: u8,
    },
    /// The scheduler of a cluster refused something, or has something to do first.
    #[error("{0}")]
    Engine(String),
    /// The port to listen on is taken.
    #[error("{0}")]
    Port(String),
}

impl Error {
    /// Returns the exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::System(error) => exit_code(error.kind()),
            Error::Job(error) => exit_code(error.kind()),
            Error::Verify(error) => exit_code(error.kind()),
            Error::Tasks { code, .. } => *code,
            Error::Engine(_) | Error::Port(_) => exit_code(ErrorKind::Retry),
        }
    }
}

fn list(numbers: &[u32]) -> String {
    numbers.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}
