//! The spatial index of a layer: the R-tree of SQLite, packed in the order of the lines.

use crate::geopackage::btree::TableTree;
use crate::geopackage::page_file::PageFile;
use crate::geopackage::record::{Value, record};
use crate::geopackage::schema::{Extent, IndexTables};
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Result, Write};
use sys::disk::WriteFrom;
use sys::positional_io::read_at;

/// The most entries in a node, and the bytes of an entry and of a node.
const ENTRIES: usize = 51;
const ENTRY: usize = 24;
const NODE: usize = 4 + ENTRIES * ENTRY;

/// The number of the node at the top.
const TOP: i64 = 1;

/// Bytes that are read or written at one time.
const BUFFER: usize = 1 << 18;

/// A box as the index has it, in single precision: least x, greatest x, least y, greatest y. It holds the exact box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct IndexBox([f32; 4]);

const NOTHING: IndexBox = IndexBox([f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY]);

impl IndexBox {
    pub(super) fn of([min_x, min_y, max_x, max_y]: Extent) -> IndexBox {
        IndexBox([down(min_x), up(max_x), down(min_y), up(max_y)])
    }

    fn and(self, IndexBox(other): IndexBox) -> IndexBox {
        let IndexBox([a, b, c, d]) = self;
        IndexBox([a.min(other[0]), b.max(other[1]), c.min(other[2]), d.max(other[3])])
    }

    fn bytes(self) -> [u8; 16] {
        let IndexBox(sides) = self;
        let mut bytes = [0; 16];
        sides
            .iter()
            .zip(bytes.chunks_exact_mut(4))
            .for_each(|(side, place)| place.copy_from_slice(&side.to_be_bytes()));
        bytes
    }

    fn of_bytes(bytes: [u8; 16]) -> IndexBox {
        let side = |n: usize| f32::from_be_bytes([bytes[n], bytes[n + 1], bytes[n + 2], bytes[n + 3]]);
        IndexBox([0, 4, 8, 12].map(side))
    }
}

fn down(exact: f64) -> f32 {
    let near = exact as f32;
    if f64::from(near) > exact { near.next_down() } else { near }
}

fn up(exact: f64) -> f32 {
    let near = exact as f32;
    if f64::from(near) < exact { near.next_up() } else { near }
}

/// The boxes of all lines. They wait in a file until their number is known.
pub(super) struct IndexBoxes<'a> {
    file: &'a File,
    writer: BufWriter<WriteFrom<&'a File>>,
    count: u64,
}

