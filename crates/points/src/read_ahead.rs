//! Reading a file of another machine ahead of those who decode all of it.

use crate::file::random_access::RandomAccessFile;
use crate::points::chunk_request::ChunkRequest;
use crate::points::raw_bounds::RawBounds;
use crate::remote::forget_whole_files;
use crate::remote::name::is_remote;
use crate::source::Source;
use sys::Result;

/// While this lives, whoever decodes a chunk of the source lets the next ones come too, if it is a file of another machine.
#[must_use]
pub struct ReadAhead(Ahead);

/// What is read ahead.
enum Ahead {
    Nothing,
    /// Ranges of a file.
    Ranges(RandomAccessFile),
    /// The nodes of an EPT.
    Nodes,
}

impl Source {
    /// Says that all chunks will be decoded within these bounds, about in their order; with `left_out`, exactly those records that are not
    /// decoded otherwise.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the file cannot be read or has changed.
    pub fn read_ahead(&self, bounds: Option<&RawBounds>, left_out: bool) -> Result<ReadAhead> {
        if !is_remote(&self.path) {
            return Ok(ReadAhead(Ahead::Nothing));
        }
        let request = ChunkRequest { bounds: self.own_bounds(bounds), left_out, ..ChunkRequest::all() };
        if let Some(points) = self.ept() {
            points.expect(&self.path, &request)?;
            return Ok(ReadAhead(Ahead::Nodes));
        }
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        file.expect((0..self.chunks()).map(|chunk| self.bytes_of(chunk, &request)));
        Ok(ReadAhead(Ahead::Ranges(file)))
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        match &self.0 {
            Ahead::Nothing => {}
            Ahead::Ranges(file) => file.expect(std::iter::empty()),
            Ahead::Nodes => forget_whole_files(),
        }
    }
}
