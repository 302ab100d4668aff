//! A square of cells in memory, and drawing the triangles of tiles into it.

use crate::output::raster::BLOCK;
use crate::output::raster::grid::{Beside, RasterGrid, Subunits};
use crate::output::raster::height::{Corners, HeightTriangle};
use crate::output::raster::whole_numbers::WholeNumber;
use crate::{Result, interrupt};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// How lattice heights become heights of the source.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeightScale {
    pub(crate) offset: f64,
    pub(crate) step: f64,
}

impl HeightScale {
    fn source(self, lattice: f64) -> f32 {
        (self.offset + self.step * lattice) as f32
    }
}

/// Vertices on the lattice and triangles between them.
#[derive(Debug, Default)]
pub(crate) struct LatticeMesh {
    pub(crate) positions: Vec<[i32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// A window on a raster. Any thread may draw into it: where triangles meet, all of them give a cell the same bits.
pub(crate) struct Window<'a> {
    grid: &'a RasterGrid,
    heights: HeightScale,
    /// The first column and row.
    first: [u32; 2],
    /// Columns and rows, some of which may lie outside the raster.
    side: usize,
    /// The bits of the heights, row by row; those of NaN where there is none.
    cells: Vec<AtomicU32>,
}

/// The process asks whether it should stop after this many triangles: slivers as long as the terrain take long.
const TRIANGLES_BETWEEN_CHECKS: usize = 1 << 12;

/// Up to this many cells in a row, to test each is faster than to divide.
const FEW: u32 = 4;

impl<'a> Window<'a> {
    /// Returns an empty window with a side of so many cells.
    pub(crate) fn new(grid: &'a RasterGrid, heights: HeightScale, side: usize) -> Window<'a> {
        let cells = (0..side * side).into_par_iter().map(|_| AtomicU32::new(f32::NAN.to_bits())).collect();
        Window { grid, heights, first: [0; 2], side, cells }
    }

    /// Moves the window so that its first column and row are these, and empties it.
    pub(crate) fn move_to(&mut self, first: [u32; 2]) {
        self.first = first;
        self.cells.par_iter_mut().for_each(|cell| *cell.get_mut() = f32::NAN.to_bits());
    }

    /// Returns the columns and rows along its side.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// Returns the height of a cell by its number in the window, row by row; NaN if it has none.
    pub(crate) fn height(&self, number: usize) -> f32 {
        f32::from_bits(self.cells[number].load(Ordering::Relaxed))
    }

    /// Draws the triangles of `mesh`: every cell whose centre is in one of them, or on its border, gets its height there.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(crate) fn draw(&self, mesh: &LatticeMesh) -> Result<()> {
        match self.grid.narrow() {
            Some(subunits) => self.draw_all(subunits, mesh),
            None => self.draw_all(self.grid.wide(), mesh),
        }
    }

    fn draw_all<T: WholeNumber>(&self, subunits: &Subunits<T>, mesh: &LatticeMesh) -> Result<()> {
        // Rows go south.
        let place = |&[x, y, z]: &[i32; 3]| [x, -y, z];
        let size = self.grid.size();
        let beside = |position: &[i32; 3]| {
            let place = place(position);
            [0, 1].map(|axis| subunits.beside(axis, place[axis], size[axis]))
        };
        let beside: Vec<[Beside; 2]> = mesh.positions.iter().map(beside).collect();
        for triangles in mesh.triangles.chunks(TRIANGLES_BETWEEN_CHECKS) {
            interrupt::check()?;
            for corners in triangles.iter().map(|triangle| triangle.map(|v| v as usize)) {
                let cells = corners.map(|v| beside[v]);
                let [columns, rows] = [0, 1].map(|axis| self.within(axis, cells.map(|cell| cell[axis])));
                if columns[0] < columns[1] && rows[0] < rows[1] {
                    self.draw_triangle(subunits, corners.map(|v| place(&mesh.positions[v])), columns, rows);
                }
            }
        }
        Ok(())
    }

