//! A square of cells in memory, and drawing the triangles of tiles into it.

use crate::raster::BLOCK;
use crate::raster::grid::{Beside, RasterGrid, Subunits};
use crate::raster::height::{Corners, HeightTriangle};
use crate::raster::products::{GradientScale, Neighbours, RasterProduct};
use crate::raster::whole_numbers::WholeNumber;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};
use sys::{Result, interrupt};

/// How lattice heights become heights of the source.
#[derive(Clone, Copy, Debug)]
pub struct HeightScale {
    /// The height of 0.
    pub offset: f64,
    /// The height of 1 above that of 0.
    pub step: f64,
}

impl HeightScale {
    /// Returns a height of the lattice as a cell has it.
    #[inline]
    pub fn source(self, lattice: f64) -> f32 {
        (self.offset + self.step * lattice) as f32
    }
}

/// Vertices on the lattice and triangles between them.
#[derive(Debug, Default)]
pub struct LatticeMesh {
    /// The vertices: x, y, z in steps of the lattice.
    pub positions: Vec<[i32; 3]>,
    /// The corners of each triangle: numbers of vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// A window on a raster, with a cell more on each side, for slopes. Any thread may draw into it: where triangles meet, all of them give a
/// cell the same bits.
pub struct Window<'a> {
    /// The grid of the raster with its margin.
    grid: &'a RasterGrid,
    heights: HeightScale,
    gradients: GradientScale,
    /// The first column and row of the window in the raster, which is that of its margin in the grid.
    first: [u32; 2],
    /// Columns and rows, some of which may lie outside the raster.
    side: usize,
    /// The bits of the heights, row by row with the margin; those of NaN where there is none.
    cells: Vec<AtomicU32>,
}

/// Cells around a window or a raster that have no place in its file.
const MARGIN: usize = 1;

/// The process asks whether it should stop after this many triangles: slivers as long as the terrain take long.
const TRIANGLES_BETWEEN_CHECKS: usize = 1 << 12;

/// Up to this many cells in a row, to test each is faster than to divide.
const FEW: u32 = 4;

impl<'a> Window<'a> {
    /// Returns an empty window with a side of so many cells. `grid` is the raster's [`RasterGrid::with_margin`].
    pub fn new(grid: &'a RasterGrid, heights: HeightScale, gradients: GradientScale, side: usize) -> Window<'a> {
        let stored = (side + 2 * MARGIN) * (side + 2 * MARGIN);
        let cells = (0..stored).into_par_iter().map(|_| AtomicU32::new(f32::NAN.to_bits())).collect();
        Window { grid, heights, gradients, first: [0; 2], side, cells }
    }

    /// Moves the window so that its first column and row are these, and empties it.
    pub fn move_to(&mut self, first: [u32; 2]) {
        self.first = first;
        self.cells.par_iter_mut().for_each(|cell| *cell.get_mut() = f32::NAN.to_bits());
    }

    /// Returns the columns and rows along its side.
    #[inline]
    pub fn side(&self) -> usize {
        self.side
    }

    /// Returns the height of a cell by its number in the window, row by row; NaN if it has none.
    pub fn height(&self, number: usize) -> f32 {
        if self.is_inside(number) { self.stored(self.place(number)) } else { f32::NAN }
    }

    /// Returns what a raster of `product` has in a cell, by its number in the window, row by row; NaN if it has nothing.
    pub fn value(&self, product: RasterProduct, number: usize) -> f32 {
        if product == RasterProduct::Height || !self.is_inside(number) {
            return self.height(number);
        }
        let center = self.place(number);
        let stride = self.stride();
        let around = |n: usize| self.stored(center + n / 3 * stride + n % 3 - stride - 1);
        product.value(Neighbours(std::array::from_fn(around)), self.gradients)
    }

    /// Tells whether a cell of the window is one of the raster, and not of its margin or beyond.
    #[inline]
    fn is_inside(&self, number: usize) -> bool {
        let cell = [number % self.side, number / self.side];
        (0..2).all(|axis| self.first[axis] as usize + cell[axis] + 2 * MARGIN < self.grid.size()[axis] as usize)
    }

    fn stride(&self) -> usize {
        self.side + 2 * MARGIN
    }

    /// Returns where a cell is stored.
    #[inline]
    fn place(&self, number: usize) -> usize {
        (number / self.side + MARGIN) * self.stride() + number % self.side + MARGIN
    }

    #[inline]
    fn stored(&self, place: usize) -> f32 {
        f32::from_bits(self.cells[place].load(Ordering::Relaxed))
    }

    /// Draws the triangles of `mesh`: every cell whose centre is in one of them, or on its border, gets its height there.
    ///
    /// # Errors
    /// [`sys::Error::Interrupted`].
    pub fn draw(&self, mesh: &LatticeMesh) -> Result<()> {
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
        [from.max(first), past.min(first.saturating_add(self.stride() as u32))]
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

    #[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
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
        &self.cells[(row - self.first[1]) as usize * self.stride() + (column - self.first[0]) as usize]
    }
}

/// Returns the cells, row by row, of a block of an image with a side of so many pixels, by its column and row among the blocks. Returns
/// `None` if it has no value. `pixel` is the image, with NaN where there is none, which becomes `nodata`.
pub fn filled(side: usize, [column, row]: [usize; 2], nodata: f32, pixel: impl Fn(usize) -> f32) -> Option<Vec<f32>> {
    let first = row * BLOCK * side + column * BLOCK;
    let (mut cells, mut has_values) = (Vec::with_capacity(BLOCK * BLOCK), false);
    for row in 0..BLOCK {
        for column in 0..BLOCK {
            let value = pixel(first + row * side + column);
            has_values |= !value.is_nan();
            cells.push(if value.is_nan() { nodata } else { value });
        }
    }
    has_values.then_some(cells)
}

/// Returns the columns of a row in which no weight is negative. `first` are those of the first column.
#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::grid::CellLimit;
    use crate::raster::grid::tests::aligned;
    use delaunay::geometry::Bounds;
    use lattice::Lattice;
    use proptest::prelude::*;
    use rust_decimal::Decimal;

