//! Steps 3 and 4: triangulates the leaves of the tree, and merges what they leave pending.

pub mod final_triangles;
pub(crate) mod ground_record;
pub(crate) mod hull_flow;
pub mod hull_rule;
pub mod leaf;
pub mod merge;
pub mod precision_limit;
pub(crate) mod selection;
pub(crate) mod selection_file;
pub mod sites;
