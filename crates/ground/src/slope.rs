//! The slope of a surface.

use crate::cells::Cells;
use crate::morphology::EMPTY;

/// Returns the slope of a surface in each cell: height by length. It takes central differences, and at the border one-sided ones.
pub(crate) fn slopes(surface: &Cells<f32>, width: f32) -> Cells<f32> {
    surface.map(0.0, 1, |window| {
        window.each(|column, row| {
            let here = window.at(column, row);
            let along = |[right, up]: [i32; 2]| match (
                window.at(column + right, row + up),
                window.at(column - right, row - up),
            ) {
                (EMPTY, EMPTY) => 0.0,
                (EMPTY, before) => (here - before) / width,
                (after, EMPTY) => (after - here) / width,
                (after, before) => (after - before) / (2.0 * width),
            };
            let (x, y) = (along([1, 0]), along([0, 1]));
            if here == EMPTY { 0.0 } else { (x * x + y * y).sqrt() }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::{SIDE, cell_of};

    #[test]
    fn a_plane_has_one_slope_up_to_its_border() {
        let height = |[column, row]: [i32; 2]| 0.5 * (3.0 * column as f32 + 4.0 * row as f32);
        let plane = Cells::of(EMPTY, vec![[0, 0], [1, 0]], |place| {
            (0..(SIDE * SIDE) as usize).map(|number| height(cell_of(place, number))).collect()
        });
        let slopes = slopes(&plane, 2.0);
        assert!(slopes.values().flatten().all(|slope| *slope == 1.25));
    }
}
