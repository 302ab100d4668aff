//! What is wanted of a chunk of a source.

use crate::points::optional_fields::OptionalFields;
use crate::points::raw_bounds::RawBounds;

/// What is wanted of a chunk.
#[derive(Clone, Copy)]
pub(crate) struct ChunkRequest<'a> {
    /// No more than so many records, from the first that is decoded.
    pub(crate) records: u64,
    /// What is wanted of each besides place and class.
    pub(crate) fields: OptionalFields,
    /// Bounds beyond which no record is wanted. A file with an index does not decode what lies beyond them.
    pub(crate) bounds: Option<&'a RawBounds>,
    /// Whether exactly those records are wanted that an index and the bounds leave out otherwise.
    pub(crate) left_out: bool,
}

impl ChunkRequest<'_> {
    /// Returns the request of all records.
    pub(crate) fn all() -> ChunkRequest<'static> {
        ChunkRequest { records: u64::MAX, fields: OptionalFields::default(), bounds: None, left_out: false }
    }

    /// Tells whether a file without an index has to read the chunk from its beginning to its end.
    pub(crate) fn needs_whole_chunk(&self) -> bool {
        !self.left_out && self.records == u64::MAX
    }
}
