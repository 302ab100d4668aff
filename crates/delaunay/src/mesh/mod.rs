//! The topology of a triangle mesh: the corners and neighbours of its triangles. Functions that need coordinates take them as an
//! argument.

pub mod adjacency;
pub mod flip;
pub mod half_edge;
pub mod index;
pub mod insert;
pub mod region;
pub mod triangle_order;
