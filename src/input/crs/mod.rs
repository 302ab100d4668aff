//! Coordinate reference systems, as far as a terrain needs them: the units, a text for readers, and whether two systems agree.
//! This room knows no files: the readers of file formats hand it the records that describe the system.

pub(crate) mod area_of_projection;
pub(crate) mod area_of_use;
pub(crate) mod choice;
pub(crate) mod codes;
pub(crate) mod crs_name;
pub(crate) mod datum;
pub(crate) mod datum_names;
pub(crate) mod doubts;
pub(crate) mod form;
pub(crate) mod from_records;
pub(crate) mod from_wkt;
pub(crate) mod geokeys;
pub(crate) mod geotiff;
pub(crate) mod geotiff_esri;
#[cfg(test)]
mod geotiff_tests;
pub(crate) mod geotiff_text;
pub(crate) mod plausible;
pub(crate) mod proj4;
pub(crate) mod projection;
pub(crate) mod projection_names;
pub(crate) mod rectangle;
pub(crate) mod system;
pub(crate) mod target;
pub(crate) mod transform;
pub(crate) mod unit;
pub(crate) mod vertical;
pub(crate) mod wkt;
