//! Point clouds in: what a file holds, and its points on the lattice, piece by piece.
//!
//! [`open`] looks at one file and gives a [`Source`]; its pieces are decoded independently on any thread. On the way every
//! record passes the [`Rules`], and the [`Tally`] says what became of each.

mod catch_panic;
pub mod crs;
mod file;
mod filter;
pub mod info;
mod las;
pub mod options;
mod point;
mod rules;
mod source;
pub mod text;

pub use crs::{Crs, Unit};
pub use point::Point;
pub use rules::{Rules, Tally};
pub use source::{Axis, Format, Source, open};
pub use text::TextOptions;
