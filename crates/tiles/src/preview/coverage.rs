//! Which pixel centres a triangle covers.

use crate::preview::sliver::{SLIVER_ROWS, Sliver};

/// Up to this many columns are tried one by one, which takes no division.
const FEW_COLUMNS: i64 = 8;

/// Where pixel centres lie, in subdivisions.
#[derive(Clone, Copy)]
pub(super) struct Centers {
    /// The column and the row of the first, an odd number.
    pub(super) first: i64,
    /// From one to the next, an even number.
    pub(super) pitch: i64,
}

impl Centers {
    /// Returns the middle of a column or row in subdivisions, an odd number.
    fn middle(self, index: i64) -> i64 {
        index * self.pitch + self.first
    }
}

/// A triangle that may cover pixel centres.
pub(super) struct Coverage {
    /// The corners in subdivisions, counterclockwise where y goes down.
    pub(super) places: [[i64; 2]; 3],
    pub(super) centers: Centers,
    /// The columns of centres within the triangle's box.
    pub(super) columns: [i64; 2],
    /// The rows of them.
    pub(super) rows: [i64; 2],
}

/// The function of an edge: twice the area between the edge and a point. Within the triangle's box it is below 2^63. Intermediate values
/// may wrap.
#[derive(Clone, Copy)]
struct Edge {
    /// How far the function is, at the first centre of the box, above the least value that the triangle covers.
    spare: i64,
    /// What it grows by from column to column.
    column: i64,
    /// What it grows by from row to row.
    row: i64,
    /// The least value that the triangle covers.
    least: i64,
}

impl Coverage {
    /// Calls `hit` with the column, the row, and the areas opposite the corners for each centre in the triangle, row by row.
    #[inline(always)]
    pub(super) fn each(&self, mut hit: impl FnMut(i64, i64, [i64; 3])) {
        let edges = self.edges();
        let ([left, right], [top, bottom]) = (self.columns, self.rows);
        if right - left > FEW_COLUMNS || bottom - top >= SLIVER_ROWS {
            return self.each_of_many(edges, hit);
        }
        let mut start = edges.map(|edge| edge.spare);
        for row in top..bottom {
            let mut spare = start;
            for column in left..right {
                // A branch for each edge would often be foretold wrongly.
                if spare[0] | spare[1] | spare[2] >= 0 {
                    hit(column, row, weights(&edges, spare));
                }
                (0..3).for_each(|k| spare[k] = spare[k].wrapping_add(edges[k].column));
            }
            (0..3).for_each(|k| start[k] = start[k].wrapping_add(edges[k].row));
        }
    }

    /// Does the same for a triangle whose box has many centres.
    #[inline(never)]
    fn each_of_many(&self, edges: [Edge; 3], mut hit: impl FnMut(i64, i64, [i64; 3])) {
        let ([left, right], [top, bottom]) = (self.columns, self.rows);
        let sliver =
            (bottom - top >= SLIVER_ROWS).then(|| Sliver::new(self.places, self.centers.first, self.centers.pitch));
        for row in top..bottom {
            if sliver.as_ref().is_some_and(|sliver| sliver.misses(row)) {
                continue;
            }
            let start = edges.map(|edge| edge.spare.wrapping_add(edge.row.wrapping_mul(row - top)));
            let mut range = [0, right - left];
            (0..3).for_each(|k| narrow(&mut range, start[k], edges[k].column));
            for column in range[0]..range[1] {
                let spare = [0, 1, 2].map(|k| start[k].wrapping_add(edges[k].column.wrapping_mul(column)));
                hit(left + column, row, weights(&edges, spare));
            }
        }
    }

    /// Returns the edges opposite the corners.
    #[inline(always)]
    fn edges(&self) -> [Edge; 3] {
        let (centers, pitch) = (self.centers, self.centers.pitch);
        let point = [centers.middle(self.columns[0]), centers.middle(self.rows[0])];
        [0, 1, 2].map(|k| {
            let (p, q) = (self.places[(k + 1) % 3], self.places[(k + 2) % 3]);
            let (du, dv) = (q[0] - p[0], q[1] - p[1]);
            let value = du.wrapping_mul(point[1] - p[1]).wrapping_sub(dv.wrapping_mul(point[0] - p[0]));
            // A centre on an edge belongs to one of its two triangles: dv has another sign in each.
            let least = i64::from(dv <= 0);
            Edge { spare: value.wrapping_sub(least), column: -dv * pitch, row: du * pitch, least }
        })
    }
}

/// Returns the values of the functions that are this far above their least.
#[inline(always)]
fn weights(edges: &[Edge; 3], spare: [i64; 3]) -> [i64; 3] {
    [0, 1, 2].map(|k| spare[k].wrapping_add(edges[k].least))
}

/// Narrows `range` to the columns where `start + step * column` is not negative.
fn narrow(range: &mut [i64; 2], start: i64, step: i64) {
    if step > 0 && start < 0 {
        range[0] = range[0].max((step - 1 - start) / step);
    } else if step <= 0 && start < 0 {
        range[1] = range[0];
    } else if step < 0 {
        range[1] = range[1].min(start / -step + 1);
    }
}
