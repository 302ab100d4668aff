//! Copies of LAS and LAZ files with other classes.

use crate::file::random_access::RandomAccessFile;
use crate::file::range::FileRange;
use crate::las::header::LasHeader;
use crate::las::layout::LEAST_LENGTHS;
use crate::las::vlr::{EXTENDED_HEAD, HEAD, Vlr, list};
use crate::points::returns::PulseReturn;
use laz::{LasZipCompressor, LasZipDecompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;
use sys::bytes::uint64;
use sys::{Error, Result, Warnings, disk, interrupt};

/// Records that are copied at one time, and those of a chunk of the copy, as most writers have it.
const RECORDS: u64 = 1 << 16;
const CHUNK: u32 = 50_000;
/// Bytes that are copied at one time.
const BYTES: u64 = 1 << 20;
/// The user of records that only fit the order of chunks as they were: the index of COPC.
const COPC: &str = "copc";
/// Where a header from LAS 1.3 on has the position of waveforms, and one from 1.4 on that of extended records and their number.
const WAVEFORMS_AT: usize = 227;
const EXTENDED_AT: usize = 235;
const EXTENDED_COUNT_AT: usize = 243;

/// What a class depends on.
#[derive(Clone, Copy, Debug)]
pub struct ClassifiedRecord {
    /// The number of the record in its file.
    pub number: u64,
    /// Its class so far.
    pub class: u8,
    /// Whether another return of its pulse came later.
    pub is_followed: bool,
}

/// Writes the LAS or LAZ file at `from` as LAZ to `to`, each record with the class that `class_of` gives it. All else stays, in its order; an index of
/// COPC is left out, because it would fit no longer.
///
/// # Errors
/// [`Error::Io`] if `to` cannot be written; [`Error::Input`] if the records of `from` cannot be read.
pub fn write_classified(from: &Path, to: &Path, class_of: impl Fn(ClassifiedRecord) -> u8 + Sync) -> Result<()> {
    let file = RandomAccessFile::open(from)?;
    let head = Head::of(&file)?;
    let written = |error: std::io::Error| Error::io("write", to)(error);
    let copy: File = disk::create(to).map_err(written)?;
    let mut copy = BufWriter::new(copy);
    copy.write_all(&head.bytes).map_err(written)?;
    if head.records > 0 {
        let mut compressor = LasZipCompressor::new(&mut copy, head.laz.clone())
            .map_err(|error| Error::input(from, error.to_string()))?;
        let mut records = Records::of(&file, &head)?;
        let mut read = |first: u64, bytes: &mut Vec<u8>| {
            interrupt::check()?;
            bytes.resize(head.records.saturating_sub(first).min(RECORDS) as usize * head.length, 0);
            records.read(bytes).map_err(|error| cannot_read(from, error))
        };
        let (mut bytes, mut next) = (Vec::new(), Vec::new());
        read(0, &mut bytes)?;
        for first in (0..head.records).step_by(RECORDS as usize) {
            // To unpack takes as long as to pack.
            let pack = || {
                classify(&mut bytes, &head, first, &class_of);
                compressor.compress_many(&bytes).map_err(written)
            };
            let (unpacked, packed) = rayon::join(|| read(first + RECORDS, &mut next), pack);
            unpacked.and(packed)?;
            std::mem::swap(&mut bytes, &mut next);
        }
        compressor.done().map_err(written)?;
    }
    let end = copy.stream_position().map_err(written)?;
    for range in &head.extended {
        for at in (range.start..range.end).step_by(BYTES as usize) {
            copy.write_all(&file.bytes(at..range.end.min(at + BYTES))?).map_err(written)?;
        }
    }
    if !head.extended.is_empty() {
        copy.seek(SeekFrom::Start(EXTENDED_AT as u64)).map_err(written)?;
        copy.write_all(&end.to_le_bytes()).map_err(written)?;
    }
    copy.flush().map_err(written)
}

/// The records of a file, in their order.
enum Records {
    Plain(FileRange),
    Compressed(LasZipDecompressor<'static, FileRange>),
}

impl Records {
    fn of(file: &RandomAccessFile, head: &Head) -> Result<Records> {
        let mut range = file.range(0..file.size())?;
        range.seek(SeekFrom::Start(head.points_at)).map_err(Error::io("read", file.path()))?;
        let Some(laz) = &head.own_laz else { return Ok(Records::Plain(range)) };
        let decompressor = LasZipDecompressor::new(range, laz.clone());
        decompressor.map(Records::Compressed).map_err(|error| Error::input(file.path(), error.to_string()))
    }

    /// Fills `bytes` with the next records.
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<()> {
        match self {
            Records::Plain(range) => range.read_exact(bytes),
            Records::Compressed(decompressor) => decompressor.decompress_many(bytes),
        }
    }
}

/// What comes before and after the points of a copy.
struct Head {
    /// The header and the variable length records.
    bytes: Vec<u8>,
    /// How the points are compressed.
    laz: LazVlr,
    records: u64,
    /// The number of bytes of a record, and whether it is one of LAS 1.4.
    length: usize,
    is_extended: bool,
    /// Where the original has its points, and how they are compressed, if they are.
    points_at: u64,
    own_laz: Option<LazVlr>,
    /// Where the original has the extended records that stay, with their heads.
    extended: Vec<Range<u64>>,
}

impl Head {
    fn of(file: &RandomAccessFile) -> Result<Head> {
        let mut ignored = Warnings::default();
        let header = LasHeader::read(file, &mut ignored)?;
        let records = list(file, &header, &mut ignored)?;
        let laz = laz_record(file, &header)?;
        let stays = |record: &&Vlr| !record.is_of(COPC) && !record.is(LazVlr::USER_ID, LazVlr::RECORD_ID);
        let is_extended = |record: &&Vlr| record.bytes().start >= header.points_at;
        let (extended, ordinary): (Vec<&Vlr>, Vec<&Vlr>) = records.iter().filter(stays).partition(is_extended);
        let mut bytes = file.bytes(0..header.size)?;
        for record in &ordinary {
            let data = record.bytes();
            bytes.extend(file.bytes(data.start - HEAD..data.end)?);
        }
        bytes.extend(laz_bytes(file, &laz)?);
        let points_at = bytes.len() as u32;
        bytes[96..100].copy_from_slice(&points_at.to_le_bytes());
        bytes[100..104].copy_from_slice(&(ordinary.len() as u32 + 1).to_le_bytes());
        bytes[104] = header.format | 0x80;
        if header.minor >= 3 && uint64(&bytes, WAVEFORMS_AT) != 0 {
            return Err(Error::input(file.path(), "it holds waveforms, which a copy cannot keep"));
        }
        if header.minor >= 4 {
            bytes[EXTENDED_AT..EXTENDED_COUNT_AT].fill(0);
            let count = extended.len() as u32;
            bytes[EXTENDED_COUNT_AT..EXTENDED_COUNT_AT + 4].copy_from_slice(&count.to_le_bytes());
        }
        let whole = |record: &Vlr| record.bytes().start - EXTENDED_HEAD..record.bytes().end;
        let extended = extended.into_iter().map(whole).collect();
        let own = records.iter().find(|record| record.is(LazVlr::USER_ID, LazVlr::RECORD_ID));
        if header.compressed && own.is_none() {
            return Err(Error::input(file.path(), "its points are compressed, and it has no record of LASzip"));
        }
        let own = own.filter(|_| header.compressed).map(|record| record.read(file)).transpose()?;
        let own_laz = own.map(LazVlr::from_buffer).transpose();
        Ok(Head {
            bytes,
            laz,
            records: header.records,
            length: header.record_length.into(),
            is_extended: header.format >= FIRST_EXTENDED,
            points_at: header.points_at,
            own_laz: own_laz.map_err(|error| Error::input(file.path(), error.to_string()))?,
            extended,
        })
    }
}

/// Returns how the points of a copy are compressed.
fn laz_record(file: &RandomAccessFile, header: &LasHeader) -> Result<LazVlr> {
    let extra = LEAST_LENGTHS.get(header.format as usize).map_or(0, |least| header.record_length - least);
    let items = LazItemRecordBuilder::default_for_point_format_id(header.format, extra);
    let items = items.map_err(|error| Error::input(file.path(), error.to_string()))?;
    Ok(LazVlrBuilder::new(items).with_fixed_chunk_size(CHUNK).build())
}

/// Returns the variable length record that says so.
fn laz_bytes(file: &RandomAccessFile, laz: &LazVlr) -> Result<Vec<u8>> {
    let mut data = Vec::new();
    laz.write_to(&mut data).map_err(Error::io("read", file.path()))?;
    let mut bytes = vec![0; HEAD as usize];
    bytes[2..2 + LazVlr::USER_ID.len()].copy_from_slice(LazVlr::USER_ID.as_bytes());
    bytes[18..20].copy_from_slice(&LazVlr::RECORD_ID.to_le_bytes());
    bytes[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    bytes.extend(data);
    Ok(bytes)
}

/// Returns the error for records that cannot be read.
fn cannot_read(path: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        // Compressed bytes that make no sense, or records that the header promises and that are not there.
        ErrorKind::InvalidData | ErrorKind::UnexpectedEof | ErrorKind::Other => {
            Error::input(path, format!("its records cannot be copied: {error}"))
        }
        _ => Error::io("read", path)(error),
    }
}

/// The first point format of LAS 1.4, in which a class has a byte.
const FIRST_EXTENDED: u8 = 6;
/// The bits of a class in the formats before; the others of its byte are flags.
const LEGACY_CLASS: u8 = 0x1f;

/// Changes the classes of records, whose numbers begin with `first`.
fn classify(bytes: &mut [u8], head: &Head, first: u64, class_of: impl Fn(ClassifiedRecord) -> u8) {
    for (number, record) in (first..).zip(bytes.chunks_exact_mut(head.length)) {
        let returns = record[14];
        let (at, class, pulse) = match head.is_extended {
            true => (16, record[16], PulseReturn { number: returns & 0xf, of: returns >> 4 }),
            false => (15, record[15] & LEGACY_CLASS, PulseReturn { number: returns & 7, of: returns >> 3 & 7 }),
        };
        let class = class_of(ClassifiedRecord { number, class, is_followed: pulse.is_followed() });
        let kept = if head.is_extended { 0 } else { record[at] & !LEGACY_CLASS };
        record[at] = kept | class;
    }
}
