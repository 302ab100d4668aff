//! Reading the files of an EPT that are beside its index.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use crate::ept::key::NodeKey;
use crate::ept::name::page_name;
use crate::file::random_access::RandomAccessFile;
use crate::remote::name::{address, is_remote};
use crate::remote::places::{beside, name_beside};
use crate::remote::{WholeFile, WholeRequest};
use sys::{Error, Result, fault};

/// The most bytes of a file that is held in memory. Nodes and pages have less than a hundredth.
pub(crate) const LARGEST: u64 = 1 << 28;

/// About so many bytes has a page.
const PAGE: u64 = 1 << 16;

/// A file beside the index.
pub(crate) struct SideFile {
    /// Its path, or its public name without a query.
    pub(crate) path: PathBuf,
    /// Its whole URL; `None` for a file of this machine.
    url: Option<String>,
    /// About so many bytes it has.
    about: u64,
}

/// The bytes of a file.
pub(crate) enum Bytes {
    Local(Vec<u8>),
    Remote(WholeFile),
}

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        match self {
            Bytes::Local(bytes) => bytes,
            Bytes::Remote(file) => file.bytes(),
        }
    }
}

impl SideFile {
    /// Returns the file of this relative name beside the index at `index`.
    ///
    /// # Errors
    /// [`Error::Config`] if nobody knows the query of the index.
    pub(crate) fn new(index: &Path, name: &str, about: u64) -> Result<SideFile> {
        let url = match is_remote(index) {
            true => Some(beside(&address(&index.to_string_lossy())?, name)),
            false => None,
        };
        Ok(SideFile { path: name_beside(index, name), url, about })
    }

    /// Says that the file will be read once more, and not again.
    pub(crate) fn expect(&self) {
        self.request().iter().for_each(WholeRequest::expect);
    }

    /// Begins to fetch a file that is expected.
    pub(crate) fn prepare(&self) {
        self.request().iter().for_each(WholeRequest::prepare);
    }

    /// Returns its bytes; `None` if it is not there. Those from another machine stay in memory until they are read for the last time, if
    /// there is room.
    ///
    /// # Errors
    /// [`Error::Input`] if it is too large, [`Error::Io`] if it cannot be read.
    pub(crate) fn bytes(&self) -> Result<Option<Bytes>> {
        if let Some(request) = self.request() {
            return Ok(request.fetch(true)?.map(Bytes::Remote));
        }
        let refused = Error::io("read", &self.path);
        let file = match fault::read("read-input").and_then(|()| File::open(&self.path)) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(refused(error)),
        };
        if file.metadata().is_ok_and(|data| data.is_dir()) {
            return Err(Error::input(&self.path, "is a folder, not a file: copy the data set again"));
        }
        let mut bytes = Vec::new();
        file.take(LARGEST + 1).read_to_end(&mut bytes).map_err(refused)?;
        match bytes.len() as u64 > LARGEST {
            true => Err(Error::input(&self.path, format!("has more than {} MiB", LARGEST >> 20))),
            false => Ok(Some(Bytes::Local(bytes))),
        }
    }

    /// Opens it; `None` if it is not there. As [`SideFile::bytes`] otherwise.
    ///
    /// # Errors
    /// As [`SideFile::bytes`].
    pub(crate) fn open(&self) -> Result<Option<RandomAccessFile>> {
        if let Some(request) = self.request() {
            return Ok(request.fetch(true)?.map(|file| RandomAccessFile::of_whole(self.path.clone(), file)));
        }
        match RandomAccessFile::open(&self.path) {
            Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
            opened => opened.map(Some),
        }
    }

    fn request(&self) -> Option<WholeRequest<'_>> {
        let url = self.url.as_deref()?;
        Some(WholeRequest::new(&self.path, url, LARGEST, self.about))
    }
}

/// Returns the page of the hierarchy that begins at `root`.
///
/// # Errors
/// [`Error::Input`] if it is not there, [`Error::Io`] if it cannot be read.
pub(crate) fn page(index: &Path, root: NodeKey) -> Result<Bytes> {
    let file = SideFile::new(index, &page_name(root), PAGE)?;
    let missing = || {
        let what = format!("the page {} of its hierarchy is not there: copy the data set again", file.path.display());
        Error::input(index, what)
    };
    // Nobody keeps pages: they are read anew for each plan.
    file.expect();
    file.bytes()?.ok_or_else(missing)
}
