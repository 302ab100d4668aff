//! Steps 3 and 4: triangulates the leaves of the tree, and merges what they leave pending.

pub mod final_triangles;
pub mod leaf;
pub mod merge;
pub mod precision_limit;
pub mod sites;
