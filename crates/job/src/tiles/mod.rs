//! Steps 5 and 6: finishes the normals on the borders of tiles, and writes the tiles.

pub(crate) mod appearance;
pub(crate) mod border_normals;
pub(crate) mod clip_rule;
pub(crate) mod curve;
pub(crate) mod dependencies;
pub(crate) mod hull_slivers;
pub(crate) mod max_edge;
pub(crate) mod seam;
pub(crate) mod style;
pub(crate) mod tile_content;
pub(crate) mod vertex_colors;
pub(crate) mod write_tile;
