//! The index of a COPC file (COPC 1.0): an octree whose nodes are the LAZ chunks. It tells where the points of a chunk lie, so that bounds
//! need only some of them.
//!
//! The octree is a claim of the file, so it is checked as far as that takes little. It must name every chunk once, with as many bytes and
//! points as the table of chunks says. The first points of some chunks must lie in their nodes. And while chunks are decoded, every
//! point is compared with its node. What stays a matter of trust are the points of chunks that are not decoded, but for the first.

use std::ops::Range;

use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::las::chunk_table::LazChunk;
use crate::las::header::LasHeader;
use crate::las::vlr::Vlr;
use crate::points::octree::{MOST_LEVELS, cell_of};
use crate::points::raw_bounds::RawBounds;
use sys::bytes::{float64, int32, uint64};
use sys::{Error, Result, Warnings};

/// The user and the number of the record that describes the octree.
const USER: &str = "copc";
const INFO: u16 = 1;

/// The number of the record that usually holds all pages.
const PAGES: u16 = 1000;

/// The bytes of that record up to the position and the size of the first page.
const INFO_BYTES: usize = 56;

/// The bytes of an entry of a page.
const ENTRY: usize = 32;

/// The most entries for each chunk: a node without points stands above one with points.
const MOST_ENTRIES: u64 = 2 * MOST_LEVELS as u64;

/// The chunks of which the first point is looked at.
const CHECKED_CHUNKS: usize = 1000;

/// As many of a file of another machine, where each takes a request.
const CHECKED_REMOTE_CHUNKS: usize = 16;

/// Why an octree is not used.
#[derive(Debug, thiserror::Error)]
enum IndexError {
    #[error("has {0} bytes in its first record, of at least {INFO_BYTES}")]
    Info(usize),
    #[error("has an invalid cube: half a side of {0} around {1}, {2}")]
    Cube(f64, f64, f64),
    #[error("leads to a page of {size} bytes at byte {at}, which is none")]
    Page { at: u64, size: u64 },
    #[error("has more entries than {0} chunks can have, or leads in a circle")]
    TooManyEntries(usize),
    #[error("has the node {0:?} (level, x, y, z), which lies outside the octree")]
    Node([i32; 4]),
    #[error("has {points} points in {bytes} bytes at byte {at} for the node {node}, and the table of chunks has not")]
    NoChunk { node: Node, at: u64, bytes: i64, points: i64 },
    #[error("has the chunk at byte {0} twice")]
    Twice(u64),
    #[error("has no node for {0} of the chunks")]
    NoNode(usize),
    #[error("has point {point} in the node {node}, where it does not lie")]
    Misplaced { point: u64, node: Node },
    /// The file cannot be read. This says nothing about the octree.
    #[error(transparent)]
    Unreadable(#[from] Error),
}

type Found<T> = std::result::Result<T, IndexError>;

/// The place of a node in the octree: its level, and its number there along x and y. All nodes above each other in z are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Node(u32, u32, u32);

impl std::fmt::Display for Node {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}-{}-{}", self.0, self.1, self.2)
    }
}

/// Where the points of each LAZ chunk lie, as the octree of the file says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CopcIndex {
    /// The least x and y of the cube, in raw steps.
    min: [f64; 2],
    /// Its side along x and y, likewise.
    side: [f64; 2],
    /// The node of each LAZ chunk of the file, by its number.
    nodes: Vec<Node>,
}

/// The record that describes the octree.
struct Info {
    /// The middle of the cube in x and y.
    center: [f64; 2],
    half: f64,
    /// The first page.
    root: Range<u64>,
}

impl CopcIndex {
    /// Reads the index of a file with these chunks; `None` if it has none. One that is wrong is left aside with a warning.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read.
    pub(crate) fn read(
        file: &RandomAccessFile,
        header: &LasHeader,
        vlrs: &[Vlr],
        chunks: &[LazChunk],
        warnings: &mut Warnings,
    ) -> Result<Option<CopcIndex>> {
        let Some(record) = vlrs.iter().find(|vlr| vlr.is(USER, INFO)) else { return Ok(None) };
        file.hold(vlrs.iter().filter(|vlr| vlr.is(USER, PAGES)).map(Vlr::bytes))?;
        match CopcIndex::checked(file, header, &record.read(file)?, chunks) {
            Ok(index) => Ok(Some(index)),
            Err(IndexError::Unreadable(error)) => Err(error),
            Err(damage) => {
                warnings.push(format!(
                    "its octree (COPC) {damage}: all points are read, to find those within [input] bounds"
                ));
                Ok(None)
            }
        }
    }

    fn checked(file: &RandomAccessFile, header: &LasHeader, record: &[u8], chunks: &[LazChunk]) -> Found<CopcIndex> {
        let info = Info::parse(record, file.size())?;
        let float = |axis: usize| {
            let axis = header.axes[axis];
            [axis.offset, axis.scale].map(|number| number.to_f64().unwrap_or(f64::NAN))
        };
        let [[x0, step_x], [y0, step_y]] = [float(0), float(1)];
        let index = CopcIndex {
            min: [(info.center[0] - info.half - x0) / step_x, (info.center[1] - info.half - y0) / step_y],
            side: [2.0 * info.half / step_x, 2.0 * info.half / step_y],
            nodes: nodes_of_chunks(file, info.root, chunks)?,
        };
        if index.min.iter().chain(&index.side).any(|number| !number.is_finite()) {
            return Err(IndexError::Cube(info.half, info.center[0], info.center[1]));
        }
        index.check_first_points(file, chunks)?;
        Ok(index)
    }

