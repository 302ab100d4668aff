//! Writing `terrain.tif`.

use crate::durable::atomic_file::{PendingFile, create_folder_of, write_pending};
use crate::durable::directory::JobDirectory;
use crate::index::TileIndex;
use crate::plan::budget::working_memory;
use crate::plan::job_plan::Plan;
use crate::publish::raster::check::{grid_over, planned_raster};
use crate::publish::raster::nodata_heights::NodataPoints;
use crate::publish::raster::pyramid::{Pyramid, TileCells};
use crate::publish::raster::system::{system_of, system_warning};
use crate::publish::raster::tile_meshes::{TileBox, boxes, lattice_mesh};
use crate::publish::raster::waiting_blocks::WaitingBlocks;
use crate::publish::side_files::EachTile;
use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use std::sync::atomic::AtomicU64;
use sys::{Error, Result};
use tiles::file_names::raster_uri;
use tiles::frame::Frame;
use tiles::raster::BLOCK;
use tiles::raster::block::packed;
use tiles::raster::file_list::{ListedFile, RasterList};
use tiles::raster::geotiff::{RasterHead, head};
use tiles::raster::grid::{RasterGrid, blocks};
use tiles::raster::options::RasterOptions;
use tiles::raster::window::{HeightScale, LatticeMesh, Window};

/// The most levels that are drawn in one window, whose side is 512 times two to the power of this.
const HIGHEST_WINDOW: usize = 3;

/// A window, with its overviews, may take this part of the memory for work.
const WINDOW_SHARE: u64 = 4;

/// What came of a raster.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct RasterStats {
    /// Columns and rows.
    pub size: [u32; 2],
    /// The number of GeoTIFF files.
    pub files: u64,
    /// Bytes of these files, and of the list of them if there are several.
    pub bytes: u64,
    /// Cells with a height.
    pub heights: u64,
    /// Those of them whose height is just the number for none.
    pub same_as_nodata: u64,
}

impl AddAssign for RasterStats {
    fn add_assign(&mut self, other: RasterStats) {
        self.files += other.files;
        self.heights += other.heights;
        self.same_as_nodata += other.same_as_nodata;
    }
}

/// A file of a raster.
struct RasterPart {
    /// Its path from the output directory, in a grid of files.
    uri: Option<String>,
    /// The columns and the rows of the raster that it has, each as the first and the one after the last.
    cells: [[u32; 2]; 2],
    grid: RasterGrid,
}

/// A raster that is to be written.
pub(crate) struct RasterWork<'a> {
    plan: &'a Plan,
    options: RasterOptions,
    frame: &'a Frame,
    grid: RasterGrid,
    boxes: Vec<TileBox>,
    /// The tiles that may cover a cell.
    tiles: Vec<TileCells>,
}

