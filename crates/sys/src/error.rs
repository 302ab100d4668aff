//! Errors: a sentence that a user can act on, and an exit code for each.

use crate::terminal::name;
use std::path::{Path, PathBuf};

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// What errors call the standard output.
pub const STANDARD_OUTPUT: &str = "standard output";

/// Every failure of this crate. `Display` says which file, which record or line, what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused an operation: it may succeed later (exit code 1), or the path itself is wrong (exit code 2).
    #[error("cannot {action} {}: {source}{}", name(path), remedy(path, source))]
    Io {
        /// The operation as a verb: "read", "create", "write".
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// Another process works in the job directory (exit code 1).
    #[error("{} is working in {}: wait for it, or choose another [output] directory", working(holder), name(directory))]
    InUse {
        /// The job directory.
        directory: PathBuf,
        /// Which process it is, on which machine; empty if it has not written it yet.
        holder: String,
    },
    /// A job has not put all its results in place (exit code 1).
    #[error(
        "{}: a job is under way here, or was stopped, so its results are not all in place: run the job again, or wait for it",
        name(directory)
    )]
    Unfinished {
        /// The output directory.
        directory: PathBuf,
    },
    /// A task came before what it needs was done (exit code 1).
    #[error("{0}")]
    TooEarly(String),
    /// Tasks of a phase failed, and have said why (the worst of their exit codes).
    #[error(
        "the phase {phase} is not complete: of {count} tasks these failed: {}; {}",
        list(failed),
        if *code == 1 { "run the same command again to go on" } else { "they have said why" }
    )]
    Tasks {
        /// The phase.
        phase: &'static str,
        /// The numbers of the tasks.
        failed: Vec<u32>,
        /// How many tasks the phase has.
        count: u32,
        /// The worst exit code.
        code: u8,
    },
    /// The job does not fit the memory it was given (exit code 1).
    #[error("not enough memory: {0}")]
    Memory(String),
    /// The scheduler of a cluster refused something, or has something to do first (exit code 1).
    #[error("{0}")]
    Engine(String),
    /// The port to listen on is taken (exit code 1).
    #[error("{0}")]
    Port(String),
    /// The process was asked to stop (exit code 1).
    #[error("interrupted")]
    Interrupted,
    /// A job stopped, and its finished steps are kept (the exit code of `why`).
    #[error("{why}\nfinished steps are kept in {} ({steps}): {}, without --restart, to go on", name(job), again(why))]
    Resumable {
        /// Why the job stopped.
        why: Box<Error>,
        /// The number of finished steps.
        steps: u64,
        /// The job directory.
        job: PathBuf,
    },
    /// The command line or the configuration is wrong (exit code 2).
    #[error("{0}")]
    Config(String),
    /// What was read contradicts the headers, so a job of several parts starts again as one part (exit code 4: no user sees it).
    #[error("what was read contradicts the header of a file")]
    NeedsOnePart,
    /// What an interrupted run left is damaged, so the job starts over (exit code 4: no user sees it).
    #[error("what the interrupted run left is damaged")]
    DamagedSteps,
    /// The mesh has a triangle too long for single precision at the resolution of the job (exit code 2).
    #[error(
        "{what}: set a coarser [input] resolution or narrower bounds, or leave out the classes that are not terrain"
    )]
    TooFine {
        /// Whether the resolution of z is too fine, not that of x and y.
        vertical: bool,
        /// How long the triangle is, and how long it may be.
        what: String,
    },
    /// An input file cannot be used (exit code 3).
    #[error("{}: {what}", name(path))]
    Input {
        /// The input file.
        path: PathBuf,
        /// Which record or line, what is wrong with it and what to do.
        what: String,
    },
    /// The inputs are readable, but they hold nothing to triangulate (exit code 3).
    #[error("{0}")]
    NoTerrain(String),
    /// A guarantee of this program does not hold (exit code 4).
    #[error("internal check failed: {0}; please report this with the configuration and the input")]
    Broken(String),
}

fn working(holder: &str) -> &str {
    if holder.is_empty() { "another process" } else { holder }
}

fn list(numbers: &[u32]) -> String {
    numbers.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

fn again(why: &Error) -> &'static str {
    match why {
        Error::Config(_) => "correct the configuration and run the same command again",
        _ => "run the same command again",
    }
}

