//! The cells of the raster that is written, read back block by block.

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use sys::Result;
use tiles::map_tiles::drawing::CellSource;
use tiles::raster::BLOCK;
use tiles::raster::block_reader::RasterReader;
use tiles::raster::grid::blocks;
use tiles::raster::options::RasterOptions;

/// A file of a raster.
pub(crate) struct CellFile {
    /// `None` if no cell there has a height.
    pub(crate) path: Option<PathBuf>,
    /// The columns and the rows of the raster that it has, each as the first and the one after the last.
    pub(crate) cells: [[u32; 2]; 2],
}

/// The heights of a raster in files.
pub(crate) struct RasterCells {
    options: RasterOptions,
    /// Row by row.
    files: Vec<CellFile>,
    /// The first columns, and the first rows, of the files.
    starts: [Vec<u32>; 2],
    cache: Mutex<BlockCache>,
}

/// The cells of a block, or nothing if none has a height.
type Block = Arc<Vec<f32>>;

/// The blocks that were used last.
struct BlockCache {
    /// By the number of the file and of the block, with the time of its last use.
    blocks: HashMap<(usize, usize), (Block, u64)>,
    time: u64,
    most: usize,
}

impl RasterCells {
    /// Returns the cells of these files of a raster. At most `most` blocks stay in memory.
    pub(crate) fn new(options: RasterOptions, files: Vec<CellFile>, most: usize) -> RasterCells {
        let starts = [0, 1].map(|axis| {
            let mut starts: Vec<u32> = files.iter().map(|file| file.cells[axis][0]).collect();
            starts.sort_unstable();
            starts.dedup();
            starts
        });
        let cache = Mutex::new(BlockCache { blocks: HashMap::new(), time: 0, most });
        RasterCells { options, files, starts, cache }
    }

    fn cache(&self) -> std::sync::MutexGuard<'_, BlockCache> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a block of a file.
    fn block(&self, file: usize, block: usize) -> Result<Block> {
        if let Some(found) = self.cache().find((file, block)) {
            return Ok(found);
        }
        // Several threads may read the same block at the same time; that is rare, and waiting would take as long.
        let cells = self.read_block(file, block)?;
        self.cache().add((file, block), Arc::clone(&cells));
        Ok(cells)
    }

    fn read_block(&self, file: usize, block: usize) -> Result<Block> {
        let CellFile { path, cells: [columns, rows] } = &self.files[file];
        let Some(path) = path else { return Ok(Block::default()) };
        let size = [columns[1] - columns[0], rows[1] - rows[0]];
        let mut cells = RasterReader::open(path, size, self.options.compression)?.block(block)?;
        let nodata = self.options.nodata.number();
        cells.iter_mut().filter(|cell| **cell == nodata).for_each(|cell| *cell = f32::NAN);
        let has_heights = cells.iter().any(|cell| !cell.is_nan());
        Ok(Arc::new(if has_heights { cells } else { Vec::new() }))
    }

    /// Returns the number of the file in a column and a row of files.
    fn file(&self, [column, row]: [usize; 2]) -> usize {
        row * self.starts[0].len() + column
    }

    /// Returns the columns (axis 0) or rows of files that have some of these columns or rows of cells.
    fn files_along(&self, axis: usize, cells: &Range<u32>) -> Range<usize> {
        let before = |cell: u32| self.starts[axis].partition_point(|start| *start < cell);
        let first = self.starts[axis].partition_point(|start| *start <= cells.start);
        first.saturating_sub(1)..before(cells.end)
    }

    /// Copies what a file has of some cells.
    fn copy(&self, file: usize, [columns, rows]: [&Range<u32>; 2], cells: &mut [f32]) -> Result<()> {
        let own = self.files[file].cells;
        let along = blocks([own[0][1] - own[0][0], own[1][1] - own[1][0]])[0];
        let shared = |axis: usize, wanted: &Range<u32>| {
            let [from, to] = [wanted.start.max(own[axis][0]), wanted.end.min(own[axis][1])];
            from..to.max(from)
        };
        let spans = [shared(0, columns), shared(1, rows)];
        let pieces = [0, 1].map(|axis| pieces(&spans[axis], own[axis][0]));
        for (block_row, rows_of_block) in &pieces[1] {
            for (block_column, columns_of_block) in &pieces[0] {
                let block = self.block(file, block_row * along + block_column)?;
                if block.is_empty() {
                    continue;
                }
                for row in rows_of_block.clone() {
                    let from = (row - own[1][0]) as usize % BLOCK * BLOCK
                        + (columns_of_block.start - own[0][0]) as usize % BLOCK;
                    let to =
                        (row - rows.start) as usize * columns.len() + (columns_of_block.start - columns.start) as usize;
                    let length = columns_of_block.len();
                    cells[to..to + length].copy_from_slice(&block[from..from + length]);
                }
            }
        }
        Ok(())
    }
}

/// Cuts a range of columns or rows at the borders of the blocks of a file that begins at `first`: the number of each block, and its part of
/// the range.
fn pieces(range: &Range<u32>, first: u32) -> Vec<(usize, Range<u32>)> {
    let side = BLOCK as u32;
    let mut pieces = Vec::new();
    let mut at = range.start;
    while at < range.end {
        let block = (at - first) / side;
        let end = range.end.min(first + (block + 1) * side);
        pieces.push((block as usize, at..end));
        at = end;
    }
    pieces
}

impl CellSource for RasterCells {
    fn read(&self, columns: Range<u32>, rows: Range<u32>, cells: &mut Vec<f32>) -> Result<()> {
        cells.clear();
        cells.resize(columns.len() * rows.len(), f32::NAN);
        for row in self.files_along(1, &rows) {
            for column in self.files_along(0, &columns) {
                self.copy(self.file([column, row]), [&columns, &rows], cells)?;
            }
        }
        Ok(())
    }
}

impl BlockCache {
    fn find(&mut self, key: (usize, usize)) -> Option<Block> {
        self.time += 1;
        let (block, used) = self.blocks.get_mut(&key)?;
        *used = self.time;
        Some(Arc::clone(block))
    }

    fn add(&mut self, key: (usize, usize), block: Block) {
        while self.blocks.len() >= self.most {
            let Some(oldest) = self.blocks.iter().min_by_key(|(_, (_, used))| *used).map(|(key, _)| *key) else {
                break;
            };
            self.blocks.remove(&oldest);
        }
        self.time += 1;
        self.blocks.insert(key, (block, self.time));
    }
}