impl<'a> RasterWork<'a> {
    /// Looks at what is to be done for the raster of a job whose tiles have the scene of `frame`; `None` if the user wants none.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on a store, [`Error::Config`] if there are too many cells.
    pub(crate) fn of(plan: &'a Plan, frame: &'a Frame, tiles: &dyn EachTile) -> Result<Option<RasterWork<'a>>> {
        let Some(options) = plan.options.output.raster else { return Ok(None) };
        let boxes = boxes(tiles)?;
        let all = boxes.iter().map(|tile| tile.bounds).reduce(Bounds::union);
        let all = all.ok_or_else(|| Error::Broken("there is no tile to make a raster of".into()))?;
        let grid = grid_over(plan, &options, all)?;
        let cells = |tile: &TileBox| {
            let [columns, rows] = grid.cells_within(tile.bounds);
            (columns[0] < columns[1] && rows[0] < rows[1]).then_some(TileCells { tile: tile.tile, columns, rows })
        };
        let tiles = boxes.iter().filter_map(cells).collect();
        Ok(Some(RasterWork { plan, options, frame, grid, boxes, tiles }))
    }

    /// Returns the number of blocks of the raster itself.
    pub(crate) fn blocks(&self) -> u64 {
        let of_part =
            |part: &RasterPart| blocks(part.grid.size()).into_iter().map(|count| count as u64).product::<u64>();
        self.parts().iter().map(of_part).sum()
    }

    /// Returns the files of the raster.
    fn parts(&self) -> Vec<RasterPart> {
        let side = self.options.cells_per_file;
        let parts = (0..).zip(self.grid.files(side));
        let part = |(n, cells)| RasterPart { uri: side.map(|_| raster_uri(n)), cells, grid: self.grid.part(cells) };
        parts.map(part).collect()
    }

    /// Writes the raster from the tiles, which must have their names. Calls `done` for each block that has a height.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a file, [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        directory: &JobDirectory,
        done: &(dyn Fn() + Sync),
    ) -> Result<(RasterStats, Vec<PendingFile>)> {
        let mut stats = RasterStats { size: self.grid.size(), ..RasterStats::default() };
        let (mut files, mut listed) = (Vec::new(), Vec::new());
        for part in self.parts() {
            let Some((file, figures)) = self.write_part(directory, &part, done)? else { continue };
            stats += figures;
            files.push(file);
            listed.extend(part.uri.map(|uri| ListedFile { uri, cells: part.cells }));
        }
        if self.options.cells_per_file.is_some() {
            files.push(self.write_list(directory, listed)?);
        }
        stats.bytes = files.iter().map(|file| file.bytes).sum();
        Ok((stats, files))
    }

    /// Returns the tiles that may cover cells of a file, with the cells counted from its own first.
    fn tiles_of(&self, part: &RasterPart) -> Vec<TileCells> {
        let within = |own: [u32; 2], cells: [u32; 2]| {
            let [from, to] = [own[0].max(cells[0]), own[1].min(cells[1])];
            (from < to).then(|| [from - cells[0], to - cells[0]])
        };
        let tiles = self.tiles.iter().filter_map(|tile| {
            let (columns, rows) = (within(tile.columns, part.cells[0])?, within(tile.rows, part.cells[1])?);
            Some(TileCells { tile: tile.tile, columns, rows })
        });
        tiles.collect()
    }

    /// Writes one file of the raster. Returns `None` for a file of a grid in which no cell has a height. The tiles alone do not tell that:
    /// the box of a tile may reach beyond its triangles, and a box depends on the tiling.
    fn write_part(
        &self,
        directory: &JobDirectory,
        part: &RasterPart,
        done: &(dyn Fn() + Sync),
    ) -> Result<Option<(PendingFile, RasterStats)>> {
        let tiles = self.tiles_of(part);
        let may_be_empty = part.uri.is_some();
        if tiles.is_empty() && may_be_empty {
            return Ok(None);
        }
        let levels = part.grid.levels();
        let waiting = WaitingBlocks::create(&directory.raster_blocks(), &levels)?;
        let window_level = window_level(working_memory(&self.plan.options)).min(levels.len() - 1);
        let read = |tile: TileIndex| self.mesh(directory, tile);
        let pyramid = Pyramid {
            options: self.options,
            levels,
            window_level,
            read: &read,
            blocks: &waiting,
            done,
            heights: AtomicU64::new(0),
            same_as_nodata: AtomicU64::new(0),
        };
        let mut window = Window::new(&part.grid, self.heights(), BLOCK << window_level);
        pyramid.draw(&mut window, &tiles)?;
        drop(window);
        let Pyramid { levels, heights, same_as_nodata, .. } = pyramid;
        let (heights, same_as_nodata) = (heights.into_inner(), same_as_nodata.into_inner());
        if heights == 0 && may_be_empty {
            waiting.discard()?;
            return Ok(None);
        }
        let nodata = self.options.nodata.number();
        let blocks = waiting.finish(packed(&vec![nodata; BLOCK * BLOCK], self.options.compression));
        let system = system_of(self.plan);
        let about = RasterHead {
            options: self.options,
            corner: part.grid.corner(),
            cell_size: part.grid.cell_size(),
            system: &system,
            copyright: self.plan.options.output.copyright(),
        };
        let head = head(&about, &blocks.images(&levels));
        let output = directory.output();
        let path = part.uri.as_ref().map_or_else(|| output.raster(), |uri| output.directory().join(uri));
        create_folder_of(&path)?;
        let file = blocks.write(&head, &path)?;
        Ok(Some((file, RasterStats { files: 1, heights, same_as_nodata, ..RasterStats::default() })))
    }

    /// Writes the list by which programs open all files as one raster.
    fn write_list(&self, directory: &JobDirectory, files: Vec<ListedFile>) -> Result<PendingFile> {
        let list = RasterList {
            size: self.grid.size(),
            corner: self.grid.corner(),
            cell_size: self.grid.cell_size(),
            nodata: self.options.nodata,
            system: &system_of(self.plan),
            files,
        };
        write_pending(&directory.output().raster_list(), list.to_string().as_bytes())
    }

    fn heights(&self) -> HeightScale {
        let extras = self.frame.extras();
        HeightScale { offset: extras.offset[2], step: extras.resolution_z }
    }

    fn mesh(&self, directory: &JobDirectory, tile: TileIndex) -> Result<LatticeMesh> {
        lattice_mesh(&directory.output().tile(tile.number()), self.frame)
    }

    /// Returns what the user should know of the raster. Reads tiles again if cells have the height that stands for none.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a tile, [`Error::Interrupted`].
    pub(crate) fn warnings(&self, directory: &JobDirectory, stats: &RasterStats) -> Result<Vec<String>> {
        let file = if self.options.cells_per_file.is_some() { "terrain.vrt" } else { "terrain.tif" };
        let nodata = self.options.nodata;
        let mut warnings = Vec::new();
        if stats.same_as_nodata > 0 {
            let read = |tile: &TileBox| self.mesh(directory, tile.tile);
            let points = NodataPoints::find(&self.boxes, self.heights(), nodata, &read)?;
            warnings.push(points.warning(file, stats.same_as_nodata, nodata, &self.plan.lattice));
        }
        if stats.heights == 0 {
            warnings.push(format!(
                "{file} has no height, because no centre of a cell lies within the terrain: set a finer [output.raster] resolution"
            ));
        }
        warnings.extend(system_warning(&self.plan.crs, &system_of(self.plan)));
        Ok(warnings)
    }
}

/// Returns about how many bytes of memory drawing the raster of a job takes on so many threads, besides the tiles that are read.
pub(crate) fn raster_memory(plan: &Plan, threads: usize) -> u64 {
    // A block, its bytes by their places, and as it is packed.
    const BLOCK_COPIES: usize = 3;
    let Some(grid) = planned_raster(plan) else { return 0 };
    let level = window_level(working_memory(&plan.options)).min(grid.levels().len() - 1);
    window_bytes(level) + (threads * BLOCK_COPIES * BLOCK * BLOCK * size_of::<f32>()) as u64
}

/// Returns the bytes of a window with the cells of a block of this level, and of its overviews, which take a third of it together.
fn window_bytes(level: usize) -> u64 {
    ((BLOCK as u64) << level).pow(2) * size_of::<f32>() as u64 / 3 * 4
}

/// Returns the level of which one block has the cells of a window, for a job with so much memory for work.
fn window_level(memory: u64) -> usize {
    (0..=HIGHEST_WINDOW).rev().find(|level| window_bytes(*level) <= memory / WINDOW_SHARE).unwrap_or(0)
}
