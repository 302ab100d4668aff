//! What stands for files of other machines in a program without the feature `remote`: nothing, and a sentence that says so.

use std::io;
use std::ops::Range;
use std::path::Path;

use sys::{Error, Result};

/// A file that cannot be there.
pub(crate) enum HeldFile {}

/// A stream that cannot be there.
pub(crate) enum RemoteStream {}

fn not_built_in(name: &Path) -> Error {
    Error::Config(format!(
        "{}: this build of gdt-batch cannot read URLs: build it with the feature `remote` (on by default), or download the file",
        name.display()
    ))
}

impl HeldFile {
    pub(crate) fn open(name: &Path) -> Result<HeldFile> {
        Err(not_built_in(name))
    }

    pub(crate) fn size(&self) -> u64 {
        match *self {}
    }

    pub(crate) fn doubt(&self) -> Option<&'static str> {
        match *self {}
    }

    pub(crate) fn expect(&self, _: Vec<Range<u64>>) {
        match *self {}
    }

    pub(crate) fn hold(&self, _: &[Range<u64>]) -> Result<()> {
        match *self {}
    }

    pub(crate) fn read_exact_at(&self, _: &mut [u8], _: u64) -> Result<()> {
        match *self {}
    }

    pub(crate) fn stream(&self, _: Range<u64>) -> RemoteStream {
        match *self {}
    }
}

/// The bytes of a file that cannot be there.
#[derive(Clone)]
pub(crate) enum WholeFile {}

impl WholeFile {
    pub(crate) fn bytes(&self) -> &[u8] {
        match *self {}
    }

    pub(crate) fn read_at(&self, _: &mut [u8], _: u64) -> io::Result<usize> {
        match *self {}
    }
}

/// A file that is read whole.
pub(crate) struct WholeRequest<'a> {
    name: &'a Path,
}

impl<'a> WholeRequest<'a> {
    pub(crate) fn new(name: &'a Path, _: &'a str, _: u64, _: u64) -> WholeRequest<'a> {
        WholeRequest { name }
    }

    pub(crate) fn expect(&self) {}

    pub(crate) fn prepare(&self) {}

    pub(crate) fn fetch(&self, _: bool) -> Result<Option<WholeFile>> {
        Err(not_built_in(self.name))
    }
}

pub(crate) fn forget_whole_files() {}

impl RemoteStream {
    pub(crate) fn read_at(&mut self, _: &mut [u8], _: u64) -> io::Result<usize> {
        match *self {}
    }
}

/// Returns the size of a file and a number that tells its content from others.
///
/// # Errors
/// [`Error::Config`].
pub(crate) fn identity(name: &Path) -> Result<(u64, u64)> {
    Err(not_built_in(name))
}

/// Returns the files that a public name means.
///
/// # Errors
/// [`Error::Config`].
pub(crate) fn files_at(name: &str) -> Result<Vec<String>> {
    Err(not_built_in(name.as_ref()))
}

pub(crate) fn to_hold(ranges: impl Iterator<Item = Range<u64>>) -> Vec<Range<u64>> {
    ranges.collect()
}

pub(crate) fn set_space(_: u64) {}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    #[test]
    fn the_refusal_says_how_to_get_the_feature() {
        let Err(error) = HeldFile::open(Path::new("https://host/a.laz"));
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("https://host/a.laz: this build of gdt-batch cannot read URLs"), "{error}");
        assert_eq!(files_at("s3://bucket/*.laz").unwrap_err().kind(), ErrorKind::Usage);
    }
}
