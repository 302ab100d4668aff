//! Compressed point records: LASzip chunks, pointwise and layered, each decoded from its own bytes.
//!
//! The decoders for the usual forms are in `laszip/`, and those of the `laz` crate decode the others. The latter may panic on hostile data, so
//! every call is wrapped in [`catch_panic`].

use std::io;
use std::ops::Range;

use laz::record::RecordDecompressor;
use laz::{DecompressionSelection, LazVlr};
use serde::{Deserialize, Serialize};

use crate::catch_panic::{Panicked, catch_panic};
use crate::input::file::random_access::RandomAccessFile;
use crate::input::file::range::{FileRange, READ_AHEAD};
use crate::input::las::chunk_table::{self, LazChunk};
use crate::input::las::compression::LazCompression;
use crate::input::las::copc::{CopcIndex, place};
use crate::input::las::header::LasHeader;
use crate::input::las::laszip::decode_error::DecodeError;
use crate::input::las::laszip::items::{KnownItems, WantedLayers};
use crate::input::las::laszip::layered::LayeredDecoder;
use crate::input::las::laszip::pointwise::PointwiseDecoder;
use crate::input::las::layout::RecordLayout;
use crate::input::las::uncompressed::push_records;
use crate::input::las::vlr::Vlr;
use crate::input::points::chunk_request::ChunkRequest;
use crate::input::points::optional_fields::OptionalFields;
use crate::input::points::raw_bounds::RawBounds;
use crate::input::points::record_sink::RecordSink;
use crate::{Error, Result, Warnings};

/// The least number of records of a chunk of the source, as long as there are enough. Smaller LAZ chunks (COPC has them) go
/// together.
const LEAST_RECORDS: u64 = 50_000;

/// The number of decoded bytes held at once, unless a single record is longer.
const BLOCK: usize = 1 << 17;

/// The number of bytes to read ahead in a layered chunk. Layers are read as a whole, and those that are not wanted are skipped.
const LAYER_READ_AHEAD: usize = 1 << 9;

/// The most bytes of a layered chunk that is decoded: its layers must be in memory together.
const LARGEST_CHUNK: u64 = 1 << 26;

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

