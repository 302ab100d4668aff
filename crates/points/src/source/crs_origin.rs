//! Which record of a file says what system its coordinates are in.

use crate::file::random_access::RandomAccessFile;
use crate::las::crs_records;
use crate::las::header::LasHeader;
use crate::las::vlr;
use crate::source::{FileFormat, Source};
use sys::{Result, Warnings};

impl Source {
    /// Returns whether a record of well-known text says what system the coordinates are in, which counts more than GeoTIFF keys.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read any more.
    pub fn crs_is_text(&self) -> Result<bool> {
        match self.format {
            FileFormat::Text => return Ok(false),
            // Its index has a text, if it has anything.
            FileFormat::Ept => return Ok(true),
            FileFormat::Las | FileFormat::Laz => {}
        }
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        let mut known = Warnings::default();
        let header = LasHeader::read(&file, &mut known)?;
        crs_records::has_readable_text(&file, &vlr::list(&file, &header, &mut known)?)
    }
}
