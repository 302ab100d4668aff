//! Where the chunks of a LAZ file lie: from its chunk table, or, if that is missing or damaged, from the chunks themselves.

use std::ops::Range;

use laz::laszip::ChunkTable;
use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::las::compression::{ChunkHead, LazCompression};
use crate::las::header::LasHeader;
use sys::bytes::{uint32, uint64};
use sys::catch_panic::{Panicked, catch_panic};
use sys::{Error, Result, Warnings};

/// The number of bytes before the first chunk, which hold the position of the table.
const POINTER: u64 = 8;

/// A chunk of a LAZ file: a run of records that can be decoded on its own. Small LAZ chunks go together in one chunk of the
/// source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LazChunk {
    /// Its number among the LAZ chunks of the file, from 0.
    pub(crate) number: usize,
    /// The number of its first record in the file.
    pub(crate) first: u64,
    /// Its number of records.
    pub(crate) count: u64,
    /// Where it is in the file.
    pub(crate) bytes: Range<u64>,
    /// The number of records after which the compression begins anew within it. `None` if it does not; it does only if the
    /// table is lost, when all LAZ chunks of the file count as one.
    pub(crate) restart: Option<u64>,
}

/// Why the chunk table is not used.
#[derive(Debug, thiserror::Error)]
enum TableError {
    #[error("is missing, so the file was not finished or is cut short")]
    Missing,
    #[error("claims {0} chunks, more than the file has room for")]
    TooManyChunks(u64),
    #[error("is cut short")]
    CutShort,
    #[error("cannot be decoded ({0})")]
    Undecodable(#[from] Panicked),
    #[error("lets chunk {0} reach beyond the points")]
    BeyondPoints(usize),
    #[error("leaves out {0} bytes of the points, so it is damaged")]
    LeavesOut(u64),
    /// The file cannot be read. This says nothing about the table.
    #[error(transparent)]
    Unreadable(#[from] Error),
}

/// Returns the chunks of `file` in order. Together they have at most `header.records` records.
pub(crate) fn find(
    file: &RandomAccessFile,
    header: &LasHeader,
    compression: &LazCompression,
    warnings: &mut Warnings,
) -> Result<Vec<LazChunk>> {
    if header.records == 0 {
        return Ok(Vec::new());
    }
    if !compression.chunked {
        let bytes = header.points_at..file.size();
        return Ok(vec![LazChunk { number: 0, first: 0, count: header.records, bytes, restart: None }]);
    }
    match from_table(file, header, compression) {
        Ok((chunks, surplus)) => {
            if surplus > 0 {
                warnings
                    .push(format!("its chunks hold {surplus} points more than its header gives; those are left out"));
            }
            Ok(chunks)
        }
        Err(TableError::Unreadable(error)) => Err(error),
        Err(damage) => {
            warnings.push(format!("its chunk table {damage}; the chunks are found one by one instead"));
            walk(file, header, compression)
        }
    }
}

/// Returns the chunks that the table lists, and the number of records that they have beyond `header.records`.
fn from_table(
    file: &RandomAccessFile,
    header: &LasHeader,
    compression: &LazCompression,
) -> std::result::Result<(Vec<LazChunk>, u64), TableError> {
    let table_at = table_position(file, header)?.ok_or(TableError::Missing)?;
    let entries = read_table(file, header, compression, table_at)?;
    let mut chunks = Vec::with_capacity(entries.len());
    let (mut first, mut at, mut surplus) = (0, header.points_at + POINTER, 0);
    for (count, size) in entries {
        let number = chunks.len();
        let end = at + size;
        if end > table_at {
            return Err(TableError::BeyondPoints(number));
        }
        let kept = count.min(header.records - first);
        surplus += if compression.chunk_size.is_none() { count - kept } else { 0 };
        if kept > 0 {
            chunks.push(LazChunk { number, first, count: kept, bytes: at..end, restart: None });
        }
        first += kept;
        at = end;
    }
    // Chunks follow one another up to the table.
    if at < table_at { Err(TableError::LeavesOut(table_at - at)) } else { Ok((chunks, surplus)) }
}

/// Returns the position of the chunk table. It is stored before the points or, by writers that cannot seek back, at the end of
/// the file.
fn table_position(file: &RandomAccessFile, header: &LasHeader) -> Result<Option<u64>> {
    let first = header.points_at + POINTER;
    if first + POINTER > file.size() {
        return Ok(None);
    }
    for at in [header.points_at, file.size() - POINTER] {
        let position = uint64(&file.bytes(at..at + POINTER)?, 0);
        if position >= first && position <= file.size() - POINTER {
            return Ok(Some(position));
        }
    }
    Ok(None)
}

/// Reads the number of records and of bytes of every chunk from the table at `at`.
fn read_table(
    file: &RandomAccessFile,
    header: &LasHeader,
    compression: &LazCompression,
    at: u64,
) -> std::result::Result<Vec<(u64, u64)>, TableError> {
    let chunks = uint32(&file.bytes(at..at + POINTER)?, 4) as u64;
    // Every chunk begins with an uncompressed record.
    let room = (at - header.points_at - POINTER) / header.record_length as u64;
    if chunks > room {
        return Err(TableError::TooManyChunks(chunks));
    }
    let mut range = file.range(at..file.size())?;
    let table = match catch_panic(|| ChunkTable::read(&mut range, compression.chunk_size.is_none()))? {
        Ok(table) => table,
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => return Err(TableError::CutShort),
        Err(error) => return Err(TableError::Unreadable(Error::io("read", file.path())(error))),
    };
    // The table holds unsigned 32-bit numbers, but the decoder extends their sign.
    let entry = |entry: &laz::laszip::ChunkTableEntry| {
        (compression.chunk_size.unwrap_or(entry.point_count as u32 as u64), entry.byte_count as u32 as u64)
    };
    Ok(table.as_ref().iter().map(entry).collect())
}

/// Returns the chunks without a table. Layered chunks say how long they are. Pointwise chunks of a known number of records follow
/// one another, so they are decoded as one chunk.
fn walk(file: &RandomAccessFile, header: &LasHeader, compression: &LazCompression) -> Result<Vec<LazChunk>> {
    let start = header.points_at + POINTER;
    let Some(layers) = &compression.layers else {
        return match compression.chunk_size {
            Some(size) if start < file.size() => {
                let (count, bytes) = (header.records, start..file.size());
                Ok(vec![LazChunk { number: 0, first: 0, count, bytes, restart: Some(size) }])
            }
            Some(_) => Ok(Vec::new()),
            None => Err(Error::input(
                file.path(),
                "has lost the table of its compressed chunks, which vary in size, so it cannot be read; copy it again",
            )),
        };
    };
    let (mut chunks, mut first, mut at) = (Vec::new(), 0, start);
    while first < header.records {
        let Some(ChunkHead { records: records @ 1.., bytes }) = layers.read_head(file, at..file.size())? else { break };
        let count = records.min(header.records - first);
        chunks.push(LazChunk { number: chunks.len(), first, count, bytes: at..at + bytes, restart: None });
        first += count;
        at += bytes;
    }
    Ok(chunks)
}