    /// Returns the columns or rows of the window that corners span.
    #[inline(always)]
    fn within(&self, axis: usize, [a, b, c]: [Beside; 3]) -> [u32; 2] {
        let (from, past) = (a.from.min(b.from).min(c.from), a.past.max(b.past).max(c.past));
        let first = self.first[axis];
        [from.max(first), past.min(first.saturating_add(self.side as u32))]
    }

    fn draw_triangle<T: WholeNumber>(
        &self,
        subunits: &Subunits<T>,
        corners: Corners,
        columns: [u32; 2],
        rows: [u32; 2],
    ) {
        let extent = |axis: usize| {
            let [a, b, c] = corners.map(|corner| i64::from(corner[axis]));
            a.max(b).max(c) - a.min(b).min(c)
        };
        match extent(0).max(extent(1)) <= subunits.longest {
            true => self.fill(&HeightTriangle::new(subunits, corners), columns, rows),
            false => self.fill(&HeightTriangle::new(self.grid.wide(), corners), columns, rows),
        }
    }

    fn fill<T: WholeNumber>(&self, triangle: &HeightTriangle<T>, columns: [u32; 2], rows: [u32; 2]) {
        let steps = triangle.steps_along_row();
        for row in rows[0]..rows[1] {
            let first = triangle.weights(columns[0], row);
            let weights = |column: u32| {
                let along = T::from(column - columns[0]);
                [0, 1, 2].map(|k| first[k] + steps[k] * along)
            };
            let [from, to] = match columns[1] - columns[0] <= FEW {
                true => columns,
                false => inside(first, steps, columns),
            };
            for column in from..to {
                let weights = weights(column);
                if weights.iter().all(|weight| *weight >= T::from(0i32)) {
                    let height = self.heights.source(triangle.height(weights, column, row));
                    self.cell(column, row).store(height.to_bits(), Ordering::Relaxed);
                }
            }
        }
    }

    fn cell(&self, column: u32, row: u32) -> &AtomicU32 {
        &self.cells[(row - self.first[1]) as usize * self.side + (column - self.first[0]) as usize]
    }

    /// Returns a block by its column and row among those of the window, with `nodata` where there is no height, and how many heights of it
    /// are just that number. Returns `None` if it has no height.
    pub(crate) fn block(&self, block: [usize; 2], nodata: f32) -> Option<(Vec<f32>, u64)> {
        filled(self.side, block, nodata, |number| self.height(number))
    }
}

/// As [`Window::block`], of an image with a side of so many pixels.
pub(crate) fn filled(
    side: usize,
    [column, row]: [usize; 2],
    nodata: f32,
    pixel: impl Fn(usize) -> f32,
) -> Option<(Vec<f32>, u64)> {
    let first = row * BLOCK * side + column * BLOCK;
    let (mut cells, mut count, mut same) = (Vec::with_capacity(BLOCK * BLOCK), 0u64, 0);
    for row in 0..BLOCK {
        for column in 0..BLOCK {
            let height = pixel(first + row * side + column);
            let is_height = !height.is_nan();
            count += u64::from(is_height);
            same += u64::from(height == nodata);
            cells.push(if is_height { height } else { nodata });
        }
    }
    (count > 0).then_some((cells, same))
}

/// Returns the columns of a row in which no weight is negative. `first` are those of the first column.
fn inside<T: WholeNumber>(first: [T; 3], steps: [T; 3], columns: [u32; 2]) -> [u32; 2] {
    let zero = T::from(0i32);
    let [mut from, mut to] = [0, columns[1] - columns[0]];
    for (value, step) in first.into_iter().zip(steps) {
        if step > zero && value < zero {
            let (whole, is_exact) = (-value).divided(step);
            from = from.max((whole + T::from(i32::from(!is_exact))).within(to));
        } else if value < zero {
            return [columns[0]; 2];
        } else if step < zero {
            let past = value.divided(-step).0 + T::from(1i32);
            to = to.min(past.within(to));
        }
    }
    [columns[0] + from, columns[0] + to.max(from)]
}
