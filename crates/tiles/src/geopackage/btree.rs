//! B-trees of an SQLite database, whose rows come in ascending order.

use crate::geopackage::page_file::{PAGE, PageFile};
use crate::geopackage::record::add_varint;
use std::io::Result;

/// The kinds of pages.
const TABLE_INSIDE: u8 = 5;
const TABLE_LEAF: u8 = 13;
const INDEX_LEAF: u8 = 10;

/// The bytes of the head of a leaf, and of a page inside a tree.
const LEAF_HEAD: usize = 8;
const INSIDE_HEAD: usize = 12;

/// The most children of a page inside a tree: a cell takes up to 15 bytes.
const CHILDREN: usize = (PAGE - INSIDE_HEAD) / 15;

/// A table that grows at its end.
pub(super) struct TableTree {
    leaf: Cells,
    last_row: i64,
    /// For each level above the leaves, the pages that no page names yet: their numbers, and the last rows below them.
    levels: Vec<Vec<(u32, i64)>>,
}

/// Cells that are to go into one page.
#[derive(Default)]
struct Cells {
    bytes: Vec<u8>,
    /// Where each begins.
    starts: Vec<usize>,
}

impl Cells {
    /// Tells whether a cell of so many bytes has room besides, in a leaf.
    fn has_room(&self, length: usize) -> bool {
        LEAF_HEAD + 2 * (self.starts.len() + 1) + self.bytes.len() + length <= PAGE
    }

    fn add(&mut self, cell: &[u8]) {
        self.starts.push(self.bytes.len());
        self.bytes.extend_from_slice(cell);
    }

    /// Returns a page of this kind. `after` is the child after all cells of a page inside a tree. The head begins at byte `at`.
    fn page(&self, kind: u8, after: Option<u32>, at: usize) -> [u8; PAGE] {
        let mut page = [0; PAGE];
        let content = PAGE - self.bytes.len();
        page[content..].copy_from_slice(&self.bytes);
        let mut head = vec![kind, 0, 0];
        head.extend_from_slice(&(self.starts.len() as u16).to_be_bytes());
        head.extend_from_slice(&(content as u16).to_be_bytes());
        head.push(0);
        head.extend(after.into_iter().flat_map(u32::to_be_bytes));
        head.extend(self.starts.iter().flat_map(|start| ((content + start) as u16).to_be_bytes()));
        page[at..at + head.len()].copy_from_slice(&head);
        page
    }
}

impl TableTree {
    /// Returns an empty table.
    pub(super) fn new() -> TableTree {
        TableTree { leaf: Cells::default(), last_row: 0, levels: Vec::new() }
    }

    /// Adds a row. Its number must be greater than that of the row before.
    ///
    /// # Errors
    /// Those of [`PageFile`].
    pub(super) fn add(&mut self, pages: &mut PageFile, row: i64, record: &[u8]) -> Result<()> {
        let kept = kept_in_leaf(record.len());
        let mut cell = Vec::with_capacity(kept + 22);
        add_varint(&mut cell, record.len() as u64);
        add_varint(&mut cell, row.cast_unsigned());
        cell.extend_from_slice(&record[..kept]);
        if kept < record.len() {
            // The number of the first page that goes on with the row, which comes before the leaf.
            cell.extend_from_slice(&pages.next_number()?.to_be_bytes());
            add_overflow(pages, &record[kept..])?;
        }
        if !self.leaf.has_room(cell.len()) {
            self.end_leaf(pages)?;
        }
        self.leaf.add(&cell);
        self.last_row = row;
        Ok(())
    }

    fn end_leaf(&mut self, pages: &mut PageFile) -> Result<()> {
        let page = pages.add(&std::mem::take(&mut self.leaf).page(TABLE_LEAF, None, 0))?;
        self.add_child(pages, 0, (page, self.last_row))
    }

