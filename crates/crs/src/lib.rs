//! Coordinate reference systems, as far as a terrain needs them: the units, a text for readers, and whether two systems agree.
//! This crate knows no files: the readers of file formats hand it the records that describe the system.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub(crate) mod area_of_projection;
pub mod area_of_use;
pub mod choice;
pub(crate) mod codes;
pub mod crs_name;
pub mod datum;
pub(crate) mod datum_names;
pub(crate) mod form;
pub mod from_records;
pub mod from_wkt;
pub mod geoid;
pub mod geokeys;
pub(crate) mod geotiff;
pub(crate) mod geotiff_esri;
#[cfg(test)]
mod geotiff_tests;
pub(crate) mod geotiff_text;
pub mod plausible;
pub(crate) mod problems;
pub(crate) mod proj4;
pub(crate) mod projection;
pub(crate) mod projection_names;
pub mod rectangle;
pub mod system;
pub mod target;
pub mod transform;
pub mod unit;
pub mod vertical;
pub(crate) mod wkt;

pub use area_of_use::{AreaOfUse, arc};
pub use choice::CrsChoice;
pub use datum::Sameness;
pub use rectangle::turned;
pub use system::{ComparableCrs, Crs, CrsKind};
pub use target::{NamedCrs, TargetCrs};
pub use transform::between::CrsTransform;
pub use transform::between::DatumNote;
pub use transform::datum_rule::DatumRule;
pub use transform::to_globe::GlobeWay;
pub use transform::utm::utm_zone;
pub use unit::Unit;
pub use unit::same_length;
pub use vertical::VerticalSystem;
