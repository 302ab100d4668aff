//! Point clouds in: what a file holds, and its points on the lattice, piece by piece.
//!
//! [`open`] looks at one file and gives a [`Source`]; its pieces are decoded independently on any thread. On the way every
//! record passes the [`Rules`], and the [`Tally`] says what became of each.

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
pub use points::rules::{Rules, Tally};
pub use source::{Format, Source, open};
pub use text::options::TextOptions;
