//! Uncompressed point records, read block by block.

use crate::point_format::PointFormat;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::las::header::LasHeader;
use crate::las::layout::RecordLayout;
use crate::points::chunk_request::ChunkRequest;
use crate::points::optional_fields::OptionalFields;
use crate::points::record_sink::RecordSink;
use sys::Result;

/// The number of records of a chunk.
const CHUNK: u64 = 50_000;

/// The number of bytes read at once, unless a single record is longer.
const BLOCK: usize = 1 << 18;

/// The point data of a LAS file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct UncompressedPoints {
    layout: RecordLayout,
    points_at: u64,
    /// The number of whole records in the file.
    whole: u64,
    /// The number of records that the header promises and the file does not hold.
    pub(crate) missing: u64,
}

impl UncompressedPoints {
    /// Returns the records of a file of `file_size` bytes.
    pub(crate) fn new(header: &LasHeader, file_size: u64) -> UncompressedPoints {
        let layout = RecordLayout::new(header.format, header.record_length);
        let (extended_at, extended) = header.evlrs;
        let points_end = if extended > 0 && extended_at > header.points_at { extended_at } else { file_size };
        let room = (points_end.min(file_size) - header.points_at) / layout.length as u64;
        let whole = header.records.min(room);
        UncompressedPoints { layout, points_at: header.points_at, whole, missing: header.records - whole }
    }

    fn records_of(&self, chunk: usize) -> Range<u64> {
        let first = chunk as u64 * CHUNK;
        first..(first + CHUNK).min(self.whole)
    }
}

impl PointFormat for UncompressedPoints {
    fn chunk_count(&self) -> usize {
        (self.whole.div_ceil(CHUNK) as usize).max((self.missing > 0) as usize)
    }

    fn bytes_of(&self, chunk: usize, request: &ChunkRequest, _: u64) -> Vec<Range<u64>> {
        if !request.needs_whole_chunk() {
            return Vec::new();
        }
        let Range { start, end } = self.records_of(chunk);
        let at = |number: u64| self.points_at + number * self.layout.length as u64;
        let bytes = at(start)..at(end);
        vec![bytes]
    }

    /// There is no index that could leave any records out.
    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        filter: &mut impl RecordSink,
    ) -> Result<()> {
        if request.left_out {
            return Ok(());
        }
        let length = self.layout.length;
        let Range { start: mut number, end: end_of_chunk } = self.records_of(chunk);
        let end = end_of_chunk.min(number.saturating_add(request.records));
        let mut block = vec![0; (BLOCK / length).clamp(1, (end - number).max(1) as usize) * length];
        while number < end {
            let count = ((block.len() / length) as u64).min(end - number);
            let bytes = &mut block[..count as usize * length];
            file.read_exact_at(bytes, self.points_at + number * length as u64)?;
            push_records(&self.layout, bytes, number, request.fields, filter)?;
            number += count;
        }
        if end == end_of_chunk && chunk + 1 == self.chunk_count() && self.missing > 0 {
            let (whole, missing) = (self.whole, self.missing);
            filter.malformed(missing, || {
                format!(
                    "the header promises {} points, but the file ends after {whole} whole ones, so {missing} are missing; \
                     copy it again, or allow the loss",
                    whole + missing
                )
            });
        }
        Ok(())
    }
}

/// Sends whole records through `filter`. The first of them has the number `number` in the file.
pub(crate) fn push_records(
    layout: &RecordLayout,
    bytes: &[u8],
    number: u64,
    fields: OptionalFields,
    filter: &mut impl RecordSink,
) -> Result<()> {
    for (number, bytes) in (number..).zip(bytes.chunks_exact(layout.length)) {
        filter.push(number, &layout.record(bytes, fields), || format!("point {number}"))?;
    }
    Ok(())
}
