//! Writing `terrain.tif`, and the rasters that follow from it.

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
use tiles::raster::products::{GradientScale, RasterProduct, RasterProducts};
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
    /// What was written.
    #[serde(default)]
    pub products: RasterProducts,
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
    /// Its number, in a grid of files.
    number: Option<usize>,
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
    /// The tiles that may cover a cell of the grid with its margin.
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
        let with_margin = grid.with_margin();
        let cells = |tile: &TileBox| {
            let [columns, rows] = with_margin.cells_within(tile.bounds);
            (columns[0] < columns[1] && rows[0] < rows[1]).then_some(TileCells { tile: tile.tile, columns, rows })
        };
        let tiles = boxes.iter().filter_map(cells).collect();
        Ok(Some(RasterWork { plan, options, frame, grid, boxes, tiles }))
    }

    /// Returns where the cells are.
    pub(crate) fn grid(&self) -> &RasterGrid {
        &self.grid
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
        let part = |(n, cells)| RasterPart { number: side.map(|_| n), cells, grid: self.grid.part(cells) };
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
        let products = self.options.products;
        let mut stats = RasterStats { size: self.grid.size(), products, ..RasterStats::default() };
        let (mut files, mut listed) = (Vec::new(), Vec::new());
        for part in self.parts() {
            let Some((of_part, figures)) = self.write_part(directory, &part, done)? else { continue };
            stats += figures;
            files.extend(of_part);
            listed.push(part);
        }
        if self.options.cells_per_file.is_some() {
            for product in products.iter() {
                files.push(self.write_list(directory, product, &listed)?);
            }
        }
        stats.bytes = files.iter().map(|file| file.bytes).sum();
        Ok((stats, files))
    }

    /// Returns the tiles that may cover cells of a file or its margin, with the cells counted from the first of the margin.
    fn tiles_of(&self, part: &RasterPart) -> Vec<TileCells> {
        let within = |own: [u32; 2], cells: [u32; 2]| {
            let [from, to] = [own[0].max(cells[0]), own[1].min(cells[1].saturating_add(2))];
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
    ) -> Result<Option<(Vec<PendingFile>, RasterStats)>> {
        let tiles = self.tiles_of(part);
        let may_be_empty = part.number.is_some();
        if tiles.is_empty() && may_be_empty {
            return Ok(None);
        }
        let levels = part.grid.levels();
        let create = |product: RasterProduct| {
            let path = directory.scratch(&format!("{}.blocks", product.names()[1]));
            Ok((product, WaitingBlocks::create(&path, &levels)?))
        };
        let rasters = self.options.products.iter().map(create).collect::<Result<Vec<_>>>()?;
        let window_level = window_level(working_memory(&self.plan.options)).min(levels.len() - 1);
        let read = |tile: TileIndex| self.mesh(directory, tile);
        let pyramid = Pyramid {
            options: self.options,
            levels: levels.clone(),
            window_level,
            read: &read,
            rasters: &rasters,
            done,
            heights: AtomicU64::new(0),
            same_as_nodata: AtomicU64::new(0),
        };
        let grid = part.grid.with_margin();
        let mut window = Window::new(&grid, self.heights(), self.gradients(), BLOCK << window_level);
        pyramid.draw(&mut window, &tiles)?;
        drop(window);
        let (heights, same_as_nodata) = (pyramid.heights.into_inner(), pyramid.same_as_nodata.into_inner());
        if heights == 0 && may_be_empty {
            rasters.into_iter().try_for_each(|(_, waiting)| waiting.discard())?;
            return Ok(None);
        }
        let write = |(product, waiting)| self.write_file(directory, part, product, waiting, &levels);
        let files = rasters.into_iter().map(write).collect::<Result<Vec<_>>>()?;
        let count = files.len() as u64;
        Ok(Some((files, RasterStats { files: count, heights, same_as_nodata, ..RasterStats::default() })))
    }

    /// Puts a file together from its blocks.
    fn write_file(
        &self,
        directory: &JobDirectory,
        part: &RasterPart,
        product: RasterProduct,
        waiting: WaitingBlocks,
        levels: &[[u32; 2]],
    ) -> Result<PendingFile> {
        let empty = vec![product.nodata(self.options.nodata.number()); BLOCK * BLOCK];
        let blocks = waiting.finish(packed(&empty, product, self.options.compression));
        let about = RasterHead {
            options: self.options,
            product,
            corner: part.grid.corner(),
            cell_size: part.grid.cell_size(),
            system: &system_of(self.plan),
            copyright: self.plan.options.output.copyright(),
        };
        let head = head(&about, &blocks.images(levels));
        let output = directory.output();
        let path = match part.number {
            Some(number) => output.directory().join(raster_uri(product, number)),
            None => output.raster(product),
        };
        create_folder_of(&path)?;
        blocks.write(&head, &path)
    }

    /// Writes the list by which programs open all files as one raster.
    fn write_list(
        &self,
        directory: &JobDirectory,
        product: RasterProduct,
        files: &[RasterPart],
    ) -> Result<PendingFile> {
        let listed = |part: &RasterPart| {
            part.number.map(|number| ListedFile { uri: raster_uri(product, number), cells: part.cells })
        };
        let list = RasterList {
            size: self.grid.size(),
            corner: self.grid.corner(),
            cell_size: self.grid.cell_size(),
            product,
            nodata: product.nodata(self.options.nodata.number()),
            system: &system_of(self.plan),
            files: files.iter().filter_map(listed).collect(),
        };
        write_pending(&directory.output().raster_list(product), list.to_string().as_bytes())
    }

    /// Returns how differences of heights become slopes.
    fn gradients(&self) -> GradientScale {
        let extras = self.frame.extras();
        GradientScale::new(self.grid.cell_size(), extras.metres_per_unit, extras.metres_per_unit_z)
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
        let has_heights = self.options.products.iter().any(|product| product == RasterProduct::Height);
        let mut warnings = Vec::new();
        if stats.same_as_nodata > 0 && has_heights {
            let read = |tile: &TileBox| self.mesh(directory, tile.tile);
            let points = NodataPoints::find(&self.boxes, self.heights(), nodata, &read)?;
            warnings.push(points.warning(file, stats.same_as_nodata, nodata, &self.plan.lattice));
        }
        if stats.heights == 0 {
            warnings.push(
                "the raster is empty: no cell has its centre within the terrain; fix: a finer [output.raster] resolution".into(),
            );
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

/// Returns the bytes of a window with the cells of a block of this level, of the image that is made of it, and of the first overview, a
/// quarter of it.
fn window_bytes(level: usize) -> u64 {
    ((BLOCK as u64) << level).pow(2) * size_of::<f32>() as u64 / 4 * 9
}

/// Returns the level of which one block has the cells of a window, for a job with so much memory for work.
fn window_level(memory: u64) -> usize {
    (0..=HIGHEST_WINDOW).rev().find(|level| window_bytes(*level) <= memory / WINDOW_SHARE).unwrap_or(0)
}
