//! One LAZ chunk.
//!
//! The decoders for the usual forms are in `laszip/`, and those of the `laz` crate decode the others. The latter may panic on hostile
//! data, so every call is wrapped in [`catch_panic`]. They may also fill the stack with GPS times, which nothing can catch, so they
//! never decode times that have sequences: [`LazCompression::parse`] refuses such pointwise records, and [`selection`] leaves out the
//! times of layered ones.

use std::io;

use laz::DecompressionSelection;
use laz::record::RecordDecompressor;

use crate::file::random_access::RandomAccessFile;
use crate::file::range::{FileRange, READ_AHEAD};
use crate::las::chunk_table::LazChunk;
use crate::las::compression::LazCompression;
use crate::las::copc::place;
use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::items::{KnownItems, WantedLayers};
use crate::las::laszip::layered::LayeredDecoder;
use crate::las::laszip::pointwise::PointwiseDecoder;
use crate::las::layout::RecordLayout;
use crate::las::uncompressed::push_records;
use crate::points::optional_fields::OptionalFields;
use crate::points::raw_bounds::RawBounds;
use crate::points::record_sink::RecordSink;
use sys::Error;
use sys::catch_panic::{Panicked, catch_panic};

/// The number of decoded bytes held at once, unless a single record is longer.
const BLOCK: usize = 1 << 17;

/// The number of bytes to read ahead in a layered chunk. Layers are read as a whole, and those that are not wanted are skipped.
const LAYER_READ_AHEAD: usize = 1 << 9;

/// The most bytes of a layered chunk that is decoded: its layers must be in memory together.
const LARGEST_CHUNK: u64 = 1 << 26;

/// Why the rest of a chunk cannot be decoded.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ChunkError {
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
    #[error("by its own count it has only {0} points")]
    FewerPoints(u64),
    #[error("it has {0} bytes, which must be in memory together; write the file again with smaller chunks")]
    TooLarge(u64),
    /// This is not about the chunk: the file cannot be read, or the job stops.
    #[error(transparent)]
    Stopped(#[from] Error),
}

/// Decodes one LAZ chunk.
pub(crate) struct ChunkDecoder<'a> {
    pub(crate) compression: &'a LazCompression,
    pub(crate) layout: &'a RecordLayout,
    pub(crate) file: &'a RandomAccessFile,
    pub(crate) chunk: &'a LazChunk,
    /// What is wanted besides place and class.
    pub(crate) fields: OptionalFields,
    /// Where its points lie, if an index says so and that matters.
    pub(crate) cell: Option<RawBounds>,
    /// The number of records to decode, from the first.
    pub(crate) wanted: u64,
    /// The number of the next record in the file.
    pub(crate) next: u64,
}