    const SCALE: HeightScale = HeightScale { offset: 0.0, step: 1.0 };
    const GRADIENTS: GradientScale = GradientScale::new(1.0, 1.0, 1.0);

    fn grid(cell: Decimal) -> RasterGrid {
        let lattice = Lattice::new([Decimal::ZERO; 3], Decimal::ONE, Decimal::ONE).unwrap();
        RasterGrid::new(&lattice, aligned(cell), Bounds { min: [0; 2], max: [40; 2] }, CellLimit::OneFile).unwrap()
    }

    fn drawn(grid: &RasterGrid, positions: &[[i32; 3]], triangles: &[[u32; 3]]) -> Vec<u32> {
        let grid = grid.with_margin();
        let window = Window::new(&grid, SCALE, GRADIENTS, 64);
        window.draw(&LatticeMesh { positions: positions.to_vec(), triangles: triangles.to_vec() }).unwrap();
        (0..64 * 64).map(|number| window.height(number).to_bits()).collect()
    }

    fn count(cells: &[u32]) -> usize {
        cells.iter().filter(|cell| !f32::from_bits(**cell).is_nan()).count()
    }

    proptest! {
        /// Centres are at odd places, so that many lie on edges and vertices.
        #[test]
        fn neither_the_order_of_corners_nor_the_width_of_numbers_counts(
            corners in prop::array::uniform3(prop::array::uniform3(0i32..=40)),
            turned in Just([0u32, 1, 2]).prop_shuffle(),
        ) {
            let area = |[a, b, c]: [[i32; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            prop_assume!(area(corners) != 0);
            let grid = grid(Decimal::TWO);
            let cells = drawn(&grid, &corners, &[[0, 1, 2]]);
            prop_assert_eq!(&drawn(&grid, &corners, &[turned]), &cells);
            prop_assert_eq!(&drawn(&grid.clone().without_narrow(), &corners, &[[0, 1, 2]]), &cells);
            let inside = |column: usize, row: usize| {
                let [x, y] = [2 * column as i32 + 1, 39 - 2 * row as i32];
                let center = [x, y, 0];
                let [a, b, c] = corners;
                let areas = [[center, b, c], [a, center, c], [a, b, center]].map(|t| area(t) * area(corners).signum());
                areas.iter().all(|area| *area >= 0)
            };
            let expected = (0..20).flat_map(|row| (0..20).map(move |column| (column, row))).filter(|(c, r)| inside(*c, *r));
            prop_assert_eq!(count(&cells), expected.clone().count());
            for (column, row) in expected {
                prop_assert!(!f32::from_bits(cells[row * 64 + column]).is_nan());
            }
        }

        /// Triangles around a vertex agree on the bits of the cells on their edges, whichever is drawn last.
        #[test]
        fn neighbours_agree_on_their_border(
            middle in prop::array::uniform3(15i32..=25),
            arms in prop::collection::vec((1i32..=14, 0i32..=14, 0i32..=40), 4),
        ) {
            // Each arm leads into another quarter.
            let mut positions = vec![middle];
            for (quarter, (long, short, z)) in arms.into_iter().enumerate() {
                let short = short % long;
                let [x, y] = [[long, short], [-short, long], [-long, -short], [short, -long]][quarter];
                positions.push([middle[0] + x, middle[1] + y, z]);
            }
            let grid = grid(Decimal::TWO);
            let mut triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
            let cells = drawn(&grid, &positions, &triangles);
            for _ in 0..3 {
                triangles.rotate_left(1);
                prop_assert_eq!(&drawn(&grid, &positions, &triangles), &cells);
            }
        }
    }

    #[test]
    fn a_window_has_its_part_of_the_raster() {
        let grid = grid(Decimal::ONE);
        let mesh = LatticeMesh { positions: vec![[0, 0, 0], [40, 0, 40], [0, 40, 0]], triangles: vec![[0, 1, 2]] };
        let grid = grid.with_margin();
        let mut window = Window::new(&grid, SCALE, GRADIENTS, 16);
        window.move_to([16, 16]);
        window.draw(&mesh).unwrap();
        // The cell in column 18 and row 22, and one beyond the long edge.
        assert_eq!(window.height(6 * 16 + 2), 18.5);
        assert!(window.height(15).is_nan());
        window.move_to([0, 0]);
        assert!((0..256).all(|number| window.height(number).is_nan()));
    }
}
