//! Compressed point records: LASzip chunks, pointwise and layered, each decoded from its own bytes.
//!
//! The format is described in Isenburg 2013, "LASzip: lossless compression of lidar data"; the decoders are those of the
//! `laz` crate, which may panic on hostile data and is therefore called under guard.

use std::io;
use std::ops::Range;

use laz::record::RecordDecompressor;
use laz::{DecompressionSelection, LazVlr};

use crate::input::file::random_access::RandomAccessFile;
use crate::input::file::range::FileRange;
use crate::input::las::catch_panic::catch_panic;
use crate::input::las::chunk_table::{self, LazChunk};
use crate::input::las::compression::LazCompression;
use crate::input::las::header::LasHeader;
use crate::input::las::layout::RecordLayout;
use crate::input::las::uncompressed::push_records;
use crate::input::las::vlr::Vlr;
use crate::input::points::filter::PointFilter;
use crate::input::points::rules::PointRules;
use crate::{Error, Result};

/// Records a chunk has at least, if there are as many; small chunks (COPC has them) go together.
const PIECE: u64 = 50_000;

/// Decoded bytes held at once, unless a single record is longer.
const BLOCK: usize = 1 << 17;

/// The most bytes of a layered chunk that are held to decode it: its layers must be in memory together.
const LARGEST_CHUNK: u64 = 1 << 26;

/// The point data of a LAZ file.
#[derive(Clone, Debug)]
pub(crate) struct CompressedPoints {
    layout: RecordLayout,
    compression: LazCompression,
    laz_chunks: Vec<LazChunk>,
    chunks: Vec<Range<usize>>,
    /// Records that the header promises and no chunk holds.
    pub(crate) missing: u64,
}

impl CompressedPoints {
    /// Finds the chunks of `file`.
    pub(crate) fn read(
        file: &RandomAccessFile,
        header: &LasHeader,
        vlrs: &[Vlr],
        warnings: &mut Vec<String>,
    ) -> Result<CompressedPoints> {
        let Some(vlr) = vlrs.iter().find(|vlr| vlr.is(LazVlr::USER_ID, LazVlr::RECORD_ID)) else {
            let what = "says its points are compressed, but has no LASzip record; the file is damaged";
            return Err(Error::input(file.path(), what));
        };
        let compression =
            LazCompression::parse(&vlr.read(file)?, header).map_err(|what| Error::input(file.path(), what))?;
        let laz_chunks = chunk_table::find(file, header, &compression, warnings)?;
        let missing = header.records - laz_chunks.iter().map(|chunk| chunk.count).sum::<u64>();
        let layout = RecordLayout::new(header.format, header.record_length);
        Ok(CompressedPoints { layout, compression, chunks: group(&laz_chunks), laz_chunks, missing })
    }

    /// The number of records, those missing included.
    fn records(&self) -> u64 {
        self.laz_chunks.last().map_or(0, |chunk| chunk.first + chunk.count) + self.missing
    }

    /// The number of chunks; at least one where records are missing, to count them.
    pub(crate) fn chunks(&self) -> usize {
        self.chunks.len().max((self.missing > 0) as usize)
    }

    /// Sends the records of `chunk` through `filter`.
    pub(crate) fn decode(
        &self,
        file: &RandomAccessFile,
        chunk: usize,
        rules: &PointRules,
        filter: &mut PointFilter,
    ) -> Result<()> {
        for index in self.chunks.get(chunk).cloned().unwrap_or_default() {
            let chunk = &self.laz_chunks[index];
            let mut run = ChunkDecoder { chunks: self, file, index, rules, next: chunk.first };
            if let Err(what) = run.decode(filter)? {
                let (left, at) = (chunk.first + chunk.count - run.next, run.next);
                filter.malformed(left, || {
                    format!("chunk {index} is damaged at point {at}: {what}; {left} points are lost, so copy it again or allow the loss")
                });
            }
        }
        if chunk + 1 == self.chunks() && self.missing > 0 {
            let (all, missing) = (self.records(), self.missing);
            filter.malformed(missing, || {
                format!(
                    "the header promises {all} points, but the compressed data ends {missing} before; copy it again, or \
                     allow the loss"
                )
            });
        }
        Ok(())
    }
}

