//! Why records cannot be decoded.

use std::io;

/// Why records cannot be decoded.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DecodeError {
    #[error("its data ends before its points do")]
    CutShort,
    #[error("its data cannot have been written by LASzip")]
    Nonsense,
    /// This is not about the data: it cannot be read.
    #[error(transparent)]
    Read(io::Error),
}

impl From<io::Error> for DecodeError {
    fn from(error: io::Error) -> DecodeError {
        match error.kind() {
            io::ErrorKind::UnexpectedEof => DecodeError::CutShort,
            _ => DecodeError::Read(error),
        }
    }
}
