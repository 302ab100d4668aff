//! Grey-scale morphology with discs: the erosion and the dilation of heights. Cells without a height are left out.

use crate::cells::{Cells, SIDE, Window};

/// The height of a cell without one.
pub(crate) const EMPTY: f32 = f32::INFINITY;

/// The radius of three by three cells, in cells.
pub(crate) const NEIGHBOURS: f64 = 1.5;

/// Returns the least height within `radius` cells of each cell.
pub(crate) fn erosion(heights: &Cells<f32>, radius: f64) -> Cells<f32> {
    let disc = Disc::new(radius);
    heights.map(EMPTY, disc.reach, |window| disc.least(window))
}

/// Returns the greatest height within `radius` cells of each cell.
pub(crate) fn dilation(heights: &Cells<f32>, radius: f64) -> Cells<f32> {
    let disc = Disc::new(radius);
    heights.map(EMPTY, disc.reach, |window| {
        let values = window.values.iter().map(|height| turned(*height)).collect();
        let mut greatest = disc.least(&Window { values, ..*window });
        greatest.iter_mut().for_each(|height| *height = turned(*height));
        greatest
    })
}

/// Returns `heights` in the cells that are `wanted`.
pub(crate) fn only_where(heights: &Cells<f32>, wanted: &Cells<bool>) -> Cells<f32> {
    heights.with(wanted, EMPTY, |height, is_wanted| if is_wanted { height } else { EMPTY })
}

/// Returns the height upside down.
fn turned(height: f32) -> f32 {
    if height == EMPTY { EMPTY } else { -height }
}

/// A disc of cells: those whose middles lie within its radius of the middle one.
struct Disc {
    /// How many rows it has above the middle one.
    reach: i32,
    /// Half the width of each row, without the middle, from the middle row outwards.
    halves: Vec<usize>,
}

impl Disc {
    /// Returns the disc of a radius in cells.
    fn new(radius: f64) -> Disc {
        let reach = radius.floor() as i32;
        let half = |row: i32| {
            let squared = radius * radius - f64::from(row * row);
            (0..=reach).rev().find(|half| f64::from(half * half) <= squared).unwrap_or(0) as usize
        };
        Disc { reach, halves: (0..=reach).map(half).collect() }
    }

    /// Returns the least value in the disc around each cell of the block.
    fn least(&self, window: &Window<f32>) -> Box<[f32]> {
        let Window { side, values, .. } = window;
        // The least of 2^k values in a row, for each k.
        let mut runs = vec![values.clone()];
        let most = (2 * self.reach + 1).ilog2() as usize;
        while runs.len() <= most {
            let (last, step) = (&runs[runs.len() - 1], 1 << (runs.len() - 1));
            let mut next = last.clone();
            next.iter_mut().zip(&last[step..]).for_each(|(least, other)| *least = least.min(*other));
            runs.push(next);
        }
        let mut least = vec![EMPTY; (SIDE * SIDE) as usize].into_boxed_slice();
        for (row, of_row) in least.chunks_exact_mut(SIDE as usize).enumerate() {
            for from_middle in -self.reach..=self.reach {
                let half = self.halves[from_middle.unsigned_abs() as usize];
                let width = 2 * half + 1;
                let run = width.ilog2() as usize;
                let start = (row as i32 + self.reach + from_middle) as usize * side + self.reach as usize - half;
                let first = &runs[run][start..start + SIDE as usize];
                let second = start + width - (1 << run);
                let second = &runs[run][second..second + SIDE as usize];
                for ((least, first), second) in of_row.iter_mut().zip(first).zip(second) {
                    *least = least.min(first.min(*second));
                }
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slow(heights: &Cells<f32>, radius: f64, of: impl Fn(f32, f32) -> f32, cell: [i32; 2]) -> f32 {
        let (mut found, reach) = (EMPTY, radius as i32);
        for row in -reach..=reach {
            let is_in = |column: &i32| f64::from(column * column + row * row) <= radius * radius;
            for column in (-reach..=reach).filter(is_in) {
                let height = heights.at([cell[0] + column, cell[1] + row]);
                found = if found == EMPTY {
                    height
                } else if height == EMPTY {
                    found
                } else {
                    of(found, height)
                };
            }
        }
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn discs_are_those_of_the_definition(
            points in proptest::collection::vec(([-70i32..140, -70..140], -50i32..50), 1..60), radius in 0.0..70.0
        ) {
            let mut heights = Cells::new(EMPTY);
            for (cell, height) in &points {
                let (block, number) = crate::cells::split(*cell);
                heights.block_mut(block)[number] = *height as f32;
            }
            let heights = heights.map(EMPTY, 0, |window| window.values.clone().into());
            let (eroded, dilated) = (erosion(&heights, radius), dilation(&heights, radius));
            for &place in heights.places() {
                for number in [0, 5, 63, 64 * 63, 4095, 2080] {
                    let cell = [place[0] * SIDE + number % SIDE, place[1] * SIDE + number / SIDE];
                    prop_assert_eq!(eroded.at(cell), slow(&heights, radius, f32::min, cell));
                    prop_assert_eq!(dilated.at(cell), slow(&heights, radius, f32::max, cell));
                }
            }
        }
    }
}
