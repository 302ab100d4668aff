//! `difference.tif`: the later height minus the earlier one at the centre of each cell, where both terrains are.
//!
//! Both terrains are drawn into windows over the same cells, in steps of the common lattice, so that equal heights differ by exactly 0
//! whatever the lattices. Overviews follow from the windows, as those of `terrain.tif` do.

use crate::written::compared::{Compared, refuse_too_many};
use crate::written::folder::{DifferenceFolder, RASTER};
use crate::written::ramp::ChangeCounts;
use crate::written::waiting_blocks::WaitingBlocks;
use overlay::Rectangle;
use rayon::prelude::*;
use rust_decimal::Decimal;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use sys::{Error, Result, interrupt};
use terrain::FinishedTerrain;
use tiles::raster::BLOCK;
use tiles::raster::block::packed;
use tiles::raster::geokeys::RasterSystem;
use tiles::raster::geotiff::{RasterHead, head};
use tiles::raster::grid::{CellAlignment, CellLimit, RasterGrid, blocks};
use tiles::raster::options::{CellSize, Nodata, RasterCompression, RasterOptions};
use tiles::raster::overview::halved;
use tiles::raster::products::{GradientScale, RasterProduct, RasterProducts};
use tiles::raster::window::{HeightScale, LatticeMesh, Window, filled};

/// The most levels that are drawn in one window, whose side is 512 times two to the power of this.
const HIGHEST_WINDOW: usize = 3;

/// The windows of both terrains, with what is made of them, may take this part of the memory.
const WINDOW_SHARE: u64 = 4;

/// Bytes for each cell of a window: two heights, their difference, and the overviews.
const BYTES_PER_CELL: u64 = 14;

/// Differences are numbers like heights: in single precision, with means in overviews.
const PRODUCT: RasterProduct = RasterProduct::Height;

/// A raster that is to be written.
pub(crate) struct DifferenceRaster<'a> {
    compared: &'a Compared<'a>,
    options: RasterOptions,
    /// The cells over each lattice, with a margin.
    grids: [RasterGrid; 2],
    corner: [f64; 2],
    cell_size: f64,
    /// The sizes of the raster and its overviews.
    levels: Vec<[u32; 2]>,
    /// A window has the cells of one block of this level.
    window_level: usize,
    /// The tiles of each terrain that may cover a cell.
    tiles: [Vec<TileCells>; 2],
}

/// What came of a raster.
pub(crate) struct DrawnRaster {
    pub(crate) size: [u32; 2],
    /// Of all cells.
    pub(crate) changes: ChangeCounts,
}

/// A tile, and the columns and rows of the grid with its margin that it may cover, each as the first and the one after the last.
#[derive(Clone, Copy, Debug)]
struct TileCells {
    tile: usize,
    columns: [u32; 2],
    rows: [u32; 2],
}

/// The tiles of both terrains.
type Tiles = [Vec<TileCells>; 2];

/// What is drawn into.
struct Canvas<'a> {
    windows: [Window<'a>; 2],
    waiting: &'a WaitingBlocks,
    changes: Mutex<ChangeCounts>,
}