/// Returns what a user can do about an error of the operating system, or nothing.
fn remedy(path: &Path, error: &std::io::Error) -> &'static str {
    match error.kind() {
        // What is printed has no directory to choose.
        std::io::ErrorKind::StorageFull if path == Path::new(STANDARD_OUTPUT) => "; make room, and run again",
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            "; make room or choose another [output] directory, and run again"
        }
        std::io::ErrorKind::FileTooLarge => "; raise the limit on the size of files (ulimit -f), and run again",
        std::io::ErrorKind::PermissionDenied => "; check the permissions",
        _ if is_about_the_path(error) => "; correct the path",
        _ if is_shortage_of_files(error) => {
            "; raise the limit on open files (ulimit -n 4096, or LimitNOFILE of a service), or set fewer [limits] \
             threads, and run again"
        }
        _ => "",
    }
}

/// Tells whether the path itself is wrong, so that no retry can help: something else where a folder should be, links in a circle, a name
/// that is too long or that no system has.
fn is_about_the_path(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{AlreadyExists, InvalidFilename, NotADirectory};
    matches!(error.kind(), NotADirectory | InvalidFilename | AlreadyExists) || is_circle_of_links(error)
}

#[cfg(target_os = "linux")]
fn is_circle_of_links(error: &std::io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error())
}

#[cfg(not(target_os = "linux"))]
fn is_circle_of_links(_: &std::io::Error) -> bool {
    false
}

/// Tells whether the process, or the system, has as many files open as it may.
#[cfg(target_os = "linux")]
fn is_shortage_of_files(error: &std::io::Error) -> bool {
    use rustix::io::Errno;
    [Errno::MFILE, Errno::NFILE].iter().any(|shortage| error.raw_os_error() == Some(shortage.raw_os_error()))
}

#[cfg(not(target_os = "linux"))]
fn is_shortage_of_files(_: &std::io::Error) -> bool {
    false
}

impl Error {
    /// Returns the exit code of the process: 1 may be retried, 2 command line or configuration, 3 bad input, 4 a guarantee does not
    /// hold.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Io { source, .. } if is_about_the_path(source) => 2,
            Error::Io { .. }
            | Error::InUse { .. }
            | Error::Unfinished { .. }
            | Error::TooEarly(_)
            | Error::Memory(_)
            | Error::Engine(_)
            | Error::Port(_)
            | Error::Interrupted => 1,
            Error::Resumable { why, .. } => why.exit_code(),
            Error::Tasks { code, .. } => *code,
            Error::Config(_) | Error::TooFine { .. } => 2,
            Error::Input { .. } | Error::NoTerrain(_) => 3,
            Error::Broken(_) | Error::NeedsOnePart | Error::DamagedSteps => 4,
        }
    }

    /// Returns a function for `map_err`: it makes an [`Error::Io`] about doing `action` ("read", "write" ...) to `path`. An error of this
    /// crate that came through a trait of the standard library stays what it is.
    pub fn io(action: &'static str, path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.as_ref().to_path_buf();
        move |source| source.downcast().unwrap_or_else(|source| Error::Io { action, path, source })
    }

    /// Returns the error of a triangulation that was stopped, or that failed: sites are distinct and within reach, so it never should.
    pub fn of_triangulation(is_stopped: bool, error: impl std::fmt::Display) -> Error {
        if is_stopped { Error::Interrupted } else { Error::Broken(error.to_string()) }
    }

    /// Returns an [`Error::Input`]: the file at `path` cannot be used because of `what`.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Error {
        Error::Input { path: path.as_ref().to_path_buf(), what: what.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_write_lines_of_their_own() {
        let error = Error::input("a\nerror: \u{1b}[2J.laz", "is bad");
        assert_eq!(error.to_string(), "a\\nerror: \\u{1b}[2J.laz: is bad");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_shortage_of_open_files_names_its_cure() {
        let shortage = std::io::Error::from_raw_os_error(rustix::io::Errno::MFILE.raw_os_error());
        let error = Error::io("read", "a.laz")(shortage);
        assert!(error.exit_code() == 1 && error.to_string().contains("ulimit -n"), "{error}");
    }
}
