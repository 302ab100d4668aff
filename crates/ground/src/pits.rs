//! Low noise: points far below all around them. Below a closed canopy the ground looks like that too, where few pulses reach it.

use crate::cells::{Cells, Window};
use crate::morphology::{EMPTY, NEIGHBOURS, dilation, erosion, only_where};

/// A pit may be noise if a closing by its neighbours lies so many widths of a cell above it ...
const DEEP: f32 = 3.0;
/// ... and so many metres at least everywhere within so many metres: else it is ground between trees.
const LEAST_DEPTH: f32 = 1.0;
const REACH: f64 = 10.0;
/// It is ground below a canopy if there are others at its level on all sides, within so many metres.
const LEVEL_REACH: f64 = 15.0;
/// They lie within so many metres of its height, and so many more for each metre between them ...
const LEVEL: f32 = 1.0;
const LEVEL_BY_DISTANCE: f32 = 0.3;
/// ... and are this share of the cells of a side, and so many.
const LEAST_SHARE: f32 = 0.03;
const LEAST_COUNT: u32 = 2;
/// A side with fewer cells that have points, or with a smaller share of its cells, is not looked at: the border of the cloud is near.
const LEAST_CELLS: u32 = 8;
const LEAST_COVERED: f64 = 0.25;

/// Returns the lowest points without low noise. A cell is `width` metres wide.
pub(crate) fn without_pits(lowest: &Cells<f32>, width: f64) -> Cells<f32> {
    let has_point = &lowest.each(false, |height| height != EMPTY);
    let highest = only_where(&dilation(lowest, NEIGHBOURS), has_point);
    let closed = only_where(&erosion(&highest, NEIGHBOURS), has_point);
    let around = erosion(&closed, REACH / width);
    let deep = DEEP * width as f32;
    let is_pit = lowest.with(&closed, false, |height, closed| height != EMPTY && closed - height > deep);
    let is_lower = lowest.with(&around, false, |height, around| height != EMPTY && around - height > LEAST_DEPTH);
    let may_be_noise = &is_pit.with(&is_lower, false, |is_pit, is_lower| is_pit && is_lower);
    let cells_of_side = 0.25 * std::f64::consts::PI * (LEVEL_REACH / width) * (LEVEL_REACH / width);
    let level = Level {
        width: width as f32,
        reach: (LEVEL_REACH / width).ceil() as i32,
        least_cells: LEAST_CELLS.max((LEAST_COVERED * cells_of_side) as u32),
    };
    let is_kept = lowest.map(false, level.reach, |window| {
        let may_be_noise = may_be_noise.window(window.place, 0);
        window.each(|column, row| !may_be_noise.at(column, row) || level.is_all_around(window, [column, row]))
    });
    only_where(lowest, &is_kept)
}

/// Whether there are points at the level of a cell around it.
struct Level {
    /// The width of a cell in metres.
    width: f32,
    /// In cells.
    reach: i32,
    /// Sides with fewer cells are not looked at.
    least_cells: u32,
}

/// The cells of one of the four sides of a cell.
#[derive(Clone, Copy, Default)]
struct Side {
    cells: u32,
    at_level: u32,
}

impl Level {
    fn is_all_around(&self, window: &Window<f32>, [column, row]: [i32; 2]) -> bool {
        let height = window.at(column, row);
        let mut sides = [Side::default(); 4];
        for up in -self.reach..=self.reach {
            for right in -self.reach..=self.reach {
                let other = window.at(column + right, row + up);
                let distance = ((right * right + up * up) as f32).sqrt() * self.width;
                if (right, up) != (0, 0) && other != EMPTY && distance <= LEVEL_REACH as f32 {
                    let side = &mut sides[side_of(right, up)];
                    side.cells += 1;
                    side.at_level += u32::from((other - height).abs() <= LEVEL + LEVEL_BY_DISTANCE * distance);
                }
            }
        }
        let mut known = sides.iter().filter(|side| side.cells >= self.least_cells).peekable();
        let is_level =
            |side: &Side| side.at_level >= LEAST_COUNT && side.at_level as f32 >= LEAST_SHARE * side.cells as f32;
        known.peek().is_some() && known.all(is_level)
    }
}

/// Returns the number of the side on which a cell lies that is so many columns and rows away: each is a quarter turn.
fn side_of(right: i32, up: i32) -> usize {
    match (right > 0 || right == 0 && up > 0, up > 0 || up == 0 && right < 0) {
        (true, true) => 0,
        (false, true) => 1,
        (false, false) => 2,
        (true, false) => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::SIDE;

    /// Cells of a metre with these heights.
    fn cells(height: impl Fn(i32, i32) -> f32 + Sync) -> Cells<f32> {
        Cells::of(EMPTY, vec![[0, 0], [1, 0]], |[block, _]| {
            (0..SIDE * SIDE).map(|number| height(block * SIDE + number % SIDE, number / SIDE)).collect()
        })
    }

    /// One cell in eight, in no order.
    fn is_hit(column: i32, row: i32) -> bool {
        let mixed = (column as u32).wrapping_mul(0x9e37_79b1) ^ (row as u32).wrapping_mul(0x85eb_ca6b);
        (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d) >> 29 == 0
    }

    #[test]
    fn ground_below_a_closed_canopy_stays() {
        let canopy = |column, row| if is_hit(column, row) { 0.1 * column as f32 } else { 15.0 + 0.1 * column as f32 };
        let found = without_pits(&cells(canopy), 1.0);
        // At the border of the cloud sides are small.
        for column in 8..2 * SIDE - 8 {
            for row in 8..SIDE - 8 {
                assert_ne!(found.at([column, row]), EMPTY, "{column}, {row}");
            }
        }
    }

    #[test]
    fn noise_below_open_ground_goes() {
        let noise = |column: i32, row: i32| {
            let is_alone = [column, row] == [20, 30] || [column, row] == [70, 40];
            let is_pair = (40..42).contains(&column) && row == 10;
            if is_alone || is_pair { -9.0 } else { 0.0 }
        };
        let found = without_pits(&cells(noise), 1.0);
        for column in 0..2 * SIDE {
            for row in 0..SIDE {
                let is_noise = noise(column, row) < 0.0;
                assert_eq!(found.at([column, row]) == EMPTY, is_noise, "{column}, {row}");
            }
        }
    }

    #[test]
    fn sides_are_quarters() {
        let mut counts = [0; 4];
        for up in -5..=5 {
            for right in -5..=5 {
                if (right, up) != (0, 0) {
                    counts[side_of(right, up)] += 1;
                }
            }
        }
        assert_eq!(counts, [30; 4]);
    }
}