impl ChunkDecoder<'_> {
    /// Decodes the wanted records as far as possible; `self.next` then says how far.
    pub(crate) fn decode(&mut self, filter: &mut impl RecordSink) -> std::result::Result<(), ChunkError> {
        let held = self.records_held()?.min(self.wanted);
        let end = self.chunk.first + held;
        let read_ahead = if self.compression.layers.is_some() { LAYER_READ_AHEAD } else { READ_AHEAD };
        let mut range = self.file.range_with(self.chunk.bytes.clone(), read_ahead)?;
        let known_items = self.compression.known_items();
        while self.next < end {
            let stop = self.chunk.restart.map_or(end, |records| self.next.saturating_add(records).min(end));
            range = match known_items {
                Some(items) => self.decode_known(items, range, stop, filter)?,
                None => self.decode_run(range, stop, filter)?,
            };
        }
        if held < self.wanted { Err(ChunkError::FewerPoints(held)) } else { Ok(()) }
    }

    /// Counts the wanted records from `self.next` on as malformed.
    pub(crate) fn count_lost(&self, damage: &ChunkError, filter: &mut impl RecordSink) {
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
        let Some(layers) = &self.compression.layers else {
            return Ok(self.chunk.count);
        };
        let size = self.chunk.bytes.end - self.chunk.bytes.start;
        if size > LARGEST_CHUNK {
            return Err(ChunkError::TooLarge(size));
        }
        let head = layers.read_head(self.file, self.chunk.bytes.clone())?;
        Ok(head.ok_or(ChunkError::Layers)?.records)
    }

    /// Decodes the records up to number `stop` with fresh models of the `laz` crate, and returns the range, now behind these records.
    fn decode_run(
        &mut self,
        range: FileRange,
        stop: u64,
        filter: &mut impl RecordSink,
    ) -> std::result::Result<FileRange, ChunkError> {
        let selection = selection(self.fields, self.layout.has_rgb());
        let mut decoder = catch_panic(|| self.compression.decoder(range, selection))??;
        let (file, length) = (self.file, self.layout.length);
        self.decode_blocks(stop, filter, |block, done| {
            catch_panic(|| decode_block(decoder.as_mut(), block, length, done))?.map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => ChunkError::CutShort,
                _ => ChunkError::Stopped(Error::io("read", file.path())(error)),
            })
        })?;
        Ok(decoder.box_into_inner())
    }

    /// Does what [`ChunkDecoder::decode_run`] does, with the decoders of this crate.
    fn decode_known(
        &mut self,
        items: KnownItems,
        mut range: FileRange,
        stop: u64,
        filter: &mut impl RecordSink,
    ) -> std::result::Result<FileRange, ChunkError> {
        let file = self.file;
        let explain = |error| match error {
            DecodeError::CutShort => ChunkError::CutShort,
            DecodeError::Nonsense => ChunkError::Nonsense,
            DecodeError::Read(error) => ChunkError::Stopped(Error::io("read", file.path())(error)),
        };
        match items {
            KnownItems::Pointwise(items) => {
                let mut decoder = PointwiseDecoder::new(items, range).map_err(explain)?;
                self.decode_blocks(stop, filter, |block, done| decoder.decode(block, done).map_err(explain))?;
                decoder.into_source().map_err(explain)
            }
            KnownItems::Layered(items) => {
                let wanted = WantedLayers { intensity: self.fields.intensity, rgb: self.fields.rgb };
                let mut decoder = LayeredDecoder::new(items, wanted, &mut range).map_err(explain)?;
                self.decode_blocks(stop, filter, |block, done| decoder.decode(block, done).map_err(explain))?;
                Ok(range)
            }
        }
    }

    /// Sends the records up to number `stop` through `filter`. `decode` fills a block with records, and counts the bytes that it
    /// decoded, even if it fails.
    fn decode_blocks(
        &mut self,
        stop: u64,
        filter: &mut impl RecordSink,
        mut decode: impl FnMut(&mut [u8], &mut usize) -> std::result::Result<(), ChunkError>,
    ) -> std::result::Result<(), ChunkError> {
        let length = self.layout.length;
        let mut block = vec![0; (BLOCK / length).clamp(1, (stop - self.next) as usize) * length];
        while self.next < stop {
            let wanted = ((block.len() / length) as u64).min(stop - self.next) as usize * length;
            let mut done = 0;
            let outcome = decode(&mut block[..wanted], &mut done);
            if let Some(cell) = &self.cell {
                let records = block[..done].chunks_exact(length);
                filter.misplaced(records.filter(|record| !cell.hold(&place(record))).count() as u64);
            }
            push_records(self.layout, &block[..done], self.next, self.fields, filter)?;
            self.next += (done / length) as u64;
            outcome?;
        }
        Ok(())
    }
}

/// Returns the fields of layered records to decompress. Times must not be among them.
fn selection(fields: OptionalFields, has_rgb: bool) -> DecompressionSelection {
    let needed = DecompressionSelection::base().decompress_z().decompress_classification().decompress_flags();
    let needed = if fields.intensity { needed.decompress_intensity() } else { needed };
    if fields.rgb && has_rgb { needed.decompress_rgb() } else { needed }
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

#[cfg(test)]
mod tests {
    use super::selection;
    use crate::points::optional_fields::OptionalFields;

    #[test]
    fn the_crate_never_decodes_times() {
        for (rgb, intensity) in [(false, false), (true, true)] {
            let selection = selection(OptionalFields { rgb, intensity }, true);
            assert!(!selection.should_decompress_gps_time());
            assert_eq!((selection.should_decompress_rgb(), selection.should_decompress_intensity()), (rgb, intensity));
        }
    }
}
