//! Errors about the file that `[output] color` names.

use std::io::ErrorKind;
use std::path::Path;
use sys::{Error, Result};

/// Returns the error about a file that is no orthophoto that can be read.
pub(crate) fn bad_photo(path: &Path, what: impl std::fmt::Display) -> Error {
    Error::input(path, format!("[output] color: {what}"))
}

/// Checks that there is a file at `path`.
///
/// # Errors
/// [`Error::Config`] if there is none, or a folder; [`Error::Io`] if the system does not tell.
pub fn require_file(path: &Path) -> Result<()> {
    match path.metadata() {
        Ok(found) if found.is_file() => Ok(()),
        Ok(_) => Err(Error::Config(format!("[output] color: {} is not a file: name one GeoTIFF", path.display()))),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            Err(Error::Config(format!("[output] color: there is no file {}: correct its name", path.display())))
        }
        Err(error) => Err(Error::io("read", path)(error)),
    }
}