impl<'a> IndexBoxes<'a> {
    /// Returns no boxes, which wait in an empty `file`.
    pub(super) fn new(file: &'a File) -> IndexBoxes<'a> {
        let writer = BufWriter::with_capacity(BUFFER, WriteFrom { file, at: 0 });
        IndexBoxes { file, writer, count: 0 }
    }

    /// Adds the box of the next line. The first line has the row 1.
    ///
    /// # Errors
    /// That of the disk.
    pub(super) fn add(&mut self, of_line: IndexBox) -> Result<()> {
        self.count += 1;
        self.writer.write_all(&of_line.bytes())
    }

    /// Writes the index.
    ///
    /// # Errors
    /// Those of the disk.
    pub(super) fn write(mut self, pages: &mut PageFile) -> Result<IndexTables> {
        self.writer.flush()?;
        let levels = self.levels()?;
        let (mut node, mut parent, mut rowid) = (TableTree::new(), TableTree::new(), TableTree::new());
        // The first nodes of each level, the lowest first. The top has number 1, and the others come after it.
        let mut firsts = Vec::new();
        let mut next = TOP + 1;
        for level in &levels {
            firsts.push(if level.len() == 1 { TOP } else { next });
            next += if level.len() == 1 { 0 } else { level.len() as i64 };
        }
        let depth = levels.len() as u16 - 1;
        // A node above the lowest level has the nodes below it.
        let inside = |level: usize, number: usize| {
            let below = levels[level - 1].iter().enumerate().skip(number * ENTRIES).take(ENTRIES);
            below.map(|(n, of_node)| (firsts[level - 1] + n as i64, *of_node)).collect::<Vec<_>>()
        };
        if depth > 0 {
            node.add(
                pages,
                TOP,
                &record(&[Value::Null, Value::Blob(&node_bytes(depth, &inside(levels.len() - 1, 0)))]),
            )?;
        }
        let mut boxes = self.read();
        for number in 0..levels[0].len() {
            let first = number as i64 * ENTRIES as i64 + 1;
            let entries: Vec<_> = (first..).zip(take(&mut boxes, self.count, number)?).collect();
            let bytes = node_bytes(0, &entries);
            let own = firsts[0] + number as i64;
            node.add(pages, own, &record(&[Value::Null, Value::Blob(&bytes)]))?;
        }
        for level in 1..levels.len() - 1 {
            for number in 0..levels[level].len() {
                let bytes = node_bytes(0, &inside(level, number));
                node.add(pages, firsts[level] + number as i64, &record(&[Value::Null, Value::Blob(&bytes)]))?;
            }
        }
        for level in 0..levels.len() - 1 {
            for number in 0..levels[level].len() {
                let above = Value::Integer(firsts[level + 1] + (number / ENTRIES) as i64);
                parent.add(pages, firsts[level] + number as i64, &record(&[Value::Null, above]))?;
            }
        }
        for line in 0..self.count as i64 {
            let leaf = Value::Integer(firsts[0] + line / ENTRIES as i64);
            rowid.add(pages, line + 1, &record(&[Value::Null, leaf]))?;
        }
        Ok(IndexTables { node: node.finish(pages)?, parent: parent.finish(pages)?, rowid: rowid.finish(pages)? })
    }

    /// Returns the boxes of the nodes of each level, the lowest first, up to one node at the top.
    fn levels(&self) -> Result<Vec<Vec<IndexBox>>> {
        let around = |boxes: &[IndexBox]| boxes.iter().copied().fold(NOTHING, IndexBox::and);
        let mut boxes = self.read();
        let leaves = (self.count as usize).div_ceil(ENTRIES).max(1);
        let leaves = (0..leaves).map(|number| Ok(around(&take(&mut boxes, self.count, number)?)));
        let mut levels = vec![leaves.collect::<Result<Vec<IndexBox>>>()?];
        while let Some(last) = levels.last().filter(|level| level.len() > 1) {
            levels.push(last.chunks(ENTRIES).map(around).collect());
        }
        Ok(levels)
    }

    fn read(&self) -> BufReader<ReadFrom<'a>> {
        BufReader::with_capacity(BUFFER, ReadFrom { file: self.file, at: 0 })
    }
}

/// Reads the boxes of the lines in leaf `number`, of `count` lines in all. Leaves must be taken in their order.
fn take(boxes: &mut impl Read, count: u64, number: usize) -> Result<Vec<IndexBox>> {
    let left = count as usize - (number * ENTRIES).min(count as usize);
    let mut next = || {
        let mut bytes = [0; 16];
        boxes.read_exact(&mut bytes)?;
        Ok(IndexBox::of_bytes(bytes))
    };
    (0..left.min(ENTRIES)).map(|_| next()).collect()
}

/// Returns a node with these entries: rows or numbers of nodes, with their boxes. `depth` is that of the tree, for the node at the top.
fn node_bytes(depth: u16, entries: &[(i64, IndexBox)]) -> [u8; NODE] {
    let mut bytes = [0; NODE];
    bytes[..2].copy_from_slice(&depth.to_be_bytes());
    bytes[2..4].copy_from_slice(&(entries.len() as u16).to_be_bytes());
    for ((number, of_entry), place) in entries.iter().zip(bytes[4..].chunks_exact_mut(ENTRY)) {
        place[..8].copy_from_slice(&number.to_be_bytes());
        place[8..].copy_from_slice(&of_entry.bytes());
    }
    bytes
}

/// Reads a file from a position on.
struct ReadFrom<'a> {
    file: &'a File,
    at: u64,
}

impl Read for ReadFrom<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let length = read_at(self.file, buffer, self.at)?;
        self.at += length as u64;
        Ok(length)
    }
}
