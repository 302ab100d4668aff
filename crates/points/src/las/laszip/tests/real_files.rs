//! Chunks of real files, if there are any.

use std::io::Cursor;
use std::path::PathBuf;

use laz::LazVlr;
use laz::laszip::ChunkTable;

use crate::las::laszip::items::{KnownItems, WantedLayers};
use crate::las::laszip::tests::{ALL, Chunk, Outcome};
use sys::bytes::{uint16, uint32};

/// The number of chunks of a file that are compared.
const CHUNKS: usize = 3;

/// Returns the first chunks of a LAZ file, each with as many records as it has, at least.
fn chunks(file: &[u8]) -> Vec<Chunk> {
    let points_at = uint32(file, 96) as usize;
    let mut at = uint16(file, 94) as usize;
    let mut vlr = None;
    for _ in 0..uint32(file, 100) {
        let data = &file[at + 54..at + 54 + uint16(file, at + 20) as usize];
        if uint16(file, at + 18) == LazVlr::RECORD_ID {
            vlr = Some(LazVlr::from_buffer(data).unwrap());
        }
        at += 54 + data.len();
    }
    let vlr = vlr.expect("a LASzip record");
    if KnownItems::of(vlr.items()).is_none() {
        return Vec::new();
    }
    let mut source = Cursor::new(file);
    source.set_position(points_at as u64);
    let mut start = points_at + 8;
    let table = ChunkTable::read_from(&mut source, &vlr).unwrap();
    let chunk = |entry: &laz::laszip::ChunkTableEntry| {
        let bytes = file[start..start + entry.byte_count as usize].to_vec();
        start += bytes.len();
        let (length, is_layered) = (uint16(file, 105) as usize, file[104] & 63 >= 6);
        Chunk { items: vlr.items().clone(), length, is_layered, bytes, records: entry.point_count as usize }
    };
    table.into_iter().take(CHUNKS).map(chunk).collect()
}

#[test]
fn real_files_come_out_as_the_crate_decodes_them() {
    let Some(folder) = std::env::var_os("GDT_SHARED").map(|shared| PathBuf::from(shared).join("data")) else {
        return;
    };
    let mut compared = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "laz") {
            continue;
        }
        for chunk in chunks(&std::fs::read(&path).unwrap()) {
            let outcome = chunk.compare(ALL);
            // The last chunk of a file has fewer records than the table says.
            assert!(outcome != Outcome::Nonsense, "{}", path.display());
            assert_eq!(chunk.compare(WantedLayers { intensity: false, rgb: false }), outcome);
            compared += 1;
        }
    }
    assert!(compared > 0);
}
