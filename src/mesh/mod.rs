//! The topology of a triangle mesh: which corners, which neighbours. It knows no coordinates; who needs them passes them in.

pub mod adjacency;
pub mod flip;
pub mod half_edge;
pub mod region;
