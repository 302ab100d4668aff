//! Writing `terrain.pmtiles`.

use crate::durable::atomic_file::{PendingFile, create_folder_of};
use crate::durable::directory::JobDirectory;
use crate::plan::budget::working_memory;
use crate::plan::job_plan::Plan;
use crate::publish::map_tiles::check::{map_of, planned_map_tiles};
use crate::publish::map_tiles::raster_cells::{CellFile, RasterCells};
use crate::publish::map_tiles::waiting_tiles::WaitingTiles;
use crate::publish::map_tiles::web_map::WebMap;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sys::{Error, Result, disk};
use tiles::file_names::raster_uri;
use tiles::map_tiles::TILE;
use tiles::map_tiles::archive::ArchiveAbout;
use tiles::map_tiles::drawing::TileDrawing;
use tiles::map_tiles::encoding::HeightEncoding;
use tiles::map_tiles::filling::halved;
use tiles::map_tiles::image::picture;
use tiles::map_tiles::tile_id::MapTile;
use tiles::raster::BLOCK;
use tiles::raster::grid::RasterGrid;
use tiles::raster::options::RasterOptions;
use tiles::raster::products::RasterProduct;

/// The tiles below one of this many levels above the finest are made on all threads.
const MOST_LEVELS: u8 = 3;

/// The blocks of the raster, and the tiles that wait for the one above them, may each take this part of the memory for work.
const SHARE: u64 = 8;

/// Bytes of a block of the raster.
const BLOCK_BYTES: u64 = (BLOCK * BLOCK * size_of::<f32>()) as u64;

/// Bytes of a tile that waits for the one above it, as that needs it.
const WAITING_BYTES: u64 = (TILE * TILE / 4 * size_of::<f64>()) as u64;

/// Blocks that are kept at least and at most.
const KEPT: [u64; 2] = [8, 256];

/// What came of map tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapTileStats {
    /// What the colours of a pixel mean.
    pub encoding: HeightEncoding,
    /// The finest zoom. The coarsest is 0.
    pub max_zoom: u8,
    /// The tiles of all zooms.
    pub tiles: u64,
    /// Bytes of the file.
    pub bytes: u64,
}

/// Map tiles that are to be written.
pub(crate) struct MapTileWork<'a> {
    plan: &'a Plan,
    options: RasterOptions,
    encoding: HeightEncoding,
    grid: &'a RasterGrid,
    map: WebMap,
}

/// What an archive says of itself, as JSON.
#[derive(Serialize)]
struct Metadata {
    name: &'static str,
    description: &'static str,
    r#type: &'static str,
    format: &'static str,
    encoding: &'static str,
    #[serde(rename = "tileSize")]
    tile_size: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    attribution: Option<String>,
}

impl<'a> MapTileWork<'a> {
    /// Looks at what is to be done for a job whose raster has the cells of `grid`; `None` if the user wants no map tiles.
    ///
    /// # Errors
    /// [`Error::Config`] if the raster does not lie on a web map.
    pub(crate) fn of(plan: &'a Plan, grid: &'a RasterGrid) -> Result<Option<MapTileWork<'a>>> {
        let Some(options) = plan.options.output.raster else { return Ok(None) };
        let Some(encoding) = options.pmtiles else { return Ok(None) };
        Ok(Some(MapTileWork { plan, options, encoding, grid, map: map_of(plan, grid)? }))
    }

    /// Returns the number of tiles to draw.
    pub(crate) fn tiles(&self) -> u64 {
        self.map.finest_tiles()
    }

    /// Writes the tiles from the raster, whose files must have their names. Calls `done` for each of the [tiles](MapTileWork::tiles).
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a file, [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        directory: &JobDirectory,
        done: &(dyn Fn() + Sync),
    ) -> Result<(MapTileStats, Vec<PendingFile>)> {
        let path = directory.output().map_tiles();
        create_folder_of(&path)?;
        let waiting = WaitingTiles::create(&directory.scratch("map.tiles"))?;
        let memory = working_memory(&self.plan.options);
        let cells = RasterCells::new(self.options, self.files(directory)?, kept_blocks(memory) as usize);
        let way = |pixel: [f64; 2]| self.map.cell_of_pixel(pixel);
        let drawing = TileDrawing {
            size: self.grid.size(),
            source: &cells,
            way: &way,
            metres: self.plan.frame.extras().metres_per_unit_z,
        };
        let pyramid = MapPyramid {
            map: &self.map,
            drawing,
            encoding: self.encoding,
            waiting: &waiting,
            levels: parallel_levels(memory),
            done,
        };
        pyramid.tile(MapTile::WORLD)?;
        let about = ArchiveAbout {
            max_zoom: self.map.max_zoom,
            bounds: self.map.bounds,
            center_zoom: self.map.center_zoom(),
            metadata: self.metadata()?,
        };
        let (tiles, file) = waiting.write(&about, &path)?;
        let (encoding, max_zoom) = (self.encoding, self.map.max_zoom);
        Ok((MapTileStats { encoding, max_zoom, tiles, bytes: file.bytes }, vec![file]))
    }

    /// Returns the files of the raster.
    fn files(&self, directory: &JobDirectory) -> Result<Vec<CellFile>> {
        let (output, side) = (directory.output(), self.options.cells_per_file);
        let file = |(number, cells)| {
            let path = match side {
                None => Some(output.raster(RasterProduct::Height)),
                Some(_) => {
                    let path = output.directory().join(raster_uri(RasterProduct::Height, number));
                    disk::exists(&path).map_err(Error::io("read", &path))?.then_some(path)
                }
            };
            Ok(CellFile { path, cells })
        };
        self.grid.files(side).into_iter().enumerate().map(file).collect()
    }

    fn metadata(&self) -> Result<String> {
        let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let metadata = Metadata {
            name: "terrain",
            description: "heights in metres, as colours",
            r#type: "overlay",
            format: "png",
            encoding: self.encoding.maplibre_name(),
            tile_size: TILE,
            // Maps show it as HTML.
            attribution: self.plan.options.output.copyright().map(escaped),
        };
        serde_json::to_string(&metadata).map_err(|error| Error::Broken(error.to_string()))
    }
}

