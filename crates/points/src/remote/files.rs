//! Which files of other machines a user means.

use std::path::PathBuf;

use crate::remote::name::public_name;
use crate::remote::{files_at, set_space};
use sys::{Error, Result};

/// Returns the public names of the files that a URL or a public name means: several if it is a pattern in a bucket.
///
/// # Errors
/// [`Error::Config`] if it names none that can be read, [`Error::Io`] if a bucket cannot be listed.
pub fn remote_files(url: &str) -> Result<Vec<PathBuf>> {
    let name = public_name(url).map_err(Error::Config)?;
    Ok(files_at(&name)?.into_iter().map(PathBuf::from).collect())
}

/// Says how many bytes of files of other machines may be in memory before they are needed.
pub fn set_network_memory(bytes: u64) {
    set_space(bytes);
}
