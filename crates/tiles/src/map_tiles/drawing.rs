//! The heights of a tile of the finest zoom, from the cells of the raster.

use crate::map_tiles::patch::Patch;
use crate::map_tiles::{PixelWay, TILE};
use std::ops::Range;
use sys::{Result, interrupt};

/// Pixels along the side of what is drawn at one time, at most.
const PATCH: usize = 128;

/// Cells that a patch needs, at most, unless it is one pixel.
const MOST_CELLS: usize = 1 << 18;

/// Gives cells of a raster.
pub trait CellSource: Sync {
    /// Puts the heights of some columns and rows into `cells`, row by row; NaN where there is none.
    ///
    /// # Errors
    /// Those of reading the raster.
    fn read(&self, columns: Range<u32>, rows: Range<u32>, cells: &mut Vec<f32>) -> Result<()>;
}

/// What tiles are drawn from.
pub struct TileDrawing<'a> {
    /// Columns and rows of the raster.
    pub size: [u32; 2],
    /// The cells.
    pub source: &'a dyn CellSource,
    /// From pixels to cells.
    pub way: &'a PixelWay<'a>,
    /// Metres in a unit of height.
    pub metres: f64,
}

impl TileDrawing<'_> {
    /// Returns the heights in metres of the pixels of a tile of the finest zoom, row by row, NaN where there is no terrain; `None` if there
    /// is none at all.
    ///
    /// # Errors
    /// Those of reading the raster; [`sys::Error::Interrupted`].
    pub fn draw(&self, [x, y]: [u32; 2]) -> Result<Option<Vec<f64>>> {
        let mut canvas =
            Canvas { first: [x, y].map(|at| f64::from(at) * TILE as f64), heights: Vec::new(), cells: Vec::new() };
        for row in (0..TILE).step_by(PATCH) {
            interrupt::check()?;
            for column in (0..TILE).step_by(PATCH) {
                let first = [0, 1].map(|axis| canvas.first[axis] + [column, row][axis] as f64);
                self.draw_patch(Patch { first, side: PATCH }, &mut canvas)?;
            }
        }
        Ok((!canvas.heights.is_empty()).then_some(canvas.heights))
    }

    fn draw_patch(&self, patch: Patch, canvas: &mut Canvas) -> Result<()> {
        let Some(places) = patch.places(self.way) else { return self.draw_quarters(patch, canvas) };
        let spans = [0, 1].map(|axis| self.span(axis, &places));
        let [Some(columns), Some(rows)] = spans else { return Ok(()) };
        if patch.side > 1 && columns.len() * rows.len() > MOST_CELLS {
            return self.draw_quarters(patch, canvas);
        }
        let mut cells = std::mem::take(&mut canvas.cells);
        self.source.read(columns.clone(), rows.clone(), &mut cells)?;
        let window = CellWindow { columns, rows, cells: &cells };
        if cells.iter().any(|cell| !cell.is_nan()) {
            for (n, place) in places.iter().enumerate() {
                let height = window.height(*place);
                if !height.is_nan() {
                    canvas.set(patch, n, height * self.metres);
                }
            }
        }
        canvas.cells = cells;
        Ok(())
    }

    fn draw_quarters(&self, patch: Patch, canvas: &mut Canvas) -> Result<()> {
        match patch.side {
            1 => Ok(()),
            _ => patch.quarters().into_iter().try_for_each(|quarter| self.draw_patch(quarter, canvas)),
        }
    }

    /// Returns the columns (axis 0) or rows that interpolation at some of `places` needs.
    fn span(&self, axis: usize, places: &[[f64; 2]]) -> Option<Range<u32>> {
        let [low, high] = places.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            [low.min(place[axis]), high.max(place[axis])]
        });
        let size = f64::from(self.size[axis]);
        if !(high >= -0.5 && low <= size - 0.5) {
            return None;
        }
        // The conversions keep within the type.
        let [from, past] = [low.floor().max(0.0) as u32, (high.floor() + 2.0).min(size) as u32];
        Some(from.min(self.size[axis] - 1)..past)
    }
}

/// A tile while it is drawn.
struct Canvas {
    /// Its pixel in the north-west.
    first: [f64; 2],
    /// Nothing until a pixel has a height.
    heights: Vec<f64>,
    /// The cells of the last patch.
    cells: Vec<f32>,
}

impl Canvas {
    /// Sets pixel number `n` of a patch.
    fn set(&mut self, patch: Patch, n: usize, height: f64) {
        if self.heights.is_empty() {
            self.heights = vec![f64::NAN; TILE * TILE];
        }
        let [column, row] = [0, 1].map(|axis| (patch.first[axis] - self.first[axis]) as usize);
        self.heights[(row + n / patch.side) * TILE + column + n % patch.side] = height;
    }
}

/// Some cells of a raster.
struct CellWindow<'a> {
    columns: Range<u32>,
    rows: Range<u32>,
    cells: &'a [f32],
}

