//! Steps 5 and 6: finishes the normals on the borders of tiles, and writes the tiles.

pub mod border_normals;
pub mod curve;
pub mod dependencies;
pub mod hull_slivers;
pub mod max_edge;
pub mod seam;
pub mod style;
pub(crate) mod tile_content;
pub mod write_tile;
