//! A PMTiles archive, version 3: a header, a directory of all tiles in their order by number, some words about them, and the tiles.
//!
//! A directory of more than some thousand tiles has parts, the leaves, and a root that lists them. The crate `pmtiles` could write
//! this, but it packs with `flate2`, whose coder other crates of a build can exchange, and the format is small.

use crate::gzip::gzipped;
use std::collections::HashMap;

const HEADER: usize = 127;

/// How hard the coder of directories tries.
const GZIP_LEVEL: u8 = 6;

/// Readers fetch so many bytes at first: header and root.
const FIRST_READ: usize = 16_384;

/// The tiles of a leaf, at first. It doubles until the root is small enough.
const LEAF: usize = 4096;

/// A tile that waits for its place in the archive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaitingTile {
    /// Its number: see [`MapTile::id`](crate::map_tiles::tile_id::MapTile::id).
    pub id: u64,
    /// Its bytes.
    pub length: u32,
    /// The checksum of its bytes. Tiles with the same bytes are stored once.
    pub checksum: u128,
}

/// What an archive says of its tiles.
#[derive(Clone, Debug)]
pub struct ArchiveAbout {
    /// The finest zoom. The coarsest is 0.
    pub max_zoom: u8,
    /// West, south, east and north in degrees.
    pub bounds: [f64; 4],
    /// A zoom at which the terrain fills a window.
    pub center_zoom: u8,
    /// JSON.
    pub metadata: String,
}

/// What stands in front of the tiles of an archive, and which tiles follow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArchiveHead {
    /// The first bytes of the file.
    pub bytes: Vec<u8>,
    /// The tiles whose bytes follow, by their places in the list.
    pub stored: Vec<usize>,
}

/// An entry of a directory: `run` tiles from number `id` on with the same bytes, or a leaf if `run` is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Entry {
    id: u64,
    offset: u64,
    length: u32,
    run: u32,
}