    /// Adds a page at a level, the lowest of which is 0.
    fn add_child(&mut self, pages: &mut PageFile, level: usize, child: (u32, i64)) -> Result<()> {
        if level == self.levels.len() {
            self.levels.push(Vec::new());
        }
        let waiting = &mut self.levels[level];
        waiting.push(child);
        // At least two stay, so that no page has a single child.
        if waiting.len() < CHILDREN + 2 {
            return Ok(());
        }
        let full: Vec<_> = waiting.drain(..CHILDREN).collect();
        self.end_inside(pages, level, &full)
    }

    fn end_inside(&mut self, pages: &mut PageFile, level: usize, children: &[(u32, i64)]) -> Result<()> {
        let last = children.last().map_or(0, |(_, row)| *row);
        let page = pages.add(&inside_page(children, 0))?;
        self.add_child(pages, level + 1, (page, last))
    }

    /// Writes what is left. Returns the number of the page at the top.
    ///
    /// # Errors
    /// Those of [`PageFile`].
    pub(super) fn finish(mut self, pages: &mut PageFile) -> Result<u32> {
        let top = self.top(pages)?;
        match top[..] {
            [(only, _)] => Ok(only),
            _ => pages.add(&inside_page(&top, 0)),
        }
    }

    /// Writes what is left but for the page at the top. Returns that: the first page of the file, without its head of 100 bytes.
    ///
    /// # Errors
    /// Those of [`PageFile`].
    pub(super) fn finish_as_first(mut self, pages: &mut PageFile) -> Result<[u8; PAGE]> {
        let top = self.top(pages)?;
        Ok(inside_page(&top, 100))
    }

    /// Returns the pages below the top one: one to `CHILDREN + 1`.
    fn top(&mut self, pages: &mut PageFile) -> Result<Vec<(u32, i64)>> {
        if !self.leaf.starts.is_empty() || self.levels.is_empty() {
            self.end_leaf(pages)?;
        }
        let mut level = 0;
        while level + 1 < self.levels.len() {
            let left = std::mem::take(&mut self.levels[level]);
            self.end_inside(pages, level, &left)?;
            level += 1;
        }
        Ok(self.levels.pop().unwrap_or_default())
    }
}

/// Returns a page inside a table. There is room for `CHILDREN + 1` of them.
fn inside_page(children: &[(u32, i64)], at: usize) -> [u8; PAGE] {
    let mut cells = Cells::default();
    let Some(((last, _), before)) = children.split_last() else { return [0; PAGE] };
    for (page, row) in before {
        let mut cell = page.to_be_bytes().to_vec();
        add_varint(&mut cell, row.cast_unsigned());
        cells.add(&cell);
    }
    cells.page(TABLE_INSIDE, Some(*last), at)
}

/// Returns the page of an index of a few rows, which must be in the order of SQLite.
///
/// # Errors
/// Those of [`PageFile`].
pub(super) fn add_index(pages: &mut PageFile, records: &[Vec<u8>]) -> Result<u32> {
    let mut cells = Cells::default();
    for record in records {
        let mut cell = Vec::new();
        add_varint(&mut cell, record.len() as u64);
        cell.extend_from_slice(record);
        cells.add(&cell);
    }
    pages.add(&cells.page(INDEX_LEAF, None, 0))
}

/// Returns how many bytes of a row of so many stay in its leaf.
fn kept_in_leaf(length: usize) -> usize {
    const MOST: usize = PAGE - 35;
    const LEAST: usize = (PAGE - 12) * 32 / 255 - 23;
    if length <= MOST {
        return length;
    }
    let rest = LEAST + (length - LEAST) % (PAGE - 4);
    if rest <= MOST { rest } else { LEAST }
}

/// Adds pages that hold the rest of a row, each of which names the next.
fn add_overflow(pages: &mut PageFile, rest: &[u8]) -> Result<()> {
    let mut left = rest.chunks(PAGE - 4).peekable();
    let mut number = pages.next_number()?;
    while let Some(bytes) = left.next() {
        let next = if left.peek().is_some() { PageFile::after(number) } else { 0 };
        let mut page = [0; PAGE];
        page[..4].copy_from_slice(&next.to_be_bytes());
        page[4..4 + bytes.len()].copy_from_slice(bytes);
        pages.add(&page)?;
        number = next;
    }
    Ok(())
}