/// What the tiles of all zooms are made with.
struct MapPyramid<'a> {
    map: &'a WebMap,
    drawing: TileDrawing<'a>,
    encoding: HeightEncoding,
    waiting: &'a WaitingTiles,
    /// Levels above the finest whose tiles are made on all threads.
    levels: u8,
    done: &'a (dyn Fn() + Sync),
}

impl MapPyramid<'_> {
    /// Makes a tile and all below it. Returns its heights as the tile above needs them, half as fine, with NaN where there is no terrain; `None`
    /// if there is none at all.
    fn tile(&self, tile: MapTile) -> Result<Option<Vec<f64>>> {
        if !self.map.may_meet(tile) {
            return Ok(None);
        }
        let heights = match tile.zoom == self.map.max_zoom {
            true => {
                let heights = self.drawing.draw([tile.x, tile.y])?;
                (self.done)();
                heights
            }
            false => self.joined(tile)?,
        };
        let Some(heights) = heights else { return Ok(None) };
        let half = halved(&heights, TILE);
        self.waiting.add(tile, &picture(heights, self.encoding))?;
        Ok(Some(half))
    }

    /// Returns the heights of a tile from the four below it.
    fn joined(&self, tile: MapTile) -> Result<Option<Vec<f64>>> {
        let make = |child: &MapTile| self.tile(*child);
        let children = tile.children();
        let quarters: Vec<Option<Vec<f64>>> = match tile.zoom + self.levels >= self.map.max_zoom {
            true => children.par_iter().with_max_len(1).map(make).collect::<Result<_>>()?,
            false => children.iter().map(make).collect::<Result<_>>()?,
        };
        if quarters.iter().all(Option::is_none) {
            return Ok(None);
        }
        const HALF: usize = TILE / 2;
        let mut heights = vec![f64::NAN; TILE * TILE];
        for (n, quarter) in quarters.into_iter().enumerate() {
            let first = n / 2 * HALF * TILE + n % 2 * HALF;
            for (row, pixels) in quarter.iter().flat_map(|quarter| quarter.chunks_exact(HALF).enumerate()) {
                heights[first + row * TILE..][..HALF].copy_from_slice(pixels);
            }
        }
        Ok(Some(heights))
    }
}

/// Returns about how many bytes of memory map tiles take on so many threads.
pub(crate) fn map_tile_memory(plan: &Plan, threads: usize) -> u64 {
    // Heights, places and cells of a patch, colours, and as they are packed.
    const PER_THREAD: u64 = 8 << 20;
    if planned_map_tiles(plan).is_none() {
        return 0;
    }
    let memory = working_memory(&plan.options);
    let waiting = (1 << (2 * parallel_levels(memory))) * WAITING_BYTES * 2;
    kept_blocks(memory) * BLOCK_BYTES + waiting + threads as u64 * PER_THREAD
}

/// Returns the number of blocks of the raster that a job with so much memory for work keeps.
fn kept_blocks(memory: u64) -> u64 {
    (memory / SHARE / BLOCK_BYTES).clamp(KEPT[0], KEPT[1])
}

/// Returns the levels above the finest whose tiles a job with so much memory for work makes on all threads.
fn parallel_levels(memory: u64) -> u8 {
    let fits = |levels: &u8| (WAITING_BYTES << (2 * levels)) <= memory / SHARE;
    (0..=MOST_LEVELS).rev().find(fits).unwrap_or(0)
}