impl<'a> DifferenceRaster<'a> {
    /// Looks at what is to be done; `None` if the terrains lie apart.
    ///
    /// # Errors
    /// [`Error::Config`] if there are too many cells, or the resolution has too many digits.
    pub(crate) fn new(compared: &'a Compared<'a>, resolution: f64) -> Result<Option<DifferenceRaster<'a>>> {
        let common = compared.common_box();
        if (0..2).any(|axis| common.min[axis] >= common.max[axis]) {
            return Ok(None);
        }
        let step = compared.lattice.step_lengths()[0];
        refuse_too_many(resolution, [0, 1].map(|axis| (common.max[axis] - common.min[axis]) as f64 * step))?;
        let refuse = |what: String| Error::Config(format!("--resolution {resolution} {what}"));
        let side = CellSize::of(resolution).ok_or_else(|| refuse("is not a cell size".into()))?;
        let alignment = CellAlignment { origin: [Decimal::ZERO; 2], resolution: side.exact() };
        let lattices = compared.terrains.map(FinishedTerrain::lattice);
        let bounds = compared.lattice.ways[0].around(common);
        let grid = RasterGrid::new(lattices[0], alignment, bounds, CellLimit::OneFile).map_err(refuse)?;
        let other = grid.on_lattice(lattices[1]).map_err(refuse)?;
        let grids = [grid.with_margin(), other.with_margin()];
        let tiles = [0, 1].map(|k| {
            let cells = |(tile, bounds): (usize, Rectangle)| {
                let [columns, rows] = grids[k].cells_within(compared.lattice.ways[k].around(bounds));
                let is_met = columns[0] < columns[1] && rows[0] < rows[1];
                is_met.then_some(TileCells { tile, columns, rows })
            };
            compared.facts[k].iter().map(|facts| facts.bounds).enumerate().filter_map(cells).collect()
        });
        let levels = grid.levels();
        let options = RasterOptions {
            pmtiles: None,
            resolution: side,
            origin: None,
            products: RasterProducts::default(),
            compression: RasterCompression::Deflate,
            nodata: Nodata::default(),
            cells_per_file: None,
        };
        Ok(Some(DifferenceRaster {
            compared,
            options,
            grids,
            corner: grid.corner(),
            cell_size: grid.cell_size(),
            window_level: window_level(compared.memory).min(levels.len() - 1),
            levels,
            tiles,
        }))
    }

    /// Draws the raster and writes it into the folder.
    ///
    /// # Errors
    /// [`Error::Input`] if a tile is not as its job wrote it, [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn write(&self, folder: &DifferenceFolder) -> Result<DrawnRaster> {
        let waiting = WaitingBlocks::create(&folder.waiting("blocks")?, &self.levels)?;
        let gradients = GradientScale::new(self.cell_size, 1.0, 1.0);
        let window = |k: usize| {
            let scale = self.compared.lattice.ways[k].heights();
            Window::new(
                &self.grids[k],
                HeightScale { offset: scale[0], step: scale[1] },
                gradients,
                BLOCK << self.window_level,
            )
        };
        let mut canvas =
            Canvas { windows: [window(0), window(1)], waiting: &waiting, changes: Mutex::new(ChangeCounts::new()) };
        self.block(self.levels.len() - 1, [0, 0], &self.tiles, &mut canvas)?;
        let changes = canvas.changes.into_inner().unwrap_or_else(PoisonError::into_inner);
        drop(canvas.windows);
        let nodata = self.options.nodata.number();
        let empty = packed(&vec![nodata; BLOCK * BLOCK], PRODUCT, self.options.compression);
        let system = self.system();
        let about = RasterHead {
            options: self.options,
            product: PRODUCT,
            corner: self.corner,
            cell_size: self.cell_size,
            system: &system,
            copyright: None,
        };
        waiting.write(&self.levels, &empty, |images| head(&about, images), &folder.waiting(RASTER)?)?;
        Ok(DrawnRaster { size: self.levels[0], changes })
    }

    /// Returns what the raster says of the CRS. Its numbers are no heights, so it says nothing of a vertical datum.
    fn system(&self) -> RasterSystem {
        let [before, after] = self.compared.terrains.map(FinishedTerrain::system);
        let system = if before.crs.is_named() { before } else { after };
        RasterSystem::of_plane(&system.crs, system.metres[0])
    }

    /// Draws what is below a block of level `level`, of which `tiles` cover something, and returns its pixels.
    fn block(&self, level: usize, at: [usize; 2], tiles: &Tiles, canvas: &mut Canvas) -> Result<Vec<f32>> {
        interrupt::check()?;
        if tiles.iter().any(Vec::is_empty) {
            return Ok(vec![f32::NAN; BLOCK * BLOCK]);
        }
        if level == self.window_level {
            return self.window(at, tiles, canvas);
        }
        let mut image = vec![f32::NAN; BLOCK * BLOCK];
        let below = blocks(self.levels[level - 1]);
        for quarter in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let child = [0, 1].map(|axis| 2 * at[axis] + quarter[axis]);
            if child[0] >= below[0] || child[1] >= below[1] {
                continue;
            }
            let tiles = tiles.each_ref().map(|tiles| within(tiles, level - 1, child));
            let finer = self.block(level - 1, child, &tiles, canvas)?;
            let half = halved(PRODUCT, BLOCK, |n| finer[n]);
            let first = quarter[1] * BLOCK / 2 * BLOCK + quarter[0] * BLOCK / 2;
            for (row, pixels) in half.chunks_exact(BLOCK / 2).enumerate() {
                image[first + row * BLOCK..][..BLOCK / 2].copy_from_slice(pixels);
            }
        }
        self.add(canvas.waiting, level, at, filled(BLOCK, [0, 0], self.options.nodata.number(), |n| image[n]))?;
        Ok(image)
    }

    /// Draws the window that is block `at` of its level, and returns the pixels of that block.
    fn window(&self, at: [usize; 2], tiles: &Tiles, canvas: &mut Canvas) -> Result<Vec<f32>> {
        let mut side = BLOCK << self.window_level;
        let too_far = |_| Error::Broken("a raster has more columns than there are numbers".into());
        let [column, row] = at.map(|block| u32::try_from(block * side).map_err(too_far));
        let first = [column?, row?];
        for (k, window) in canvas.windows.iter_mut().enumerate() {
            window.move_to(first);
            self.draw(k, &tiles[k], window)?;
        }
        let [before, after] = &canvas.windows;
        let step = self.compared.lattice.step_lengths()[1];
        let change = |n: usize| ((f64::from(after.height(n)) - f64::from(before.height(n))) * step) as f32;
        let mut image: Vec<f32> = (0..side * side).into_par_iter().map(change).collect();
        self.count(&image, canvas);
        self.add_blocks(canvas.waiting, 0, at, side, &image)?;
        for level in 1..=self.window_level {
            image = halved(PRODUCT, side, |n| image[n]);
            side /= 2;
            self.add_blocks(canvas.waiting, level, at, side, &image)?;
        }
        Ok(image)
    }

    /// Draws tiles of terrain number `k`, no more at the same time than there is memory for.
    fn draw(&self, k: usize, tiles: &[TileCells], window: &Window) -> Result<()> {
        let next = AtomicUsize::new(0);
        let draw_some = |_| {
            while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::Relaxed)) {
                interrupt::check()?;
                for part in self.compared.terrains[k].read_tile(tile.tile)? {
                    window.draw(&LatticeMesh { positions: part.points, triangles: part.triangles })?;
                }
            }
            Ok(())
        };
        (0..self.compared.lanes).into_par_iter().with_max_len(1).try_for_each(draw_some)
    }

    fn count(&self, image: &[f32], canvas: &mut Canvas) {
        let of_some = |some: &[f32]| {
            let mut counts = ChangeCounts::new();
            some.iter().for_each(|change| counts.add(*change));
            counts
        };
        let found = image.par_chunks(BLOCK * BLOCK).map(of_some);
        let found = found.reduce(ChangeCounts::new, |all, some| all.merge(&some));
        let changes = canvas.changes.get_mut().unwrap_or_else(PoisonError::into_inner);
        *changes = found.merge(changes);
    }

    /// Adds the blocks of the window `at`, whose image at `level` has a side of so many pixels.
    fn add_blocks(
        &self,
        waiting: &WaitingBlocks,
        level: usize,
        at: [usize; 2],
        side: usize,
        image: &[f32],
    ) -> Result<()> {
        let along = side / BLOCK;
        let all = blocks(self.levels[level]);
        (0..along * along).into_par_iter().with_max_len(1).try_for_each(|number| {
            let inside = [number % along, number / along];
            let block = [0, 1].map(|axis| at[axis] * along + inside[axis]);
            if block[0] >= all[0] || block[1] >= all[1] {
                return Ok(());
            }
            self.add(waiting, level, block, filled(side, inside, self.options.nodata.number(), |n| image[n]))
        })
    }

    /// Adds a block; nothing if it has no value.
    fn add(&self, waiting: &WaitingBlocks, level: usize, at: [usize; 2], block: Option<Vec<f32>>) -> Result<()> {
        let Some(cells) = block else { return Ok(()) };
        let [columns, _] = blocks(self.levels[level]);
        waiting.add(level, at[1] * columns + at[0], &packed(&cells, PRODUCT, self.options.compression))
    }
}

/// Returns those of `tiles` that may cover something below a block of level `level`.
fn within(tiles: &[TileCells], level: usize, at: [usize; 2]) -> Vec<TileCells> {
    let span = (BLOCK as u64) << level;
    // Tiles count cells in the grid with its margin.
    let [columns, rows] = at.map(|block| [block as u64 * span, (block as u64 + 1) * span + 2]);
    let meet = |own: [u32; 2], others: [u64; 2]| u64::from(own[0]) < others[1] && others[0] < u64::from(own[1]);
    tiles.iter().filter(|tile| meet(tile.columns, columns) && meet(tile.rows, rows)).copied().collect()
}

/// Returns the level of which one block has the cells of a window, with so much memory.
fn window_level(memory: u64) -> usize {
    let bytes = |level: usize| ((BLOCK as u64) << level).pow(2) * BYTES_PER_CELL;
    (0..=HIGHEST_WINDOW).rev().find(|level| bytes(*level) <= memory / WINDOW_SHARE).unwrap_or(0)
}