    /// Returns what the points of a LAZ chunk lie within.
    pub(crate) fn cell(&self, chunk: &LazChunk) -> Option<RawBounds> {
        let &Node(level, x, y) = self.nodes.get(chunk.number)?;
        Some(cell_of(self.min, self.side, level.min(MOST_LEVELS), [x, y]))
    }

    /// Looks at the first point of chunks at equal distances. A chunk begins with it, and it is not compressed.
    fn check_first_points(&self, file: &RandomAccessFile, chunks: &[LazChunk]) -> Found<()> {
        let most = if file.is_remote() { CHECKED_REMOTE_CHUNKS } else { CHECKED_CHUNKS };
        let place_of = |chunk: &LazChunk| chunk.bytes.start..(chunk.bytes.start + 8).min(chunk.bytes.end);
        let step = chunks.len().div_ceil(most).max(1);
        file.hold(chunks.iter().step_by(step).map(place_of))?;
        for chunk in chunks.iter().step_by(step) {
            let bytes = file.bytes(place_of(chunk))?;
            let is_inside = bytes.len() == 8 && self.cell(chunk).is_some_and(|cell| cell.hold(&place(&bytes)));
            if !is_inside {
                return Err(IndexError::Misplaced { point: chunk.first, node: self.nodes[chunk.number] });
            }
        }
        Ok(())
    }
}

/// Returns the raw x and y at the beginning of a record.
pub(crate) fn place(record: &[u8]) -> [i64; 3] {
    [int32(record, 0).into(), int32(record, 4).into(), 0]
}

impl Info {
    fn parse(record: &[u8], file_size: u64) -> Found<Info> {
        if record.len() < INFO_BYTES {
            return Err(IndexError::Info(record.len()));
        }
        let ([x, y], half) = ([0, 8].map(|at| float64(record, at)), float64(record, 24));
        if !(x.is_finite() && y.is_finite() && half.is_finite() && half > 0.0) {
            return Err(IndexError::Cube(half, x, y));
        }
        Ok(Info { center: [x, y], half, root: page(uint64(record, 40), uint64(record, 48), file_size)? })
    }
}

/// Returns the bytes of a page.
fn page(at: u64, size: u64, file_size: u64) -> Found<Range<u64>> {
    let end = at.checked_add(size).filter(|end| *end <= file_size && size.is_multiple_of(ENTRY as u64));
    Ok(at..end.ok_or(IndexError::Page { at, size })?)
}

/// Returns the node of every chunk. All pages are read, from that at `root` on.
fn nodes_of_chunks(file: &RandomAccessFile, root: Range<u64>, chunks: &[LazChunk]) -> Found<Vec<Node>> {
    let mut nodes: Vec<Option<Node>> = vec![None; chunks.len()];
    let mut pages = vec![root];
    let mut entries_left = (chunks.len() as u64 + 1) * MOST_ENTRIES;
    while let Some(range) = pages.pop() {
        let entries = (range.end - range.start) / ENTRY as u64;
        // A circle would never end.
        entries_left = entries_left.checked_sub(entries.max(1)).ok_or(IndexError::TooManyEntries(chunks.len()))?;
        for entry in file.bytes(range)?.chunks_exact(ENTRY) {
            let (at, bytes, points) = (uint64(entry, 16), int32(entry, 24) as i64, int32(entry, 28) as i64);
            match points {
                -1 => pages.push(page(at, bytes.max(0) as u64, file.size())?),
                0 => {}
                _ => {
                    let node = node(entry)?;
                    let number = chunks.binary_search_by_key(&at, |chunk| chunk.bytes.start).ok();
                    let is_same = |number: &usize| {
                        let LazChunk { count, bytes: range, .. } = &chunks[*number];
                        (*count as i64, (range.end - range.start) as i64) == (points, bytes)
                    };
                    let Some(number) = number.filter(is_same) else {
                        return Err(IndexError::NoChunk { node, at, bytes, points });
                    };
                    if nodes[number].replace(node).is_some() {
                        return Err(IndexError::Twice(at));
                    }
                }
            }
        }
    }
    let missing = nodes.iter().filter(|node| node.is_none()).count();
    if missing > 0 { Err(IndexError::NoNode(missing)) } else { Ok(nodes.into_iter().flatten().collect()) }
}

/// Returns the place of the node of an entry.
fn node(entry: &[u8]) -> Found<Node> {
    let key @ [level, x, y, z] = [0, 4, 8, 12].map(|at| int32(entry, at));
    let is_within = |number: i32| number >= 0 && (number as u64) < 1 << level;
    let is_node = (0..=MOST_LEVELS as i32).contains(&level) && is_within(x) && is_within(y) && is_within(z);
    if is_node { Ok(Node(level as u32, x as u32, y as u32)) } else { Err(IndexError::Node(key)) }
}
