//! Errors about the picture that `[output] color` names.

use std::io::ErrorKind;
use std::path::Path;
use sys::{Error, Result};
use tiff::{TiffError, TiffResult};

/// What is wrong with a picture.
#[derive(Debug)]
pub(crate) enum Trouble {
    /// It cannot be read as it is: a sentence about it.
    Bad(String),
    /// The system or the server did not hand it out.
    Io(std::io::Error),
}

impl Trouble {
    /// Returns the error about the picture called `path`.
    pub(crate) fn about(self, path: &Path) -> Error {
        match self {
            Trouble::Bad(what) => Error::input(path, format!("[output] color: {what}")),
            Trouble::Io(error) => Error::io("read", path)(error),
        }
    }

    /// Says of what is wrong where it was met.
    pub(crate) fn with(self, place: impl std::fmt::Display) -> Trouble {
        match self {
            Trouble::Bad(what) => Trouble::Bad(format!("{place}: {what}")),
            Trouble::Io(error) => Trouble::Io(error),
        }
    }
}

impl From<String> for Trouble {
    fn from(what: String) -> Trouble {
        Trouble::Bad(what)
    }
}

impl From<&str> for Trouble {
    fn from(what: &str) -> Trouble {
        Trouble::Bad(what.into())
    }
}

impl From<std::io::Error> for Trouble {
    fn from(error: std::io::Error) -> Trouble {
        match error.kind() {
            // Of what a file says of itself, and not of the disk.
            ErrorKind::UnexpectedEof | ErrorKind::InvalidData | ErrorKind::InvalidInput => {
                Trouble::Bad(error.to_string())
            }
            _ => Trouble::Io(error),
        }
    }
}

impl From<TiffError> for Trouble {
    fn from(error: TiffError) -> Trouble {
        match error {
            TiffError::IoError(error) => error.into(),
            other => Trouble::Bad(other.to_string()),
        }
    }
}

/// Returns the value of a tag, or none at all where it is missing or of another kind.
pub(crate) fn if_there<T: Default>(found: TiffResult<T>) -> std::result::Result<T, Trouble> {
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