/// Returns the head of an archive of `tiles`, which have ascending numbers.
pub fn head(tiles: &[WaitingTile], about: &ArchiveAbout) -> ArchiveHead {
    let (entries, stored, end) = entries(tiles);
    let (root, leaves) = directories(&entries);
    let metadata = gzipped(about.metadata.as_bytes(), GZIP_LEVEL);
    let mut bytes = Vec::with_capacity(HEADER + root.len() + metadata.len() + leaves.len());
    bytes.extend(b"PMTiles\x03");
    let mut at = HEADER as u64;
    for length in [root.len() as u64, metadata.len() as u64, leaves.len() as u64, end] {
        bytes.extend(at.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        at += length;
    }
    for count in [tiles.len(), entries.len(), stored.len()] {
        bytes.extend((count as u64).to_le_bytes());
    }
    const IN_ORDER: u8 = 1;
    const GZIP: u8 = 2;
    const NONE: u8 = 1;
    const PNG: u8 = 2;
    bytes.extend([IN_ORDER, GZIP, NONE, PNG, 0, about.max_zoom]);
    let [west, south, east, north] = about.bounds;
    bytes.extend([west, south, east, north].into_iter().flat_map(ten_millionths));
    bytes.push(about.center_zoom);
    bytes.extend([west + (east - west) / 2.0, south + (north - south) / 2.0].into_iter().flat_map(ten_millionths));
    bytes.extend([root, metadata, leaves].into_iter().flatten());
    ArchiveHead { bytes, stored }
}

fn ten_millionths(degrees: f64) -> [u8; 4] {
    // The conversion keeps within the type.
    ((degrees * 1e7 + 0.5).floor() as i32).to_le_bytes()
}

/// Returns the entries of the tiles, those of them that are stored, and the bytes of these.
fn entries(tiles: &[WaitingTile]) -> (Vec<Entry>, Vec<usize>, u64) {
    let (mut entries, mut stored, mut end) = (Vec::<Entry>::with_capacity(tiles.len()), Vec::new(), 0);
    let mut places: HashMap<(u128, u32), u64> = HashMap::with_capacity(tiles.len());
    for (n, tile) in tiles.iter().enumerate() {
        let offset = *places.entry((tile.checksum, tile.length)).or_insert_with(|| {
            stored.push(n);
            let offset = end;
            end += u64::from(tile.length);
            offset
        });
        match entries.last_mut() {
            Some(last) if last.offset == offset && last.id + u64::from(last.run) == tile.id => last.run += 1,
            _ => entries.push(Entry { id: tile.id, offset, length: tile.length, run: 1 }),
        }
    }
    (entries, stored, end)
}

/// Returns the packed root, and the packed leaves if there are any.
fn directories(entries: &[Entry]) -> (Vec<u8>, Vec<u8>) {
    let whole = directory(entries);
    if whole.len() <= FIRST_READ - HEADER {
        return (whole, Vec::new());
    }
    let mut size = LEAF;
    loop {
        let (mut root, mut leaves) = (Vec::new(), Vec::new());
        for leaf in entries.chunks(size) {
            let bytes = directory(leaf);
            let id = leaf.first().map_or(0, |entry| entry.id);
            root.push(Entry { id, offset: leaves.len() as u64, length: bytes.len() as u32, run: 0 });
            leaves.extend(bytes);
        }
        let root = directory(&root);
        if root.len() <= FIRST_READ - HEADER {
            return (root, leaves);
        }
        size *= 2;
    }
}

/// Returns a packed directory.
fn directory(entries: &[Entry]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(entries.len() * 8);
    push_number(entries.len() as u64, &mut bytes);
    let mut last = 0;
    for entry in entries {
        push_number(entry.id - last, &mut bytes);
        last = entry.id;
    }
    entries.iter().for_each(|entry| push_number(u64::from(entry.run), &mut bytes));
    entries.iter().for_each(|entry| push_number(u64::from(entry.length), &mut bytes));
    let mut end = None;
    for entry in entries {
        // 0 says that it follows the one before.
        push_number(if end == Some(entry.offset) { 0 } else { entry.offset + 1 }, &mut bytes);
        end = Some(entry.offset + u64::from(entry.length));
    }
    gzipped(&bytes, GZIP_LEVEL)
}

/// Appends a number, seven bits a byte from the lowest on.
fn push_number(mut number: u64, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push((number & 0x7f) as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use miniz_oxide::inflate::decompress_to_vec;

    fn number(bytes: &[u8], at: usize) -> usize {
        u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize
    }

    fn unpacked(gzip: &[u8]) -> Vec<u8> {
        assert_eq!(gzip[..4], [0x1f, 0x8b, 8, 0]);
        decompress_to_vec(&gzip[10..gzip.len() - 8]).unwrap()
    }

    fn read_directory(gzip: &[u8]) -> Vec<Entry> {
        let bytes = unpacked(gzip);
        let mut at = 0;
        let mut next = || {
            let (mut value, mut shift) = (0, 0);
            loop {
                let byte = bytes[at];
                at += 1;
                value |= u64::from(byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    return value;
                }
            }
        };
        let count = next() as usize;
        let mut column = || (0..count).map(|_| next()).collect::<Vec<u64>>();
        let [ids, runs, lengths, offsets] = [column(), column(), column(), column()];
        assert_eq!(at, bytes.len());
        let mut entries: Vec<Entry> = Vec::new();
        for n in 0..count {
            let last = entries.last().copied().unwrap_or(Entry { id: 0, offset: 0, length: 0, run: 0 });
            let offset = if offsets[n] == 0 { last.offset + u64::from(last.length) } else { offsets[n] - 1 };
            entries.push(Entry { id: last.id + ids[n], offset, length: lengths[n] as u32, run: runs[n] as u32 });
        }
        entries
    }

    /// Returns the place of a tile in the data as a reader finds it.
    fn find(bytes: &[u8], id: u64) -> Option<(u64, u32)> {
        let [root, root_length, leaves] = [8, 16, 40].map(|at| number(bytes, at));
        let mut entries = read_directory(&bytes[root..root + root_length]);
        loop {
            let entry = entries[..entries.partition_point(|entry| entry.id <= id)].last().copied()?;
            if entry.run > 0 {
                return (id < entry.id + u64::from(entry.run)).then_some((entry.offset, entry.length));
            }
            let from = leaves + entry.offset as usize;
            entries = read_directory(&bytes[from..from + entry.length as usize]);
        }
    }

    fn about() -> ArchiveAbout {
        ArchiveAbout {
            max_zoom: 16,
            bounds: [-123.25, 44.0, -123.0, 44.5],
            center_zoom: 12,
            metadata: "{\"name\":\"terrain\"}".into(),
        }
    }

    /// Asserts that every tile is found with its bytes, and no other one.
    fn holds(tiles: &[WaitingTile]) -> ArchiveHead {
        let head = head(tiles, &about());
        let mut starts = Vec::new();
        let mut end = 0;
        for n in &head.stored {
            starts.push((end, tiles[*n].length, tiles[*n].checksum));
            end += u64::from(tiles[*n].length);
        }
        for tile in tiles {
            let (offset, length) = find(&head.bytes, tile.id).unwrap();
            assert!(starts.contains(&(offset, length, tile.checksum)) && length == tile.length, "{}", tile.id);
        }
        let is_tile = |id: u64| tiles.iter().any(|tile| tile.id == id);
        assert!((0..300).filter(|id| !is_tile(*id)).all(|id| find(&head.bytes, id).is_none()));
        assert_eq!(number(&head.bytes, 56), head.bytes.len(), "the tiles follow");
        assert_eq!(number(&head.bytes, 64) as u64, end);
        assert!(number(&head.bytes, 16) <= FIRST_READ - HEADER);
        head
    }

    #[test]
    fn equal_tiles_are_stored_once() {
        let tile = |id, checksum| WaitingTile { id, length: 100 + checksum as u32, checksum };
        let tiles = [tile(0, 1), tile(3, 2), tile(4, 2), tile(5, 2), tile(9, 3), tile(10, 1), tile(200, 4)];
        let head = holds(&tiles);
        assert_eq!(head.stored, [0, 1, 4, 6]);
        assert_eq!([72, 80, 88].map(|at| number(&head.bytes, at)), [7, 5, 4]);
        assert_eq!(number(&head.bytes, 48), 0, "no leaves");
        let metadata = number(&head.bytes, 24);
        assert_eq!(unpacked(&head.bytes[metadata..][..number(&head.bytes, 32)]), b"{\"name\":\"terrain\"}");
        assert_eq!(head.bytes[96..102], [1, 2, 1, 2, 0, 16]);
        let place = |at: usize| i32::from_le_bytes(head.bytes[at..at + 4].try_into().unwrap());
        assert_eq!([102, 106, 110, 114].map(place), [-1_232_500_000, 440_000_000, -1_230_000_000, 445_000_000]);
        assert_eq!([119, 123].map(place), [-1_231_250_000, 442_500_000]);
    }

    #[test]
    fn a_large_directory_has_leaves() {
        let length = |id: u64| 3000 + (id * 7919 % 60_013) as u32;
        let tiles: Vec<WaitingTile> = (0..30_000)
            .map(|n| n * 3 + 1)
            .map(|id| WaitingTile { id, length: length(id), checksum: id.into() })
            .collect();
        let head = head(&tiles, &about());
        assert!(number(&head.bytes, 48) > 0);
        let mut end = 0;
        for tile in &tiles {
            if tile.id % 7 == 0 {
                assert_eq!(find(&head.bytes, tile.id), Some((end, tile.length)));
            }
            end += u64::from(tile.length);
        }
        assert_eq!(find(&head.bytes, 2), None);
        assert_eq!(holds(&tiles[..100]).stored.len(), 100);
    }
}
