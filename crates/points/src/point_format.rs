//! What a file format does for a [`Source`](crate::Source): it cuts its points into chunks, and decodes one of them.

use std::ops::Range;

use crate::file::random_access::RandomAccessFile;
use crate::points::chunk_request::ChunkRequest;
use crate::points::raw_bounds::RawBounds;
use crate::points::record_sink::RecordSink;
use sys::Result;

/// The points of one opened file, as its format holds them. A new format implements this, becomes a variant of `PointData` in `source.rs`,
/// and is recognised by [`open`](crate::open()).
///
/// An implementation holds where the points are, and no open file, so that it can be written down with the plan of a job.
pub(crate) trait PointFormat {
    /// Returns the number of chunks: parts that can be decoded independently, of about 50,000 records where the format allows. There is at
    /// least one if records are missing, so that decoding counts them.
    fn chunk_count(&self) -> usize;

    /// Returns the ranges of bytes of a chunk that are best read at once for this request, in their order. `size` is that of the file. It
    /// may be empty if little of the chunk is wanted.
    fn bytes_of(&self, chunk: usize, request: &ChunkRequest, size: u64) -> Vec<Range<u64>>;

    /// Sends the wanted records of a chunk to `sink`, in their order. Records that cannot be read are malformed ones of the sink.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read or has changed, and those of `sink`.
    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        sink: &mut impl RecordSink,
    ) -> Result<()>;

    /// Tells whether the file has an index, which tells where the points of its chunks lie.
    fn has_index(&self) -> bool {
        false
    }

    /// Returns the number of records of a chunk that are decoded for these bounds, by the index; `None` without an index.
    fn decoded_records(&self, _chunk: usize, _bounds: Option<&RawBounds>) -> Option<u64> {
        None
    }
}