/// Cuts the chunks in chunks.
fn group(laz_chunks: &[LazChunk]) -> Vec<Range<usize>> {
    let mut chunks = Vec::new();
    let (mut start, mut records) = (0, 0);
    for (index, chunk) in laz_chunks.iter().enumerate() {
        records += chunk.count;
        if records >= PIECE || index + 1 == laz_chunks.len() {
            chunks.push(start..index + 1);
            (start, records) = (index + 1, 0);
        }
    }
    chunks
}

/// One chunk on its way through the decoder.
struct ChunkDecoder<'a> {
    chunks: &'a CompressedPoints,
    file: &'a RandomAccessFile,
    index: usize,
    rules: &'a PointRules,
    /// The number of the next record.
    next: u64,
}

/// Inside: what is wrong with the data. Outside: what stops the job.
type Judged<T> = Result<std::result::Result<T, String>>;

impl ChunkDecoder<'_> {
    /// Decodes the chunk as far as it goes; `self.next` then says how far.
    fn decode(&mut self, filter: &mut PointFilter) -> Judged<()> {
        let chunk = &self.chunks.laz_chunks[self.index];
        let end = chunk.first + chunk.count;
        let held = match self.layered_count(chunk)? {
            Ok(held) => held.min(chunk.count),
            Err(what) => return Ok(Err(what)),
        };
        let mut window = self.file.range(chunk.bytes.clone())?;
        while self.next < chunk.first + held {
            let stop = self.next.saturating_add(chunk.restart).min(chunk.first + held);
            window = match self.decode_run(window, stop, filter)? {
                Ok(window) => window,
                Err(what) => return Ok(Err(what)),
            };
        }
        Ok(if self.next < end { Err(format!("it says itself that it has only {held} points")) } else { Ok(()) })
    }

    /// The number of points a layered chunk says it has; that of the chunk table for others.
    fn layered_count(&self, chunk: &LazChunk) -> Judged<u64> {
        let Some(layers) = &self.chunks.compression.layers else {
            return Ok(Ok(chunk.count));
        };
        let size = chunk.bytes.end - chunk.bytes.start;
        if size > LARGEST_CHUNK {
            return Ok(Err(format!(
                "it has {size} bytes, which must be in memory together; write the file again with smaller chunks"
            )));
        }
        Ok(match layers.read(self.file, chunk.bytes.clone())? {
            Some((count, _)) => Ok(count),
            None => Err("its layers do not fit in it".to_string()),
        })
    }

    /// Decodes the records up to number `stop`, with fresh models, and gives the window back.
    fn decode_run(&mut self, window: FileRange, stop: u64, filter: &mut PointFilter) -> Judged<FileRange> {
        let selection = self.selection();
        let mut decoder = match catch_panic(|| self.chunks.compression.decoder(window, selection)) {
            Ok(Ok(decoder)) => decoder,
            Ok(Err(error)) => return Ok(Err(error.to_string())),
            Err(panic) => return Ok(Err(panic)),
        };
        let length = self.chunks.layout.length;
        let mut block = vec![0; (BLOCK / length).clamp(1, (stop - self.next) as usize) * length];
        while self.next < stop {
            let wanted = ((block.len() / length) as u64).min(stop - self.next) as usize * length;
            let mut done = 0;
            let outcome = catch_panic(|| decode_block(decoder.as_mut(), &mut block[..wanted], length, &mut done));
            push_records(&self.chunks.layout, &block[..done], self.next, self.rules, filter)?;
            self.next += (done / length) as u64;
            match outcome {
                Ok(Ok(())) => {}
                Ok(Err(error)) if error.kind() == io::ErrorKind::UnexpectedEof => {
                    return Ok(Err("its data ends before its points do".to_string()));
                }
                Ok(Err(error)) => return Err(Error::io("read", self.file.path())(error)),
                Err(panic) => return Ok(Err(panic)),
            }
        }
        Ok(Ok(decoder.box_into_inner()))
    }

    fn selection(&self) -> DecompressionSelection {
        let needed = DecompressionSelection::base().decompress_z().decompress_classification().decompress_flags();
        if self.rules.rgb && self.chunks.layout.has_rgb() { needed.decompress_rgb() } else { needed }
    }
}

/// Decodes record after record into `block`; `done` counts the bytes, also when it fails.
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
