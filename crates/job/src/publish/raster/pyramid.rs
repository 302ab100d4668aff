//! Drawing a raster window by window, and its overviews from the windows.

use crate::index::TileIndex;
use crate::publish::raster::waiting_blocks::WaitingBlocks;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use sys::Result;
use tiles::raster::BLOCK;
use tiles::raster::block::packed;
use tiles::raster::grid::blocks;
use tiles::raster::options::RasterOptions;
use tiles::raster::overview::halved;
use tiles::raster::products::RasterProduct;
use tiles::raster::window::{LatticeMesh, Window, filled};

/// A tile, and the first column and row of the grid with its margin that it may cover, and those after the last.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileCells {
    pub(super) tile: TileIndex,
    pub(super) columns: [u32; 2],
    pub(super) rows: [u32; 2],
}

/// What a raster is drawn from, and where its blocks go.
pub(super) struct Pyramid<'a> {
    pub(super) options: RasterOptions,
    /// The sizes of the raster and its overviews.
    pub(super) levels: Vec<[u32; 2]>,
    /// A window has the cells of one block of this level.
    pub(super) window_level: usize,
    pub(super) read: &'a (dyn Fn(TileIndex) -> Result<LatticeMesh> + Sync),
    /// Where the blocks of each kind of raster go.
    pub(super) rasters: &'a [(RasterProduct, WaitingBlocks)],
    /// Is told of each block of the first raster itself that has a value.
    pub(super) done: &'a (dyn Fn() + Sync),
    /// Cells with a height.
    pub(super) heights: AtomicU64,
    /// Those of them whose height is just the number for none.
    pub(super) same_as_nodata: AtomicU64,
}

impl Pyramid<'_> {
    /// Draws everything. `window` has the side that belongs to [`Pyramid::window_level`].
    ///
    /// # Errors
    /// Those of reading a tile and of adding a block; [`sys::Error::Interrupted`].
    pub(super) fn draw(&self, window: &mut Window, tiles: &[TileCells]) -> Result<()> {
        self.block(self.levels.len() - 1, [0, 0], tiles, window).map(|_| ())
    }

    /// Draws what is below a block of level `level`, of which `tiles` cover something, and returns its pixels, for each kind of raster.
    fn block(&self, level: usize, at: [usize; 2], tiles: &[TileCells], window: &mut Window) -> Result<Vec<Vec<f32>>> {
        if level == self.window_level {
            return self.window(at, tiles, window);
        }
        let mut images = vec![vec![f32::NAN; BLOCK * BLOCK]; self.rasters.len()];
        let below = blocks(self.levels[level - 1]);
        for quarter in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let child = [0, 1].map(|axis| 2 * at[axis] + quarter[axis]);
            let tiles = within(tiles, level - 1, child);
            if child[0] >= below[0] || child[1] >= below[1] || tiles.is_empty() {
                continue;
            }
            let finer = self.block(level - 1, child, &tiles, window)?;
            for (((product, _), image), pixels) in self.rasters.iter().zip(&mut images).zip(finer) {
                let half = halved(*product, BLOCK, |n| pixels[n]);
                let first = quarter[1] * BLOCK / 2 * BLOCK + quarter[0] * BLOCK / 2;
                for (row, pixels) in half.chunks_exact(BLOCK / 2).enumerate() {
                    image[first + row * BLOCK..][..BLOCK / 2].copy_from_slice(pixels);
                }
            }
        }
        for (raster, image) in self.rasters.iter().zip(&images) {
            self.add(raster, level, at, filled(BLOCK, [0, 0], self.nodata(raster.0), |n| image[n]))?;
        }
        Ok(images)
    }

    fn nodata(&self, product: RasterProduct) -> f32 {
        product.nodata(self.options.nodata.number())
    }

    /// Draws a window and the overviews of it. Returns the pixels of the last, which is one block, for each kind of raster.
    fn window(&self, at: [usize; 2], tiles: &[TileCells], window: &mut Window) -> Result<Vec<Vec<f32>>> {
        let side = window.side();
        window.move_to(at.map(|block| (block * side) as u32));
        tiles.par_iter().with_max_len(1).try_for_each(|tile| window.draw(&(self.read)(tile.tile)?))?;
        self.count(window);
        self.rasters.iter().map(|raster| self.images(raster, at, window)).collect()
    }

    /// Counts the cells of a window that have a height.
    fn count(&self, window: &Window) {
        let nodata = self.options.nodata.number();
        let of_cell = |number: usize| {
            let height = window.height(number);
            [u64::from(!height.is_nan()), u64::from(height == nodata)]
        };
        let sum = |a: [u64; 2], b: [u64; 2]| [a[0] + b[0], a[1] + b[1]];
        let cells = (0..window.side() * window.side()).into_par_iter();
        let [heights, same] = cells.map(of_cell).reduce(Default::default, sum);
        self.heights.fetch_add(heights, Ordering::Relaxed);
        self.same_as_nodata.fetch_add(same, Ordering::Relaxed);
    }

    /// Adds the blocks of a window to a raster, and those of its overviews. Returns the pixels of the last, which is one block.
    fn images(&self, raster: &(RasterProduct, WaitingBlocks), at: [usize; 2], window: &Window) -> Result<Vec<f32>> {
        let (mut side, product) = (window.side(), raster.0);
        // Slopes take longer than to keep them: both the blocks and the first overview need them.
        let mut image: Vec<f32> =
            (0..side * side).into_par_iter().map(|number| window.value(product, number)).collect();
        self.add_blocks(raster, 0, at, side, &|number| image[number])?;
        for level in 1..=self.window_level {
            image = halved(product, side, |number| image[number]);
            side /= 2;
            self.add_blocks(raster, level, at, side, &|number| image[number])?;
        }
        Ok(image)
    }

    /// Adds the blocks of the window `at`, whose image at `level` has a side of so many pixels.
    fn add_blocks(
        &self,
        raster: &(RasterProduct, WaitingBlocks),
        level: usize,
        at: [usize; 2],
        side: usize,
        pixel: &(dyn Fn(usize) -> f32 + Sync),
    ) -> Result<()> {
        let along = side / BLOCK;
        let all = blocks(self.levels[level]);
        (0..along * along).into_par_iter().with_max_len(1).try_for_each(|number| {
            let inside = [number % along, number / along];
            let block = [0, 1].map(|axis| at[axis] * along + inside[axis]);
            if block[0] >= all[0] || block[1] >= all[1] {
                return Ok(());
            }
            self.add(raster, level, block, filled(side, inside, self.nodata(raster.0), pixel))
        })
    }

    /// Adds a block to a raster. A block without a value is not added.
    fn add(
        &self,
        (product, waiting): &(RasterProduct, WaitingBlocks),
        level: usize,
        at: [usize; 2],
        block: Option<Vec<f32>>,
    ) -> Result<()> {
        let Some(cells) = block else { return Ok(()) };
        let [columns, _] = blocks(self.levels[level]);
        waiting.add(level, at[1] * columns + at[0], &packed(&cells, *product, self.options.compression))?;
        if level == 0 && self.rasters.first().is_some_and(|(first, _)| first == product) {
            (self.done)();
        }
        Ok(())
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
