//! Files of lines in: the features of Shapefiles, GeoPackages and GeoJSON, which become breaklines.
//!
//! [`read_lines()`] reads one file whole. Each format has a file of its own, which hands its features to the one collector in
//! `collector.rs`. So all formats have the same rules for kinds, heights and broken geometry.

mod attribute;
mod collector;
mod dbf;
mod encoding;
mod feature;
mod geojson;
mod geojson_geometry;
mod geojson_properties;
mod geopackage;
mod guarded_sqlite;
mod lake_rings;
pub mod line_crs;
mod open;
pub mod options;
mod polygons;
mod shapefile;
mod wkb;

pub use feature::{LineFeature, LineFile, LineShape};
pub use open::{files_of_lines, is_side_file, read_lines};
