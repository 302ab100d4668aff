//! `contours.gpkg`: lines as a GeoPackage (OGC 12-128r18), an SQLite database of one layer.
//!
//! The bytes are written here and not by SQLite. A job changes files only through `sys::disk`, so that tests can watch it, and SQLite does not
//! let others write for it; its bytes depend on its version; and it takes several times as long, most of all for the spatial index. What is
//! written is the least that makes a database: tables whose rows come in ascending order, indexes of a few rows, and the nodes of the R-tree
//! packed in the order of the lines. Tests read it with SQLite.

pub mod lines;

mod btree;
mod page_file;
mod record;
mod schema;
mod spatial_index;

#[cfg(test)]
mod tests;
