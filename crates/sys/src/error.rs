//! The errors that every crate can meet. Crates with errors of their own wrap these. An error is a sentence that a user can act on; its
//! kind tells a program what to do.

use crate::terminal::name;
use std::path::{Path, PathBuf};

/// The result of everything that fails only with these errors.
pub type Result<T> = std::result::Result<T, Error>;

/// What kind of failure an error is: what a script, a scheduler or a user can do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The same may succeed if it is repeated.
    Retry,
    /// The command line or the configuration is wrong.
    Usage,
    /// An input cannot be used.
    Input,
    /// A guarantee of the program does not hold.
    Internal,
}

/// What errors call the standard output.
pub const STANDARD_OUTPUT: &str = "standard output";

/// What every crate can meet. `Display` says which file, which record or line, what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused an operation: it may succeed later, or the path itself is wrong.
    #[error("cannot {action} {}: {source}{}", name(path), remedy(path, source))]
    Io {
        /// The operation as a verb: "read", "create", "write".
        action: &'static str,
        /// The file or directory.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The job does not fit the memory it was given.
    #[error("not enough memory: {0}")]
    Memory(String),
    /// The process was asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The command line or the configuration is wrong.
    #[error("{0}")]
    Config(String),
    /// An input file cannot be used.
    #[error("{}: {what}", name(path))]
    Input {
        /// The input file.
        path: PathBuf,
        /// Which record or line, what is wrong with it and what to do.
        what: String,
    },
    /// A guarantee of this program does not hold.
    #[error("internal check failed: {0}; please report this with the configuration and the input")]
    Broken(String),
}

/// Returns what a user can do about an error of the operating system, or nothing.
fn remedy(path: &Path, error: &std::io::Error) -> &'static str {
    match error.kind() {
        // What is printed has no directory to choose.
        std::io::ErrorKind::StorageFull if path == Path::new(STANDARD_OUTPUT) => "; free some space, and run again",
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            "; free some space or choose another [output] directory, and run again"
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
    /// Returns what kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Io { source, .. } if is_about_the_path(source) => ErrorKind::Usage,
            Error::Io { .. } | Error::Memory(_) | Error::Interrupted => ErrorKind::Retry,
            Error::Config(_) => ErrorKind::Usage,
            Error::Input { .. } => ErrorKind::Input,
            Error::Broken(_) => ErrorKind::Internal,
        }
    }

    /// Returns a function for `map_err`: it makes an [`Error::Io`] about doing `action` ("read", "write" ...) to `path`. An error of
    /// this type that came through a trait of the standard library stays what it is.
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
        assert!(error.kind() == ErrorKind::Retry && error.to_string().contains("ulimit -n"), "{error}");
    }
}
