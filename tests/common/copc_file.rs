//! COPC files made in memory.

use std::collections::BTreeMap;
use std::io::Cursor;

use laz::laszip::ChunkTable;

use crate::las_file::{LasFile, points_at};

/// Level, x, y and z of a node.
type Key = [i32; 4];

/// An entry of the octree's pages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) key: Key,
    pub(crate) at: u64,
    pub(crate) bytes: i32,
    pub(crate) points: i32,
}

/// Bytes of the header of a variable length record, and of an extended one.
const HEADS: [usize; 2] = [54, 60];
/// Bytes of the record that describes the octree.
const INFO: usize = 160;
/// Entries below this level are on a page of their own.
const SECOND_PAGE: i32 = 2;

/// The points of a cloud by the nodes of their octree.
pub(crate) struct CopcFile {
    pub(crate) file: LasFile,
    /// Half the side of the cube in raw steps, around 0, 0, 0.
    pub(crate) half: i32,
    pub(crate) nodes: BTreeMap<Key, Vec<Vec<u8>>>,
}

impl CopcFile {
    /// Puts the records of `file` on `levels` levels, more on the deeper ones.
    pub(crate) fn new(file: &LasFile, levels: i32) -> CopcFile {
        let records = file.records.chunks_exact(file.length() as usize);
        let raw = |record: &[u8], axis: usize| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap());
        let far = records.clone().flat_map(|record| [0, 1, 2].map(|axis| raw(record, axis).abs())).max().unwrap();
        // Raw integers are hundredths, so that the middle of the cube and its side are exact.
        let half = far + 1;
        let mut nodes = BTreeMap::<Key, Vec<Vec<u8>>>::new();
        for (i, record) in records.enumerate() {
            let share = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            // Each level has four times the points of that above it.
            let level = (0..levels - 1).rev().find(|level| !share.is_multiple_of(4u64.pow((levels - level) as u32)));
            let level = level.map_or(0, |level| level + 1);
            let number = |axis: usize| {
                let from = raw(record, axis) as i64 + half as i64;
                ((from << level) / (2 * half as i64)) as i32
            };
            nodes.entry([level, number(0), number(1), number(2)]).or_default().push(record.to_vec());
        }
        CopcFile { file: file.clone(), half, nodes }
    }

    /// Returns the bytes of the file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.bytes_with(|_| {})
    }

    /// Returns the bytes of the file, with the entries of its octree as `edit` leaves them.
    pub(crate) fn bytes_with(&self, edit: impl FnOnce(&mut Vec<Entry>)) -> Vec<u8> {
        let records = self.nodes.values().flatten().flatten().copied().collect();
        let counts: Vec<usize> = self.nodes.values().map(Vec::len).collect();
        let mut bytes = LasFile { records, ..self.file.clone() }.laz(&counts, true);
        let added = HEADS[0] + INFO;
        add_to(&mut bytes, 96, added as u64, 4);
        add_to(&mut bytes, 100, 1, 4);
        let table = points_at(&bytes) - added;
        add_to(&mut bytes, table, added as u64, 8);
        bytes.splice(375..375, [vec![0, 0], record_head("copc", 1, INFO, HEADS[0]), vec![0; INFO]].concat());
        let mut entries = self.entries(&bytes);
        edit(&mut entries);
        self.append_pages(&mut bytes, &entries);
        bytes
    }

    fn entries(&self, bytes: &[u8]) -> Vec<Entry> {
        let start = points_at(bytes);
        let table_at = u64::from_le_bytes(bytes[start..start + 8].try_into().unwrap());
        let mut file = Cursor::new(bytes);
        file.set_position(table_at);
        let table = ChunkTable::read(&mut file, true).unwrap();
        let mut at = start as u64 + 8;
        let entry = |(&key, chunk): (&Key, &laz::laszip::ChunkTableEntry)| {
            let (bytes, points) = (chunk.byte_count as i32, chunk.point_count as i32);
            at += bytes as u64;
            Entry { key, at: at - bytes as u64, bytes, points }
        };
        self.nodes.keys().zip(table.as_ref()).map(entry).collect()
    }

    /// Appends the record of the octree: a page, and another one for the deeper levels, and says where the first of them is.
    fn append_pages(&self, bytes: &mut Vec<u8>, entries: &[Entry]) {
        let (deep, mut shallow): (Vec<Entry>, Vec<Entry>) =
            entries.iter().partition(|entry| entry.key[0] >= SECOND_PAGE);
        let record_at = bytes.len();
        let first = record_at + HEADS[1];
        let second = first + 32 * (shallow.len() + 2);
        shallow.push(Entry { key: [1, 0, 0, 0], at: 0, bytes: 0, points: 0 });
        shallow.push(Entry { key: [2, 0, 0, 0], at: second as u64, bytes: 32 * deep.len() as i32, points: -1 });
        let size = 32 * (shallow.len() + deep.len());
        bytes.extend([0, 0]);
        bytes.extend(record_head("copc", 1000, size, HEADS[1]));
        for Entry { key, at, bytes: size, points } in shallow.iter().chain(&deep) {
            bytes.extend(key.iter().flat_map(|number| number.to_le_bytes()));
            bytes.extend(at.to_le_bytes());
            bytes.extend([size, points].iter().flat_map(|number| number.to_le_bytes()));
        }
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
        put(235, &(record_at as u64).to_le_bytes());
        put(243, &1u32.to_le_bytes());
        let info = 375 + HEADS[0];
        let center = [500_000.0, 4_000_000.0, 0.0, self.half as f64 / 100.0, 1.0f64];
        center.iter().enumerate().for_each(|(i, number)| put(info + 8 * i, &number.to_le_bytes()));
        put(info + 40, &(first as u64).to_le_bytes());
        put(info + 48, &(32 * shallow.len() as u64).to_le_bytes());
    }
}

/// Adds to the number of `size` bytes at `at`.
fn add_to(bytes: &mut [u8], at: usize, added: u64, size: usize) {
    let mut number = [0; 8];
    number[..size].copy_from_slice(&bytes[at..at + size]);
    let sum = u64::from_le_bytes(number) + added;
    bytes[at..at + size].copy_from_slice(&sum.to_le_bytes()[..size]);
}

/// Returns the head of a record after its first two bytes.
fn record_head(user: &str, id: u16, size: usize, head: usize) -> Vec<u8> {
    let mut bytes = vec![0; head - 2];
    bytes[..user.len()].copy_from_slice(user.as_bytes());
    bytes[16..18].copy_from_slice(&id.to_le_bytes());
    let length = if head == HEADS[0] { 2 } else { 8 };
    bytes[18..18 + length].copy_from_slice(&size.to_le_bytes()[..length]);
    bytes
}

/// Returns the bytes of a COPC file as those of a LAZ file without an octree: the octree's records are strange to readers.
pub(crate) fn without_octree(copc: &[u8]) -> Vec<u8> {
    let mut bytes = copc.to_vec();
    bytes[377..381].copy_from_slice(b"none");
    bytes
}
