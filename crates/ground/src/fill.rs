//! Heights for cells without one, from those around them: coarser and coarser means, and back (pull and push), smoothed at each size (Gortler,
//! Grzeszczuk, Szeliski and Cohen 1996, "The Lumigraph", section 3.4).

use crate::cells::{Cells, Place, SIDE, Window};
use crate::morphology::EMPTY;

/// The height of a wide cell beyond all blocks. It needs none.
const BEYOND: f32 = f32::NEG_INFINITY;
/// A size of cells is smoothed so many times.
const SWEEPS: usize = 2;
/// Cells are no more than so many times twice as wide.
const SIZES: usize = 31;

/// Returns `heights` with one in every cell of its blocks, if any cell has one.
pub(crate) fn filled(heights: &Cells<f32>) -> Cells<f32> {
    let mut sizes = vec![heights.clone()];
    while sizes.len() < SIZES && !is_full(&sizes[sizes.len() - 1]) {
        let wider = twice_as_wide(&sizes[sizes.len() - 1]);
        sizes.push(wider);
    }
    let mut full: Option<Cells<f32>> = None;
    while let Some(known) = sizes.pop() {
        full = Some(full.map_or_else(|| with_mean(&known), |wide| smoothed(&known, narrowed(&known, &wide))));
    }
    full.unwrap_or_else(|| heights.clone())
}

/// Returns the heights with the mean of all in place of those that are missing. The widest cells are few.
fn with_mean(heights: &Cells<f32>) -> Cells<f32> {
    let known = heights.values().flatten().filter(|height| height.is_finite());
    let [count, sum] = known.fold([0.0f32; 2], |[count, sum], height| [count + 1.0, sum + height]);
    let mean = if count > 0.0 { sum / count } else { EMPTY };
    heights.each(EMPTY, |height| if height == EMPTY { mean } else { height })
}

/// Tells whether all cells have a height, as far as they need one.
fn is_full(heights: &Cells<f32>) -> bool {
    heights.places().iter().filter_map(|place| heights.block(*place)).flatten().all(|height| *height != EMPTY)
}

/// Returns cells of twice the width, with the mean of the four heights.
fn twice_as_wide(heights: &Cells<f32>) -> Cells<f32> {
    let mut places: Vec<Place> =
        heights.places().iter().map(|[column, row]| [column.div_euclid(2), row.div_euclid(2)]).collect();
    places.sort_unstable();
    places.dedup();
    Cells::of(EMPTY, places, |[column, row]| {
        let mut wide = vec![BEYOND; (SIDE * SIDE) as usize].into_boxed_slice();
        for quarter in 0..4 {
            let (right, up) = (quarter % 2, quarter / 2);
            let Some(block) = heights.block([2 * column + right, 2 * row + up]) else { continue };
            let at = |column: i32, row: i32| block[(row * SIDE + column) as usize];
            for row in 0..SIDE / 2 {
                for column in 0..SIDE / 2 {
                    let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| at(2 * column + x, 2 * row + y));
                    let into = (row + up * SIDE / 2) * SIDE + column + right * SIDE / 2;
                    let is_beyond = four.iter().all(|height| *height == BEYOND);
                    wide[into as usize] = if is_beyond { BEYOND } else { mean(four.map(|height| (1.0, height))) };
                }
            }
        }
        wide
    })
}

/// Returns the mean of those heights that are there, by their weights.
fn mean<const N: usize>(heights: [(f32, f32); N]) -> f32 {
    let (mut weights, mut sum) = (0.0, 0.0);
    for (weight, height) in heights {
        if height.is_finite() {
            weights += weight;
            sum += weight * height;
        }
    }
    if weights > 0.0 { sum / weights } else { EMPTY }
}

/// Returns `known` with heights for the other cells between those of cells of twice the width.
fn narrowed(known: &Cells<f32>, wide: &Cells<f32>) -> Cells<f32> {
    known.map(EMPTY, 0, |window| {
        let [column, row] = window.place.map(|place| place * SIDE);
        window.each(|x, y| match window.at(x, y) {
            EMPTY => {
                let [near, other] = [column + x, row + y].map(nearest_wide);
                let at = |x: usize, y: usize| wide.at([[near, other][0][x], [near, other][1][y]]);
                mean([(9.0, at(0, 0)), (3.0, at(1, 0)), (3.0, at(0, 1)), (1.0, at(1, 1))])
            }
            height => height,
        })
    })
}

/// Returns the number of the cell of twice the width that a cell lies in, and of the other one that is near.
fn nearest_wide(cell: i32) -> [i32; 2] {
    let wide = cell.div_euclid(2);
    [wide, if cell.rem_euclid(2) == 0 { wide - 1 } else { wide + 1 }]
}

/// Returns `heights` with each that is not `known` moved to the mean of its neighbours, a few times.
fn smoothed(known: &Cells<f32>, mut heights: Cells<f32>) -> Cells<f32> {
    for _ in 0..SWEEPS {
        let moved = |window: &Window<f32>| {
            let fixed = known.block(window.place).unwrap_or_default();
            window.each(|x, y| match fixed[(y * SIDE + x) as usize] {
                EMPTY => {
                    let around = [(-1, 0), (1, 0), (0, -1), (0, 1)];
                    match mean(around.map(|(right, up)| (1.0, window.at(x + right, y + up)))) {
                        EMPTY => window.at(x, y),
                        mean => mean,
                    }
                }
                height => height,
            })
        };
        heights = heights.map(EMPTY, 1, moved);
    }
    heights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::cell_of;

    #[test]
    fn a_gap_in_a_plane_is_filled_with_the_plane() {
        let plane = |[column, row]: Place| 0.5 * column as f32 - 0.25 * row as f32;
        let is_gap = |[column, row]: Place| (20..60).contains(&column) && (-30..25).contains(&row);
        let places = (-2..3).flat_map(|row| (-2..3).map(move |column| [column, row])).collect();
        let heights = Cells::of(EMPTY, places, |place| {
            let height = |number| Some(cell_of(place, number)).filter(|cell| !is_gap(*cell)).map_or(EMPTY, plane);
            (0..4096).map(height).collect()
        });
        let filled = filled(&heights);
        for &place in filled.places() {
            for (number, height) in filled.block(place).unwrap().iter().enumerate() {
                let off = (height - plane(cell_of(place, number))).abs();
                assert!(
                    off < if is_gap(cell_of(place, number)) { 1.5 } else { 1e-6 },
                    "{:?}: {off}",
                    cell_of(place, number)
                );
            }
        }
    }

    #[test]
    fn one_height_fills_all() {
        let mut heights = Cells::new(EMPTY);
        heights.block_mut([-1, -1])[17] = 3.0;
        heights.block_mut([0, 5])[17] = EMPTY;
        let filled = filled(&heights.map(EMPTY, 0, |window| window.values.clone().into()));
        assert!(filled.places().iter().all(|place| filled.block(*place).unwrap().iter().all(|height| *height == 3.0)));
    }
}
