//! Where the chunks of a LAZ file lie: from its chunk table, or, where that is missing or damaged, from the chunks.

use std::ops::Range;

use laz::laszip::ChunkTable;

use crate::input::file::bytes::{uint32, uint64};
use crate::input::file::random_access::RandomAccessFile;
use crate::input::las::catch_panic::catch_panic;
use crate::input::las::compression::LazCompression;
use crate::input::las::header::LasHeader;
use crate::{Error, Result};

/// Bytes before the first chunk, which hold the position of the table.
const POINTER: u64 = 8;

/// A run of records that can be decoded on its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LazChunk {
    /// The number of its first record in the file.
    pub(crate) first: u64,
    /// Its number of records.
    pub(crate) count: u64,
    /// Where it is in the file.
    pub(crate) bytes: Range<u64>,
    /// After how many records the compression begins anew within it; more than `count` but where the table is lost.
    pub(crate) restart: u64,
}

/// The chunks of `file`, in order, together with at most `header.records` records.
pub(crate) fn find(
    file: &RandomAccessFile,
    header: &LasHeader,
    compression: &LazCompression,
    warnings: &mut Vec<String>,
) -> Result<Vec<LazChunk>> {
    if header.records == 0 {
        return Ok(Vec::new());
    }
    if !compression.chunked {
        return Ok(vec![LazChunk {
            first: 0,
            count: header.records,
            bytes: header.points_at..file.size(),
            restart: u64::MAX,
        }]);
    }
    match from_table(file, header, compression)? {
        Ok((chunks, surplus)) => {
            if surplus > 0 {
                warnings
                    .push(format!("the chunks hold {surplus} points more than the header says; those are left out"));
            }
            Ok(chunks)
        }
        Err(what) => {
            warnings.push(format!("the table of its compressed chunks {what}; they are found one by one instead"));
            walk(file, header, compression)
        }
    }
}

/// CompressedPoints and the number of records left out, or what is wrong with the table.
type Found = std::result::Result<(Vec<LazChunk>, u64), String>;

fn from_table(file: &RandomAccessFile, header: &LasHeader, compression: &LazCompression) -> Result<Found> {
    let Some(table_at) = table_position(file, header)? else {
        return Ok(Err("is missing, so the file was not finished or is cut short".to_string()));
    };
    let entries = match read_table(file, header, compression, table_at)? {
        Ok(entries) => entries,
        Err(what) => return Ok(Err(what)),
    };
    let (mut chunks, mut first, mut at, mut surplus) =
        (Vec::with_capacity(entries.len()), 0, header.points_at + POINTER, 0);
    for (count, size) in entries {
        let end = at + size;
        if end > table_at {
            return Ok(Err(format!("lets chunk {} reach beyond the points", chunks.len())));
        }
        let kept = count.min(header.records - first);
        surplus += if compression.chunk_size.is_none() { count - kept } else { 0 };
        if kept > 0 {
            chunks.push(LazChunk { first, count: kept, bytes: at..end, restart: u64::MAX });
        }
        first += kept;
        at = end;
    }
    Ok(Ok((chunks, surplus)))
}

/// The position of the chunk table: before the points, or, by writers that cannot go back, at the end of the file.
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

/// The records and bytes of every chunk.
fn read_table(
    file: &RandomAccessFile,
    header: &LasHeader,
    compression: &LazCompression,
    at: u64,
) -> Result<std::result::Result<Vec<(u64, u64)>, String>> {
    let chunks = uint32(&file.bytes(at..at + POINTER)?, 4) as u64;
    // Every chunk begins with a whole record.
    let room = (at - header.points_at - POINTER) / header.record_length as u64;
    if chunks > room {
        return Ok(Err(format!("claims {chunks} chunks, more than the file has room for")));
    }
    let mut window = file.range(at..file.size())?;
    let table = match catch_panic(|| ChunkTable::read(&mut window, compression.chunk_size.is_none())) {
        Ok(Ok(table)) => table,
        Ok(Err(error)) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            return Err(Error::io("read", file.path())(error));
        }
        Ok(Err(_)) => return Ok(Err("is cut short".to_string())),
        Err(panic) => return Ok(Err(format!("cannot be decoded ({panic})"))),
    };
    // The table holds 32-bit numbers, which the decoder extends by their sign.
    let entry = |entry: &laz::laszip::ChunkTableEntry| {
        (compression.chunk_size.unwrap_or(entry.point_count as u32 as u64), entry.byte_count as u32 as u64)
    };
    Ok(Ok(table.as_ref().iter().map(entry).collect()))
}

/// The chunks without a table. Layered ones say how long they are; pointwise ones of known size follow one another, so
/// they can be decoded in one go.
fn walk(file: &RandomAccessFile, header: &LasHeader, compression: &LazCompression) -> Result<Vec<LazChunk>> {
    let start = header.points_at + POINTER;
    let Some(layers) = &compression.layers else {
        return match compression.chunk_size {
            Some(restart) if start < file.size() => {
                Ok(vec![LazChunk { first: 0, count: header.records, bytes: start..file.size(), restart }])
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
        match layers.read(file, at..file.size())? {
            Some((count @ 1.., size)) => {
                let count = count.min(header.records - first);
                chunks.push(LazChunk { first, count, bytes: at..at + size, restart: u64::MAX });
                first += count;
                at += size;
            }
            _ => break,
        }
    }
    Ok(chunks)
}
