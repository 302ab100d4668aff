//! When a terrain fits one file.

use crate::progress::number_text::grouped;
use crate::tiles::write_tile::TileStats;

/// Viewers do not open a single file with more triangles.
pub(crate) const MAX_TRIANGLES_IN_ONE_FILE: u64 = 20_000_000;
/// Each tile is a node with a mesh of its own: with more of them their description would fill the memory.
const MAX_TILES_IN_ONE_FILE: u64 = 4096;

/// Tells whether `terrain.glb` can hold all tiles.
pub(crate) fn fits_one_file(written: &TileStats) -> bool {
    written.triangles <= MAX_TRIANGLES_IN_ONE_FILE && written.files <= MAX_TILES_IN_ONE_FILE
}

/// Returns the warning for a terrain that does not fit the one file that the user wants.
pub(crate) fn too_large_for_one_file(written: &TileStats) -> String {
    format!(
        "tileset.json is written instead of terrain.glb: {} triangles in {} tiles are more than viewers open as one file; fix: {}",
        grouped(written.triangles),
        grouped(written.files),
        match written.triangles > MAX_TRIANGLES_IN_ONE_FILE {
            true => "[input] bounds or classes for a smaller terrain",
            false => "a greater [triangulation] max_points_per_tile for fewer tiles",
        }
    )
}
