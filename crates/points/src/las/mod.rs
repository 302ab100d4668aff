//! LAS and LAZ files: headers, variable length records, and their points, compressed or not.

pub(crate) mod chunk_table;
pub(crate) mod classified;
pub(crate) mod compression;
pub(crate) mod copc;
pub(crate) mod crs_records;
pub(crate) mod header;
pub(crate) mod laszip;
pub(crate) mod layout;
pub(crate) mod laz;
pub(crate) mod laz_chunk;
pub(crate) mod uncompressed;
pub(crate) mod vlr;