/// Why the rest of a chunk cannot be decoded.
#[derive(Debug, thiserror::Error)]
enum ChunkError {
    #[error("{0}")]
    Decoder(#[from] laz::LasZipError),
    #[error("{0}")]
    Panicked(#[from] Panicked),
    #[error("its data ends before its points do")]
    CutShort,
    #[error("its data cannot have been written by LASzip")]
    Nonsense,
    #[error("its layers do not fit in it")]
    Layers,
    #[error("it says itself that it has only {0} points")]
    FewerPoints(u64),
    #[error("it has {0} bytes, which must be in memory together; write the file again with smaller chunks")]
    TooLarge(u64),
    /// This is not about the chunk: the file cannot be read, or the job stops.
    #[error(transparent)]
    Stopped(#[from] Error),
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
            let what = "says its points are compressed, but has no LASzip record; the file is damaged";
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

    /// Returns the number of records, including the missing ones.
    fn records(&self) -> u64 {
        let last = self.chunks.last().and_then(|chunk| chunk.last());
        last.map_or(0, |last| last.first + last.count) + self.missing
    }

    /// Returns whether the chunk table is lost, and the chunks do not say themselves how many records they have.
    pub(crate) fn has_lost_table(&self) -> bool {
        self.chunks.iter().flatten().any(|chunk| chunk.restart.is_some())
    }

    /// Returns the number of chunks of the source. There is at least one if records are missing, so that decoding counts them.
    pub(crate) fn chunk_count(&self) -> usize {
        self.chunks.len().max((self.missing > 0) as usize)
    }

    /// Returns whether it is known where the points of each LAZ chunk lie.
    pub(crate) fn has_index(&self) -> bool {
        self.index.is_some()
    }

    /// Returns the number of records of chunk `chunk` of the source that are decoded for these bounds.
    pub(crate) fn decoded_records(&self, chunk: usize, bounds: Option<&RawBounds>) -> u64 {
        let laz_chunks = self.chunks.get(chunk).into_iter().flatten();
        laz_chunks.filter(|laz_chunk| self.may_reach(laz_chunk, bounds)).map(|laz_chunk| laz_chunk.count).sum()
    }

    /// Returns the bytes of the LAZ chunks that this request needs whole of chunk `chunk` of the source. Of pointwise ones only all records
    /// do.
    pub(crate) fn bytes_of(&self, chunk: usize, request: &ChunkRequest) -> Vec<Range<u64>> {
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

    /// Returns what the points of a LAZ chunk lie within, if the index tells and bounds make it matter.
    fn cell(&self, laz_chunk: &LazChunk, bounds: Option<&RawBounds>) -> Option<RawBounds> {
        self.index.as_ref().filter(|_| bounds.is_some())?.cell(laz_chunk)
    }

    fn may_reach(&self, laz_chunk: &LazChunk, bounds: Option<&RawBounds>) -> bool {
        let cell = self.cell(laz_chunk, bounds);
        cell.zip(bounds).is_none_or(|(cell, bounds)| cell.meet(bounds))
    }

    /// Sends the wanted records of chunk `chunk` of the source through `filter`.
    pub(crate) fn decode(
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
            let mut decoder = ChunkDecoder { points: self, file, chunk: laz_chunk, fields, cell, wanted, next };
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

/// Decodes one LAZ chunk.
struct ChunkDecoder<'a> {
    points: &'a CompressedPoints,
    file: &'a RandomAccessFile,
    chunk: &'a LazChunk,
    /// What is wanted besides place and class.
    fields: OptionalFields,
    /// Where its points lie, if an index says so and that matters.
    cell: Option<RawBounds>,
    /// The number of records to decode, from the first.
    wanted: u64,
    /// The number of the next record in the file.
    next: u64,
}

impl ChunkDecoder<'_> {
    /// Decodes the wanted records as far as possible; `self.next` then says how far.
    fn decode(&mut self, filter: &mut impl RecordSink) -> std::result::Result<(), ChunkError> {
        let held = self.records_held()?.min(self.wanted);
        let end = self.chunk.first + held;
        let read_ahead = if self.points.compression.layers.is_some() { LAYER_READ_AHEAD } else { READ_AHEAD };
        let mut range = self.file.range_with(self.chunk.bytes.clone(), read_ahead)?;
        // Without a table, the next chunk begins where the decoder stops, and only the decoders of the `laz` crate tell where that is.
        match self.points.compression.known_items() {
            Some(items) if self.chunk.restart.is_none() && self.next < end => {
                self.decode_known(items, range, end, filter)?;
            }
            _ => {
                while self.next < end {
                    let stop = self.chunk.restart.map_or(end, |records| self.next.saturating_add(records).min(end));
                    range = self.decode_run(range, stop, filter)?;
                }
            }
        }
        if held < self.wanted { Err(ChunkError::FewerPoints(held)) } else { Ok(()) }
    }

    /// Counts the wanted records from `self.next` on as malformed.
    fn count_lost(&self, damage: &ChunkError, filter: &mut impl RecordSink) {
        let LazChunk { number, first, .. } = self.chunk;
        let (at, left) = (self.next, first + self.wanted - self.next);
        filter.malformed(left, || {
            format!(
                "chunk {number} is damaged at point {at}: {damage}; {left} points are lost, so copy the file again or allow the \
                 loss"
            )
        });
    }

    /// Returns the number of records that a layered chunk says it has; for other chunks, the number in the chunk table.
    fn records_held(&self) -> std::result::Result<u64, ChunkError> {
        let Some(layers) = &self.points.compression.layers else {
            return Ok(self.chunk.count);
        };
        let size = self.chunk.bytes.end - self.chunk.bytes.start;
        if size > LARGEST_CHUNK {
            return Err(ChunkError::TooLarge(size));
        }
        let head = layers.read_head(self.file, self.chunk.bytes.clone())?;
        Ok(head.ok_or(ChunkError::Layers)?.records)
    }

    /// Decodes the records up to number `stop` with fresh models, and returns the range, now behind these records.
    fn decode_run(
        &mut self,
        range: FileRange,
        stop: u64,
        filter: &mut impl RecordSink,
    ) -> std::result::Result<FileRange, ChunkError> {
        let selection = self.selection();
        let mut decoder = catch_panic(|| self.points.compression.decoder(range, selection))??;
        let (file, length) = (self.file, self.points.layout.length);
        self.decode_blocks(stop, filter, |block, done| {
            catch_panic(|| decode_block(decoder.as_mut(), block, length, done))?.map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => ChunkError::CutShort,
                _ => ChunkError::Stopped(Error::io("read", file.path())(error)),
            })
        })?;
        Ok(decoder.box_into_inner())
    }

    /// Decodes the records up to number `stop` with the decoders of this crate.
    fn decode_known(
        &mut self,
        items: KnownItems,
        range: FileRange,
        stop: u64,
        filter: &mut impl RecordSink,
    ) -> std::result::Result<(), ChunkError> {
        let file = self.file;
        let explain = |error| match error {
            DecodeError::CutShort => ChunkError::CutShort,
            DecodeError::Nonsense => ChunkError::Nonsense,
            DecodeError::Read(error) => ChunkError::Stopped(Error::io("read", file.path())(error)),
        };
        match items {
            KnownItems::Pointwise(items) => {
                let mut decoder = PointwiseDecoder::new(items, range).map_err(explain)?;
                self.decode_blocks(stop, filter, |block, done| decoder.decode(block, done).map_err(explain))
            }
            KnownItems::Layered(items) => {
                let wanted = WantedLayers { intensity: self.fields.intensity, rgb: self.fields.rgb };
                let mut decoder = LayeredDecoder::new(items, wanted, range).map_err(explain)?;
                self.decode_blocks(stop, filter, |block, done| decoder.decode(block, done).map_err(explain))
            }
        }
    }

    /// Sends the records up to number `stop` through `filter`. `decode` fills a block with records, and counts the bytes that it decoded even
    /// if it fails.
    fn decode_blocks(
        &mut self,
        stop: u64,
        filter: &mut impl RecordSink,
        mut decode: impl FnMut(&mut [u8], &mut usize) -> std::result::Result<(), ChunkError>,
    ) -> std::result::Result<(), ChunkError> {
        let length = self.points.layout.length;
        let mut block = vec![0; (BLOCK / length).clamp(1, (stop - self.next) as usize) * length];
        while self.next < stop {
            let wanted = ((block.len() / length) as u64).min(stop - self.next) as usize * length;
            let mut done = 0;
            let outcome = decode(&mut block[..wanted], &mut done);
            if let Some(cell) = &self.cell {
                let records = block[..done].chunks_exact(length);
                filter.misplaced(records.filter(|record| !cell.hold(&place(record))).count() as u64);
            }
            push_records(&self.points.layout, &block[..done], self.next, self.fields, filter)?;
            self.next += (done / length) as u64;
            outcome?;
        }
        Ok(())
    }

    /// Returns the fields to decompress.
    fn selection(&self) -> DecompressionSelection {
        let needed = DecompressionSelection::base().decompress_z().decompress_classification().decompress_flags();
        let needed = if self.fields.intensity { needed.decompress_intensity() } else { needed };
        if self.fields.rgb && self.points.layout.has_rgb() { needed.decompress_rgb() } else { needed }
    }
}

/// Decodes record after record into `block`. `done` counts the decoded bytes, even if decoding fails.
fn decode_block(
    decoder: &mut dyn RecordDecompressor<FileRange>,
    block: &mut [u8],
    length: usize,
    done: &mut usize,
) -> io::Result<()> {
    for record in block.chunks_exact_mut(length) {
        decoder.decompress_next(record)?;
        *done += length;
    }
    Ok(())
}