impl CellWindow<'_> {
    /// Returns the height at a column and a row between centres of cells, where these are whole numbers: interpolated along both axes. Where
    /// some of the four cells around have no height, the others count by their weights. There is none where the nearest cell has none.
    fn height(&self, [x, y]: [f64; 2]) -> f64 {
        let (left, top) = (x.floor(), y.floor());
        let (east, south) = (x - left, y - top);
        let [nw, ne, sw, se] =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[dx, dy]| self.cell(left + dx, top + dy));
        if !(nw + ne + sw + se).is_nan() {
            let [north, south_row] = [nw + (ne - nw) * east, sw + (se - sw) * east];
            return north + (south_row - north) * south;
        }
        let weights = [(1.0 - east) * (1.0 - south), east * (1.0 - south), (1.0 - east) * south, east * south];
        let (mut sum, mut all, mut nearest) = (0.0, 0.0, [0.0, f64::NAN]);
        for (weight, height) in weights.into_iter().zip([nw, ne, sw, se]) {
            if weight > nearest[0] {
                nearest = [weight, height];
            }
            if !height.is_nan() {
                sum += weight * height;
                all += weight;
            }
        }
        if nearest[1].is_nan() { f64::NAN } else { sum / all }
    }

    /// Returns the height of a cell; NaN if it has none or lies outside.
    fn cell(&self, x: f64, y: f64) -> f64 {
        let [column, row] = [x - f64::from(self.columns.start), y - f64::from(self.rows.start)];
        let (width, height) = (self.columns.len(), self.rows.len());
        if column < 0.0 || row < 0.0 || column >= width as f64 || row >= height as f64 {
            return f64::NAN;
        }
        // Both are whole numbers within the window.
        f64::from(self.cells[row as usize * width + column as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heights that rise by 1 a column and 1000 a row, none in one cell.
    struct Plane {
        size: [u32; 2],
        hole: [u32; 2],
    }

    impl CellSource for Plane {
        fn read(&self, columns: Range<u32>, rows: Range<u32>, cells: &mut Vec<f32>) -> Result<()> {
            assert!(columns.end <= self.size[0] && rows.end <= self.size[1]);
            cells.clear();
            let height = |column, row| match [column, row] == self.hole {
                true => f32::NAN,
                false => column as f32 + 1000.0 * row as f32,
            };
            cells.extend(
                rows.flat_map(|row| columns.clone().map(move |column| (column, row))).map(|(c, r)| height(c, r)),
            );
            Ok(())
        }
    }

    fn drawn(way: &PixelWay, tile: [u32; 2]) -> Option<Vec<f64>> {
        let source = Plane { size: [300, 200], hole: [50, 60] };
        TileDrawing { size: source.size, source: &source, way, metres: 0.5 }.draw(tile).unwrap()
    }

    #[test]
    fn pixels_have_the_heights_between_cells() {
        // Tile (3, 7) begins at cell (-10.25, -5.5); a pixel is two thirds of a cell.
        let way = |[x, y]: [f64; 2]| Some([(x - 1536.0) / 1.5 - 10.25, (y - 3584.0) / 1.5 - 5.5]);
        let heights = drawn(&way, [3, 7]).unwrap();
        let mut holes = 0;
        for (n, height) in heights.iter().enumerate() {
            let [x, y] = [(n % TILE) as f64 / 1.5 - 10.25, (n / TILE) as f64 / 1.5 - 5.5];
            let is_within = x > -0.499 && y > -0.499 && x < 299.499 && y < 199.499;
            let is_at_hole = (x - 50.0).abs() < 1.0 && (y - 60.0).abs() < 1.0;
            let is_beside = x < 0.0 || y < 0.0 || x > 299.0 || y > 199.0;
            if is_within && !is_at_hole && !is_beside {
                assert!((height - (x + 1000.0 * y) / 2.0).abs() < 1e-6, "{x} {y}: {height}");
            } else if is_within && is_beside {
                let [x, y] = [x.clamp(0.0, 299.0), y.clamp(0.0, 199.0)];
                assert!((height - (x + 1000.0 * y) / 2.0).abs() < 1e-6, "{x} {y}: {height}");
            } else if is_at_hole {
                let beyond = (x - 50.0).abs().max((y - 60.0).abs()) - 0.5;
                holes += usize::from(height.is_nan());
                assert!(beyond.abs() < 1e-9 || height.is_nan() == (beyond < 0.0), "{x} {y}");
            } else if x < -0.5 || y < -0.5 || x > 299.5 || y > 199.5 {
                assert!(height.is_nan());
            }
        }
        assert!(holes > 0);
        assert!(drawn(&way, [4, 7]).is_none());
    }

    #[test]
    fn a_map_that_ends_and_one_that_is_much_coarser_are_drawn_too() {
        // The system has no places from pixel 100.3 on, and a pixel is 20 cells.
        let ends = |[x, y]: [f64; 2]| (x < 100.3).then_some([x, y]);
        let heights = drawn(&ends, [0, 0]).unwrap();
        assert!((heights[100] - 50.0).abs() < 1e-6);
        assert!(heights[101].is_nan());
        let coarse = |[x, y]: [f64; 2]| Some([x * 20.0, y * 20.0]);
        assert!((drawn(&coarse, [0, 0]).unwrap()[3 * TILE + 2] - 30_020.0).abs() < 1e-6);
    }
}
