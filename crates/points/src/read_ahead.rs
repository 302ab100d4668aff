//! Reading a file of another machine ahead of those who decode all of it.

use crate::file::random_access::RandomAccessFile;
use crate::points::chunk_request::ChunkRequest;
use crate::points::raw_bounds::RawBounds;
use crate::remote::name::is_remote;
use crate::source::Source;
use sys::Result;

/// While this lives, whoever decodes a chunk of the source lets the next ones come too, if it is a file of another machine.
#[must_use]
pub struct ReadAhead(Option<RandomAccessFile>);

impl Source {
    /// Says that all chunks will be decoded within these bounds, about in their order; with `left_out`, exactly those records that are not
    /// decoded otherwise.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the file cannot be read or has changed.
    pub fn read_ahead(&self, bounds: Option<&RawBounds>, left_out: bool) -> Result<ReadAhead> {
        if !is_remote(&self.path) {
            return Ok(ReadAhead(None));
        }
        let request = ChunkRequest { bounds: self.own_bounds(bounds), left_out, ..ChunkRequest::all() };
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        file.expect((0..self.chunks()).map(|chunk| self.bytes_of(chunk, &request)));
        Ok(ReadAhead(Some(file)))
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        if let Some(file) = &self.0 {
            file.expect(std::iter::empty());
        }
    }
}
