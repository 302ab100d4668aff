//! A layer of lines.

use crate::geopackage::btree::TableTree;
use crate::geopackage::page_file::PageFile;
use crate::geopackage::record::{Value, record};
use crate::geopackage::schema::{Extent, finish};
use crate::geopackage::spatial_index::{IndexBox, IndexBoxes};
use std::fs::File;
use std::io::Result;

pub use crate::geopackage::schema::LayerAbout;

/// What a line has besides its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineAttributes {
    /// The height of all its points.
    pub height: f64,
    /// Whether maps draw it bold.
    pub is_index: bool,
    /// Whether it is a ring.
    pub is_closed: bool,
}

/// A line as its table has it.
#[derive(Clone, Debug)]
pub struct LineRow {
    record: Vec<u8>,
    extent: Extent,
    points: u64,
}

impl LineRow {
    /// Returns the row of a line with these points, in the system with this number.
    pub fn new(points: &[[f64; 2]], attributes: LineAttributes, system: i32) -> LineRow {
        let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let extent = points.iter().fold(none, |[a, b, c, d], [x, y]| [a.min(*x), b.min(*y), c.max(*x), d.max(*y)]);
        let LineAttributes { height, is_index, is_closed } = attributes;
        let geometry = geometry(points, height, extent, system);
        let values = [
            Value::Null,
            Value::Blob(&geometry),
            Value::Real(height),
            Value::Integer(is_index.into()),
            Value::Integer(is_closed.into()),
        ];
        LineRow { record: record(&values), extent, points: points.len() as u64 }
    }

    /// Returns the number of its points.
    pub fn points(&self) -> u64 {
        self.points
    }
}

/// Returns a line as GeoPackages have it: a head with its box, and well-known binary with heights.
fn geometry(points: &[[f64; 2]], height: f64, [min_x, min_y, max_x, max_y]: Extent, system: i32) -> Vec<u8> {
    const LINE_WITH_HEIGHTS: u32 = 1002;
    let mut bytes = Vec::with_capacity(49 + 24 * points.len());
    // Version 1 has the number 0; the flags say: the least byte first, and a box of x and y.
    bytes.extend_from_slice(&[b'G', b'P', 0, 3]);
    bytes.extend_from_slice(&system.to_le_bytes());
    [min_x, max_x, min_y, max_y].iter().for_each(|side| bytes.extend_from_slice(&side.to_le_bytes()));
    bytes.push(1);
    bytes.extend_from_slice(&LINE_WITH_HEIGHTS.to_le_bytes());
    bytes.extend_from_slice(&(points.len() as u32).to_le_bytes());
    for [x, y] in points {
        [x, y, &height].into_iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
    bytes
}

/// A GeoPackage that is being written.
pub struct LineLayer<'a> {
    about: LayerAbout<'a>,
    pages: PageFile<'a>,
    table: TableTree,
    boxes: IndexBoxes<'a>,
    extent: Option<Extent>,
    rows: i64,
}

impl<'a> LineLayer<'a> {
    /// Begins a GeoPackage in an empty `file`. `boxes` is an empty file for what waits until all lines are known.
    pub fn new(file: &'a File, boxes: &'a File, about: LayerAbout<'a>) -> LineLayer<'a> {
        LineLayer {
            about,
            pages: PageFile::new(file),
            table: TableTree::new(),
            boxes: IndexBoxes::new(boxes),
            extent: None,
            rows: 0,
        }
    }

    /// Adds a line.
    ///
    /// # Errors
    /// That of the disk.
    pub fn add(&mut self, row: &LineRow) -> Result<()> {
        self.rows += 1;
        self.table.add(&mut self.pages, self.rows, &row.record)?;
        let [a, b, c, d] = self.extent.unwrap_or(row.extent);
        let [min_x, min_y, max_x, max_y] = row.extent;
        self.extent = Some([a.min(min_x), b.min(min_y), c.max(max_x), d.max(max_y)]);
        self.boxes.add(IndexBox::of(row.extent))
    }

    /// Writes the index and all other tables. Returns the number of lines.
    ///
    /// # Errors
    /// That of the disk.
    pub fn finish(mut self) -> Result<u64> {
        let layer = self.table.finish(&mut self.pages)?;
        let index = self.boxes.write(&mut self.pages)?;
        finish(self.pages, &self.about, self.extent, layer, &index)?;
        Ok(self.rows.unsigned_abs())
    }
}
