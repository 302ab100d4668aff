//! Finds quickly whether a point of the cloud makes room for breaklines.

use crate::box_tree::BoxTree;
use crate::exact::{disc_box, holds, in_disc, meet, piece_boxes, segment_box};
use crate::lakes::{Fraction, Lakes};
use delaunay::geometry::square_grid::SquareGrid;
use delaunay::geometry::{Bounds, Site};

/// The most cells of the grid: 16 MiB.
const MOST_CELLS: i64 = 1 << 22;

/// How many cells there are for each subsegment, so that few points lie in a cell with one.
const CELLS_EACH: i64 = 64;

/// A cell with more discs has no list: the tree finds them faster.
const MOST_LISTED: u32 = 48;

/// A cell without discs and shores, on land or on water; lesser numbers are those of mixed cells.
const LAND: u32 = u32::MAX;
const WATER: u32 = u32::MAX - 1;

/// What is known about water in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Water {
    Outside,
    Inside,
    /// A shore may run through the cell.
    Shore,
}

/// A cell with discs or shores.
#[derive(Clone, Copy, Debug)]
struct MixedCell {
    /// Where its discs are listed.
    first: u32,
    count: u32,
    has_shore: bool,
}

/// The discs of subsegments, the lakes, and a grid that answers for most points at once.
#[derive(Clone, Debug)]
pub(crate) struct DropIndex {
    /// The box of all discs and lakes: no other point is dropped.
    bounds: Option<Bounds<2>>,
    grid: SquareGrid,
    cells: Vec<u32>,
    mixed: Vec<MixedCell>,
    listed: Vec<[Site; 2]>,
    discs: BoxTree<[Site; 2]>,
    lakes: Lakes,
}

impl DropIndex {
    /// Returns the index of these subsegments and lakes. Cells have sides of `least_side` lattice steps or more.
    pub(crate) fn new(subsegments: impl Iterator<Item = [Site; 2]>, lakes: Lakes, least_side: u32) -> DropIndex {
        let discs: Vec<_> = subsegments.map(|[a, b]| (disc_box(a, b), [a, b])).collect();
        let shores = lakes.shores().map(|(_, [a, b])| segment_box(a, b));
        let bounds = discs.iter().map(|(bounds, _)| *bounds).chain(shores).reduce(Bounds::union);
        let most = (CELLS_EACH * discs.len() as i64).clamp(1, MOST_CELLS);
        let layout = Layout::new(bounds.unwrap_or(Bounds::of_point([0, 0])), most, least_side.into());
        let water = layout.water(&lakes);
        let mut cells = vec![0; layout.grid.cells()];
        discs.iter().for_each(|(bounds, _)| layout.for_each_cell(bounds, |cell| cells[cell] += 1));
        let mixed = number_mixed(&mut cells, &water);
        let listed = list(&discs, &cells, &mixed, &layout);
        DropIndex { bounds, grid: layout.grid, cells, mixed, listed, discs: BoxTree::new(discs), lakes }
    }

    /// Returns whether `place` lies in the closed disc of a subsegment or inside a lake.
    #[inline]
    pub(crate) fn drops(&self, place: Site) -> bool {
        self.bounds.is_some_and(|bounds| holds(&bounds, place))
            && match self.cells[self.grid.cell(place[0], place[1])] {
                LAND => false,
                WATER => true,
                mixed => self.drops_in(&self.mixed[mixed as usize], place),
            }
    }

    /// Returns whether a disc or a shore may be near `place`. It is near every site of a line.
    pub(crate) fn is_near_line(&self, place: Site) -> bool {
        let is_inside = self.bounds.is_some_and(|bounds| holds(&bounds, place));
        is_inside && self.cells[self.grid.cell(place[0], place[1])] != LAND
    }

    fn drops_in(&self, cell: &MixedCell, place: Site) -> bool {
        let is_in_disc = if cell.count <= MOST_LISTED {
            let discs = &self.listed[cell.first as usize..(cell.first + cell.count) as usize];
            discs.iter().any(|&[a, b]| in_disc(a, b, place))
        } else {
            let point = Bounds::of_point(place);
            self.discs.any(|bounds| meet(bounds, &point), |[a, b]| in_disc(a, b, place))
        };
        is_in_disc || (cell.has_shore && self.is_water(Fraction::middle_of(&[place])))
    }

    /// Returns the lakes.
    pub(crate) fn lakes(&self) -> &Lakes {
        &self.lakes
    }

