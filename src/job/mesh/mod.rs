//! Steps 3 and 4: triangulating leaves and merging what they leave open.

pub mod final_triangles;
pub mod leaf;
pub mod merge;
pub mod precision_limit;
pub mod sites;
