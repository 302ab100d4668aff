//! Compressed point records: LASzip chunks, pointwise and layered, each decoded from its own bytes.

use crate::point_format::PointFormat;
use std::ops::Range;

use laz::LazVlr;
use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::las::chunk_table;
use crate::las::chunk_table::LazChunk;
use crate::las::compression::LazCompression;
use crate::las::copc::CopcIndex;
use crate::las::header::LasHeader;
use crate::las::layout::RecordLayout;
use crate::las::laz_chunk::{ChunkDecoder, ChunkError};
use crate::las::vlr::Vlr;
use crate::points::chunk_request::ChunkRequest;
use crate::points::raw_bounds::RawBounds;
use crate::points::record_sink::RecordSink;
use sys::{Error, Result, Warnings};

/// The least number of records of a chunk of the source, as long as there are enough. Smaller LAZ chunks (COPC has them) go
/// together.
const LEAST_RECORDS: u64 = 50_000;

/// The point data of a LAZ file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct CompressedPoints {
    layout: RecordLayout,
    compression: LazCompression,
    /// The chunks of the source, each a run of LAZ chunks. Usually that is one LAZ chunk, since writers put 50,000 records into
    /// each.
    chunks: Vec<Vec<LazChunk>>,
    /// Where the points of each LAZ chunk lie, if that was asked for and the file tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    index: Option<CopcIndex>,
    /// The number of records that the header promises and no chunk holds.
    pub(crate) missing: u64,
}

impl CompressedPoints {
    /// Finds the chunks of `file`, and where their points lie if `with_index`.
    pub(crate) fn read(
        file: &RandomAccessFile,
        header: &LasHeader,
        vlrs: &[Vlr],
        with_index: bool,
        warnings: &mut Warnings,
    ) -> Result<CompressedPoints> {
        let Some(vlr) = vlrs.iter().find(|vlr| vlr.is(LazVlr::USER_ID, LazVlr::RECORD_ID)) else {
            let what = "claims compressed points, but has no LASzip record; the file is damaged";
            return Err(Error::input(file.path(), what));
        };
        let compression = LazCompression::parse(&vlr.read(file)?, header)
            .map_err(|error| Error::input(file.path(), error.to_string()))?;
        let laz_chunks = chunk_table::find(file, header, &compression, warnings)?;
        let missing = header.records - laz_chunks.iter().map(|chunk| chunk.count).sum::<u64>();
        let index = match with_index {
            true => CopcIndex::read(file, header, vlrs, &laz_chunks, warnings)?,
            false => None,
        };
        let layout = RecordLayout::new(header.format, header.record_length);
        Ok(CompressedPoints { layout, compression, chunks: group(laz_chunks), index, missing })
    }

    /// Returns the number of records of a chunk.
    pub(crate) fn records_of(&self, chunk: usize) -> u64 {
        self.chunks.get(chunk).into_iter().flatten().map(|laz_chunk| laz_chunk.count).sum()
    }

    /// Returns the number of records, including the missing ones.
    fn records(&self) -> u64 {
        let last = self.chunks.last().and_then(|chunk| chunk.last());
        last.map_or(0, |last| last.first + last.count) + self.missing
    }

    /// Returns whether the chunk table is lost, and the chunks do not say themselves how many records they have.
    pub(crate) fn has_lost_table(&self) -> bool {
        self.chunks.iter().flatten().any(|chunk| chunk.restart.is_some())
    }

    /// Returns what the points of a LAZ chunk lie within, if the index tells and bounds make it matter.
    fn cell(&self, laz_chunk: &LazChunk, bounds: Option<&RawBounds>) -> Option<RawBounds> {
        self.index.as_ref().filter(|_| bounds.is_some())?.cell(laz_chunk)
    }

    fn may_reach(&self, laz_chunk: &LazChunk, bounds: Option<&RawBounds>) -> bool {
        let cell = self.cell(laz_chunk, bounds);
        cell.zip(bounds).is_none_or(|(cell, bounds)| cell.meet(bounds))
    }
}

impl PointFormat for CompressedPoints {
    fn chunk_count(&self) -> usize {
        self.chunks.len().max((self.missing > 0) as usize)
    }

    fn has_index(&self) -> bool {
        self.index.is_some()
    }

    fn decoded_records(&self, chunk: usize, bounds: Option<&RawBounds>) -> Option<u64> {
        self.index.as_ref()?;
        let laz_chunks = self.chunks.get(chunk).into_iter().flatten();
        let records =
            laz_chunks.filter(|laz_chunk| self.may_reach(laz_chunk, bounds)).map(|laz_chunk| laz_chunk.count).sum();
        Some(records)
    }

    /// Of pointwise chunks, only requests for all records need them whole.
    fn bytes_of(&self, chunk: usize, request: &ChunkRequest, _: u64) -> Vec<Range<u64>> {
        let laz_chunks = self.chunks.get(chunk).into_iter().flatten();
        let decoded = laz_chunks.filter(|laz_chunk| self.may_reach(laz_chunk, request.bounds) != request.left_out);
        let mut left = request.records;
        let mut is_needed = |laz_chunk: &&LazChunk| {
            let before = left;
            left = before.saturating_sub(laz_chunk.count);
            before >= laz_chunk.count || before > 0 && self.compression.layers.is_some()
        };
        decoded.filter(|laz_chunk| is_needed(laz_chunk)).map(|laz_chunk| laz_chunk.bytes.clone()).collect()
    }

    fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        request: ChunkRequest,
        filter: &mut impl RecordSink,
    ) -> Result<()> {
        let mut left = request.records;
        for laz_chunk in self.chunks.get(chunk).into_iter().flatten() {
            if left == 0 {
                return Ok(());
            }
            let may_reach = self.may_reach(laz_chunk, request.bounds);
            if may_reach == request.left_out {
                filter.not_decoded(if may_reach { 0 } else { laz_chunk.count });
                continue;
            }
            let wanted = laz_chunk.count.min(left);
            left -= wanted;
            let cell = self.cell(laz_chunk, request.bounds).filter(|_| may_reach);
            let (fields, next) = (request.fields, laz_chunk.first);
            let (compression, layout) = (&self.compression, &self.layout);
            let mut decoder = ChunkDecoder { compression, layout, file, chunk: laz_chunk, fields, cell, wanted, next };
            match decoder.decode(filter) {
                Ok(()) => {}
                Err(ChunkError::Stopped(error)) => return Err(error),
                Err(damage) => decoder.count_lost(&damage, filter),
            }
        }
        if left > 0 && !request.left_out && chunk + 1 == self.chunk_count() && self.missing > 0 {
            let (all, missing) = (self.records(), self.missing);
            filter.malformed(missing, || {
                format!(
                    "the header promises {all} points, but the compressed data ends {missing} points before; copy the file \
                     again, or allow the loss"
                )
            });
        }
        Ok(())
    }
}

/// Groups the LAZ chunks into chunks of the source.
fn group(laz_chunks: Vec<LazChunk>) -> Vec<Vec<LazChunk>> {
    let (mut chunks, mut chunk, mut records) = (Vec::new(), Vec::new(), 0);
    for laz_chunk in laz_chunks {
        records += laz_chunk.count;
        chunk.push(laz_chunk);
        if records >= LEAST_RECORDS {
            chunks.push(std::mem::take(&mut chunk));
            records = 0;
        }
    }
    if !chunk.is_empty() {
        chunks.push(chunk);
    }
    chunks
}