    /// Returns whether the point is inside a lake.
    pub(crate) fn is_water(&self, point: Fraction) -> bool {
        self.lakes.hold(point, |_| true)
    }
}

/// Puts into every cell its kind or its number in the list of mixed cells, which is returned. Before, cells have the numbers of their
/// discs.
fn number_mixed(cells: &mut [u32], water: &[Water]) -> Vec<MixedCell> {
    let (mut mixed, mut first) = (Vec::new(), 0);
    for (cell, water) in cells.iter_mut().zip(water) {
        let count = *cell;
        *cell = match water {
            Water::Inside => WATER,
            Water::Outside if count == 0 => LAND,
            _ => {
                mixed.push(MixedCell { first, count, has_shore: *water == Water::Shore });
                first += if count <= MOST_LISTED { count } else { 0 };
                mixed.len() as u32 - 1
            }
        };
    }
    mixed
}

/// Returns the lists of all mixed cells that have one.
fn list(discs: &[(Bounds<2>, [Site; 2])], cells: &[u32], mixed: &[MixedCell], layout: &Layout) -> Vec<[Site; 2]> {
    let length = mixed.iter().filter(|cell| cell.count <= MOST_LISTED).map(|cell| cell.count as usize).sum();
    let mut next: Vec<u32> = mixed.iter().map(|cell| cell.first).collect();
    let mut listed = vec![[[0; 2]; 2]; length];
    for (bounds, places) in discs {
        layout.for_each_cell(bounds, |cell| {
            let number = cells[cell] as usize;
            if mixed.get(number).is_some_and(|cell| cell.count <= MOST_LISTED) {
                listed[next[number] as usize] = *places;
                next[number] += 1;
            }
        });
    }
    listed
}

/// Where the cells of the grid are.
struct Layout {
    extent: Bounds<2>,
    side: i64,
    grid: SquareGrid,
}

impl Layout {
    /// Returns about `most` square cells over the box, or fewer.
    fn new(extent: Bounds<2>, most: i64, least_side: i64) -> Layout {
        let [width, height] = [0, 1].map(|axis| extent.extent(axis) + 1);
        // A long thin box would have a cell more in each row.
        let square = (width as u128 * height as u128 / most as u128).isqrt() as i64 + 1;
        let side = square.max(width.max(height) / most + 1).max(least_side);
        Layout { extent, side, grid: SquareGrid::new(extent, side as f64, f64::INFINITY) }
    }

    fn rows(&self) -> usize {
        self.grid.cells() / self.grid.columns()
    }

    /// Calls `found` with every cell that the box meets.
    fn for_each_cell(&self, bounds: &Bounds<2>, mut found: impl FnMut(usize)) {
        let lines = |axis: usize, count: usize| {
            let line = |value: i32| (i64::from(value) - i64::from(self.extent.min[axis])).div_euclid(self.side);
            let clamped = |value: i32| line(value).clamp(0, count as i64 - 1) as usize;
            clamped(bounds.min[axis])..=clamped(bounds.max[axis])
        };
        let columns = self.grid.columns();
        for row in lines(1, self.rows()) {
            lines(0, columns).for_each(|column| found(row * columns + column));
        }
    }

    /// Returns for every cell what is known about its water. No shore runs through an unmarked cell, so its corner stands for all of it,
    /// and for the unmarked cell next to it.
    fn water(&self, lakes: &Lakes) -> Vec<Water> {
        let mut water = vec![Water::Outside; self.grid.cells()];
        if lakes.is_empty() {
            return water;
        }
        let length = self.side.min(1 << 30) as u32;
        for bounds in lakes.shores().flat_map(|(_, [a, b])| piece_boxes(a, b, length)) {
            self.for_each_cell(&bounds, |cell| water[cell] = Water::Shore);
        }
        let corner = |axis: usize, line: usize| (i64::from(self.extent.min[axis]) + line as i64 * self.side) as i32;
        for (row, cells) in water.chunks_mut(self.grid.columns()).enumerate() {
            let mut before = Water::Shore;
            for (column, cell) in cells.iter_mut().enumerate() {
                if *cell != Water::Shore {
                    let corner = Fraction::middle_of(&[[corner(0, column), corner(1, row)]]);
                    *cell = match before {
                        Water::Shore if lakes.hold(corner, |_| true) => Water::Inside,
                        Water::Shore => Water::Outside,
                        known => known,
                    };
                }
                before = *cell;
            }
        }
        water
    }
}
