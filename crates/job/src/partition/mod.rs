//! Step 2: reads the points of all inputs once, and cuts the plane into tiles of about equally many.

pub(crate) mod breakline_points;
pub(crate) mod bucket_sorter;
pub mod buckets;
pub mod grid;
pub mod part_points;
pub mod parts;
pub mod point_file;
pub mod read;
pub mod result;
pub mod tree;
pub mod tree_builder;
