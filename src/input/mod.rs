//! Point clouds in: what a file holds, and its points on the lattice, piece by piece.

mod point;

pub use point::Point;
