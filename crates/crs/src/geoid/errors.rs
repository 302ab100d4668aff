//! Errors about `[output] height_offset`.

use std::io::ErrorKind;
use std::path::Path;
use sys::Error;

/// Returns the error about a grid that cannot be opened.
pub fn not_opened(path: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::NotFound => refused(&format!("there is no file {}: correct its name", path.display())),
        _ => Error::io("read", path)(error),
    }
}

/// Returns the error about a file that cannot be used.
pub(super) fn bad_file(path: &Path, what: impl std::fmt::Display) -> Error {
    refused(&format!("{}: {what}", path.display()))
}

/// Returns the error about the option.
pub(super) fn refused(what: &str) -> Error {
    Error::Config(format!("[output] height_offset: {what}"))
}
