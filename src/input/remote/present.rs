//! What identifies a file of another machine.

use std::path::Path;

use crate::Result;
use crate::input::remote::file::RemoteFile;

/// Returns the size of a file and a number that tells its content from others. Asks the server what it has now.
///
/// # Errors
/// As [`RemoteFile::look`].
pub(crate) fn identity(name: &Path) -> Result<(u64, u64)> {
    RemoteFile::look(name).map(|file| (file.size(), file.hash()))
}
