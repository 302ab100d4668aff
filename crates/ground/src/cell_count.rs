//! How many cells the ground of a cloud takes, before any of them is in memory.

use crate::cells::{CELLS, Place, SIDE};
use crate::density::CoveredArea;

/// A block that touches fewer squares with points holds few of them: a full one has 64 or more.
const FEW_SQUARES: u32 = 4;

/// The cells that the ground of a cloud takes at most, in blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCount {
    /// The blocks.
    pub blocks: u64,
    /// Those of them that hold few points: they touch fewer than four squares with points.
    pub lone: u64,
}

impl CellCount {
    /// Returns the cells of all blocks.
    pub fn cells(&self) -> u64 {
        self.blocks.saturating_mul(CELLS as u64)
    }

    /// Tells whether half of the blocks or more hold few points: so it is where points lie far from all others.
    pub fn is_scattered(&self) -> bool {
        self.lone.saturating_mul(2) >= self.blocks
    }

    /// Returns about how many blocks the ground of rectangles takes, whose sides are so many metres, where points are so many metres apart.
    pub fn of_rectangles(rectangles: &[[f64; 2]], lattice: crate::MetricLattice, spacing: f64) -> CellCount {
        let side = f64::from(lattice.squares_for(spacing).steps) * f64::from(SIDE) * lattice.horizontal;
        // Along a line, blocks stick out by one in all.
        let along = |length: f64| length.max(0.0) / side + 1.0;
        let blocks = rectangles.iter().map(|[width, height]| along(*width) * along(*height)).sum::<f64>();
        CellCount { blocks: blocks as u64, lone: 0 }
    }
}

impl CoveredArea {
    /// Returns how many cells the ground takes at most. There may be a few less: a square with points touches blocks that they do not reach.
    pub fn cell_count(&self) -> CellCount {
        self.cell_count_for(self.spacing())
    }

    /// As [`CoveredArea::cell_count`], for cells of points that are so many metres apart.
    pub fn cell_count_for(&self, spacing: f64) -> CellCount {
        let mut blocks: Vec<Place> = Vec::with_capacity(self.squares.len());
        for [[left, right], [bottom, top]] in self.touched_blocks(spacing) {
            blocks.extend((bottom..=top).flat_map(|row| (left..=right).map(move |column| [column, row])));
        }
        blocks.sort_unstable();
        let sizes = blocks.chunk_by(|a, b| a == b).map(<[_]>::len);
        sizes.fold(CellCount::default(), |CellCount { blocks, lone }, squares| CellCount {
            blocks: blocks + 1,
            lone: lone + u64::from(squares < FEW_SQUARES as usize),
        })
    }

    /// Returns how many cells the ground takes at least, if points are no farther apart than so many metres and there may be others.
    pub fn least_cells(&self, spacing: f64) -> u64 {
        // A square that touches two blocks may have its points in either.
        let only =
            |[[left, right], [bottom, top]]: [[i32; 2]; 2]| (left == right && bottom == top).then_some([left, bottom]);
        let mut blocks: Vec<Place> = self.touched_blocks(spacing).filter_map(only).collect();
        blocks.sort_unstable();
        blocks.dedup();
        (blocks.len() * CELLS) as u64
    }

    /// Returns the columns of blocks that each square with points touches, the first and the last, and the rows, for points that are so many metres
    /// apart.
    fn touched_blocks(&self, spacing: f64) -> impl Iterator<Item = [[i32; 2]; 2]> {
        let cells = self.lattice.squares_for(spacing);
        let block_at = move |axis: usize, step: i64| {
            // Columns and rows of cells fit, so those of blocks do.
            i32::try_from(cells.number_at(axis, step).div_euclid(i64::from(SIDE))).unwrap_or(i32::MAX)
        };
        let along = move |axis: usize, number: i32| self.cells.span(axis, number).map(|step| block_at(axis, step));
        self.squares.iter().map(move |square| [along(0, square[0]), along(1, square[1])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lowest::LowestHeights;
    use crate::{MetricLattice, PointCollector};
    use proptest::prelude::*;

    const LATTICE: MetricLattice = MetricLattice { horizontal: 0.01, vertical: 0.01, offset: [123_456, -7_890] };

    /// Returns the area and the cells of a cloud.
    fn counted(lattice: MetricLattice, points: &[[i32; 3]]) -> (CoveredArea, u64) {
        let mut area = CoveredArea::new(lattice);
        area.add(points.iter().copied());
        let mut lowest = LowestHeights::new(&area);
        lowest.add(points.iter().copied());
        (area, lowest.cells())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// However dense a cloud is and wherever it lies, in metres or in degrees.
        #[test]
        fn the_cells_of_a_cloud_are_within_what_is_counted(
            points in proptest::collection::vec([-9_000i32..9_000, -3_000..9_000, 0..1], 1..400),
            spread in 1i32..5_000, horizontal in prop::sample::select(vec![0.001, 0.01, 0.37, 25.0]),
            offset in [-1_000_000_000i64..1_000_000_000, -100_000..100_000],
        ) {
            let points: Vec<[i32; 3]> = points.iter().map(|[x, y, z]| [x * spread, y * spread, *z]).collect();
            let (area, cells) = counted(MetricLattice { horizontal, vertical: 0.01, offset }, &points);
            let most = area.cell_count();
            prop_assert!(cells <= most.cells() && most.blocks <= 4 * cells / CELLS as u64, "{cells}, {most:?}");
            prop_assert!(area.least_cells(area.spacing()) <= cells);
            prop_assert!(area.squares() <= cells);
        }
    }

    #[test]
    fn a_dense_cloud_is_counted_to_a_few_blocks_and_is_not_scattered() {
        let points: Vec<[i32; 3]> = (0..1_000_000).map(|n| [n % 1000 * 100, n / 1000 * 100, 0]).collect();
        let (area, cells) = counted(LATTICE, &points);
        let most = area.cell_count();
        assert!(cells <= most.cells() && most.cells() * 8 <= cells * 9, "{cells}, {most:?}");
        assert!(area.least_cells(area.spacing()) * 8 >= cells * 7 && !most.is_scattered());
        let about = CellCount::of_rectangles(&[[1e3, 1e3]], LATTICE, area.spacing()).cells();
        assert!(about * 8 <= cells * 9 && about * 9 >= cells * 8, "{about} instead of {cells}");
    }

    #[test]
    fn points_far_from_all_others_have_a_block_each() {
        let near = (0..40_000).map(|n| [n % 200 * 100, n / 200 * 100, 0]);
        let far = (0..1000).map(|n| [20_000_000 + n % 40 * 500_000, n / 40 * 700_000, 0]);
        let points: Vec<[i32; 3]> = near.chain(far).collect();
        let (area, cells) = counted(LATTICE, &points);
        let most = area.cell_count();
        assert!(most.is_scattered() && most.lone >= 1000, "{most:?}");
        assert!(cells >= 1000 * CELLS as u64 && cells <= most.cells());
    }
}
