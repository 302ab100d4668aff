//! Point clouds in: what a file holds, and its points on the lattice, chunk by chunk.
//!
//! [`open()`] looks at one file and returns a [`Source`]. Its chunks are decoded independently, on any thread. Every record passes
//! the filter, which applies the [`PointRules`], and [`PointCounts`] says what happened to the records.
//!
//! A new file format is a module of its own beside `las` and `text`, which implements `PointFormat` (`point_format.rs`), and a variant of
//! `PointData` in `source.rs`.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod decoded_chunks;
mod ept;
mod file;
pub mod histogram;
pub mod info;
mod las;
pub mod lines;
mod lists;
mod measured;
mod middle_zone;
pub mod options;
mod other_formats;
pub(crate) mod point_format;
mod points;
mod read_ahead;
mod remote;
pub mod samples;
mod source;
mod source_transform;
mod stated_crs;
pub mod surface;
pub mod surface_warnings;
mod text;
pub mod transform_sources;
mod transform_warnings;
pub mod transformation;
mod windows_1252;

pub use decoded_chunks::DecodedChunks;
pub use ept::name::is_ept;
pub use file::random_access::{not_a_file, open_bytes};
pub use las::classified::{ClassifiedRecord, write_classified};
pub use lists::listed_cloud::{ListedBox, ListedCloud};
pub use lists::listed_clouds;
pub use measured::{MeasuredPoints, PlausiblePoints};
pub use points::axis::Axis;
pub use points::counts::PointCounts;
pub use points::extremes::Extremes;
pub use points::kept_heights::KeptHeights;
pub use points::nodata::{SuspectHeight, is_nodata_beside, shown_height, who_has};
pub use points::nodata_choice::NodataChoice;
pub use points::nodata_number::is_number_in_steps;
pub use points::optional_fields::OptionalFields;
pub use points::point::Point;
pub use points::raw_bounds::RawBounds;
pub use points::raw_box::RawBox;
pub use points::returns::KeptReturns;
pub use points::rules::PointRules;
pub use read_ahead::ReadAhead;
pub use remote::files::{remote_files, set_network_memory};
pub use remote::name::{is_url, public_name};
pub use remote::traffic::NetworkTraffic;
pub use source::{FileFormat, Source, open, open_chosen};
pub use text::options::TextOptions;
pub use text::outliers::Outliers;
pub use text::outliers::{Middle, plausible_box};
pub use text::row_box::RowBox;
pub use text::row_choice::{RowChoice, TextReading};
