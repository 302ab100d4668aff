//! What step 8 has written.

use crate::levels::make_level::LevelStats;
use crate::publish::contours::write_contours::ContourStats;
use crate::publish::exports::write_exports::ExportedFile;
use crate::publish::map_tiles::write_map_tiles::MapTileStats;
use crate::publish::raster::write_raster::RasterStats;
use crate::publish::terrain_tiles::write_terrain::TerrainStats;
use crate::tiles::vertex_colors::ColorSource;
use sys::Warnings;

/// What step 8 has written.
#[derive(Default)]
pub(crate) struct Published {
    /// Bytes of the results besides the tiles.
    pub bytes: u64,
    /// The sum over all coarser tiles.
    pub levels: LevelStats,
    /// The raster of heights.
    pub raster: Option<RasterStats>,
    /// The map tiles of heights.
    pub map_tiles: Option<MapTileStats>,
    /// The contour lines.
    pub contours: Option<ContourStats>,
    /// The mesh for other programs.
    pub exports: Vec<ExportedFile>,
    /// The terrain tiles for globes.
    pub terrain: Option<TerrainStats>,
    /// What gives vertices their colours.
    pub vertex_colors: ColorSource,
    /// What the user should know about the results.
    pub warnings: Warnings,
}
