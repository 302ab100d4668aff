//! Point clouds in: what a file holds, and its points on the lattice, chunk by chunk.
//!
//! [`open`] looks at one file and gives a [`Source`]; its chunks are decoded independently on any thread. On the way every
//! record passes the [`PointRules`], and the [`PointCounts`] says what became of each.

mod crs;
mod file;
pub mod info;
mod las;
pub mod options;
mod points;
mod source;
mod text;

pub use crs::system::Crs;
pub use crs::unit::Unit;
pub use points::axis::Axis;
pub use points::point::Point;
pub use points::rules::{PointCounts, PointRules};
pub use source::{FileFormat, Source, open};
pub use text::options::TextOptions;
