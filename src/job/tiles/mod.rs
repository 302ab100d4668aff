//! Steps 5 and 6: finishing tiles and writing them.

pub mod border_normals;
pub mod dependencies;
pub mod max_edge;
pub mod write;
