//! Finds quickly whether a point of the cloud makes room for breaklines.

use crate::breaklines::box_tree::BoxTree;
use crate::breaklines::exact::{disc_box, holds, in_disc, meet, piece_boxes, segment_box};
use crate::breaklines::lakes::{Fraction, Lakes};
use crate::geometry::square_grid::SquareGrid;
use crate::geometry::{Bounds, Site};

/// The most cells of the grid: 4 MiB.
const MOST_CELLS: i64 = 1 << 22;

/// How many cells there are for each subsegment, so that few points lie in a cell with one.
const CELLS_EACH: i64 = 64;

/// What a cell of the grid is known to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    /// No disc and no lake.
    Land,
    /// All of it is inside a lake.
    Water,
    /// Perhaps a disc or a shore.
    Mixed,
}

/// The discs of subsegments, the lakes, and a grid that answers for most points at once.
#[derive(Clone, Debug)]
pub(crate) struct DropIndex {
    /// The box of all discs and lakes: no other point is dropped.
    bounds: Option<Bounds<2>>,
    grid: SquareGrid,
    cells: Vec<Cell>,
    discs: BoxTree<[Site; 2]>,
    lakes: Lakes,
}

impl DropIndex {
    /// Returns the index of these subsegments and lakes. Cells have sides of `least_side` lattice steps or more.
    pub(crate) fn new(subsegments: impl Iterator<Item = [Site; 2]>, lakes: Lakes, least_side: u32) -> DropIndex {
        let discs: Vec<_> = subsegments.map(|[a, b]| (disc_box(a, b), [a, b])).collect();
        let shores = lakes.shores().map(|[a, b]| segment_box(a, b));
        let bounds = discs.iter().map(|(bounds, _)| *bounds).chain(shores).reduce(Bounds::union);
        let most_cells = (CELLS_EACH * discs.len() as i64).clamp(1, MOST_CELLS);
        let extent = bounds.unwrap_or(Bounds::of_point([0, 0]));
        let side = side(extent, most_cells).max(i64::from(least_side));
        let grid = SquareGrid::new(extent, side as f64, f64::INFINITY);
        let mut marks = Marks { extent, side, columns: grid.columns(), cells: vec![Cell::Land; grid.cells()] };
        discs.iter().for_each(|(bounds, _)| marks.mark(bounds));
        let length = side.min(1 << 30) as u32;
        lakes.shores().for_each(|[a, b]| piece_boxes(a, b, length).for_each(|bounds| marks.mark(&bounds)));
        if !lakes.is_empty() {
            marks.fill(&lakes);
        }
        DropIndex { bounds, grid, cells: marks.cells, discs: BoxTree::new(discs), lakes }
    }

    /// Returns whether `place` lies in the closed disc of a subsegment or inside a lake.
    #[inline]
    pub(crate) fn drops(&self, place: Site) -> bool {
        self.bounds.is_some_and(|bounds| holds(&bounds, place))
            && match self.cells[self.grid.cell(place[0], place[1])] {
                Cell::Land => false,
                Cell::Water => true,
                Cell::Mixed => self.is_in_disc(place) || self.is_water(Fraction::middle_of(&[place])),
            }
    }

    fn is_in_disc(&self, place: Site) -> bool {
        let point = Bounds::of_point(place);
        self.discs.any(|bounds| meet(bounds, &point), |[a, b]| in_disc(a, b, place))
    }

    /// Returns whether the point is inside a lake.
    pub(crate) fn is_water(&self, point: Fraction) -> bool {
        self.lakes.hold(point, |_| true)
    }
}

/// Returns the side of square cells of which about `most` cover the box.
fn side(extent: Bounds<2>, most: i64) -> i64 {
    let [width, height] = [0, 1].map(|axis| extent.extent(axis) as i128 + 1);
    // A long thin box would have a cell more in each row.
    let square = ((width * height) as u128 / most as u128).isqrt() as i64 + 1;
    square.max((width.max(height) as i64) / most + 1)
}

/// The grid while it is filled.
struct Marks {
    extent: Bounds<2>,
    side: i64,
    columns: usize,
    cells: Vec<Cell>,
}

impl Marks {
    fn mark(&mut self, bounds: &Bounds<2>) {
        let rows = (self.cells.len() / self.columns) as i64;
        let lines = |axis: usize, count: i64| {
            let line = |value: i32| (i64::from(value) - i64::from(self.extent.min[axis])).div_euclid(self.side);
            line(bounds.min[axis]).clamp(0, count - 1) as usize..=line(bounds.max[axis]).clamp(0, count - 1) as usize
        };
        let (columns, rows) = (lines(0, self.columns as i64), lines(1, rows));
        for row in rows {
            let row = row * self.columns;
            self.cells[row + columns.start()..=row + columns.end()].fill(Cell::Mixed);
        }
    }

    /// Finds the cells that are inside lakes. No shore runs through an unmarked cell, so its corner stands for it, and for the unmarked
    /// cell next to it.
    fn fill(&mut self, lakes: &Lakes) {
        let corner = |axis: usize, line: usize| (i64::from(self.extent.min[axis]) + line as i64 * self.side) as i32;
        for (row, cells) in self.cells.chunks_mut(self.columns).enumerate() {
            let mut before = Cell::Mixed;
            for (column, cell) in cells.iter_mut().enumerate() {
                if *cell == Cell::Land {
                    let at = [corner(0, column), corner(1, row)];
                    let is_water = || lakes.hold(Fraction::middle_of(&[at]), |_| true);
                    *cell =
                        if before == Cell::Mixed { if is_water() { Cell::Water } else { Cell::Land } } else { before };
                }
                before = *cell;
            }
        }
    }
}
