//! Errors about the picture that `[output] color` names.

use std::io::ErrorKind;
use std::path::Path;
use sys::{Error, Result};
use tiff::{TiffError, TiffResult};

/// What is wrong with a picture.
#[derive(Debug)]
pub(crate) enum PhotoError {
    /// It cannot be read as it is: a sentence about it.
    Bad(String),
    /// The system or the server did not hand it out.
    Io(std::io::Error),
}

impl PhotoError {
    /// Returns the error about the picture called `path`.
    pub(crate) fn about(self, path: &Path) -> Error {
        match self {
            PhotoError::Bad(what) => Error::input(path, format!("[output] color: {what}")),
            PhotoError::Io(error) => Error::io("read", path)(error),
        }
    }

    /// Returns the error with `place` in front of its sentence.
    pub(crate) fn with(self, place: impl std::fmt::Display) -> PhotoError {
        match self {
            PhotoError::Bad(what) => PhotoError::Bad(format!("{place}: {what}")),
            PhotoError::Io(error) => PhotoError::Io(error),
        }
    }
}

impl From<String> for PhotoError {
    fn from(what: String) -> PhotoError {
        PhotoError::Bad(what)
    }
}

impl From<&str> for PhotoError {
    fn from(what: &str) -> PhotoError {
        PhotoError::Bad(what.into())
    }
}

impl From<std::io::Error> for PhotoError {
    fn from(error: std::io::Error) -> PhotoError {
        match error.kind() {
            // The file is to blame for these, not the disk.
            ErrorKind::UnexpectedEof | ErrorKind::InvalidData | ErrorKind::InvalidInput => {
                PhotoError::Bad(error.to_string())
            }
            _ => PhotoError::Io(error),
        }
    }
}

impl From<TiffError> for PhotoError {
    fn from(error: TiffError) -> PhotoError {
        match error {
            TiffError::IoError(error) => error.into(),
            other => PhotoError::Bad(other.to_string()),
        }
    }
}

/// Returns the value of a tag, or none at all where it is missing or of another kind.
pub(crate) fn if_there<T: Default>(found: TiffResult<T>) -> std::result::Result<T, PhotoError> {
    match found {
        Err(TiffError::IoError(error)) => Err(error.into()),
        found => Ok(found.unwrap_or_default()),
    }
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
