//! What the vertices of a simplified terrain stand for: the surface around them rather than single returns of the scanner.
//!
//! The returns of a forest alternate between crowns and ground. A coarse triangle between three of them shows a wall that nobody can
//! see, whichever three it takes. So a vertex inside a simplified terrain has the height of the surface that is seen around it. Its x
//! and y stay those of a site, because the triangulation needs that. It also keeps the site's normal and colour: means of them would
//! be smoother, and so brighter, than the terrain looks from afar.

use crate::geometry::square_grid::SquareGrid;
use crate::output::tile::Tile;

/// Returns the positions of `tile` where each vertex has the mean of its own height, twice, and the heights at the other ends of its
/// edges. The vertices that are `fixed` keep theirs.
pub(crate) fn smoothed(tile: &Tile, fixed: &[bool]) -> Vec<[i32; 3]> {
    // Every edge inside counts in both of its triangles, so a vertex that counts twice itself must count four times here.
    let mut means: Vec<Mean> = tile.positions.iter().map(|p| Mean { sum: 4 * p[2] as i64, count: 4 }).collect();
    for &[a, b, c] in &tile.triangles {
        let [at_a, at_b, at_c] = [a, b, c].map(|v| tile.positions[v as usize][2] as i64);
        for (v, others) in [(a, at_b + at_c), (b, at_c + at_a), (c, at_a + at_b)] {
            means[v as usize].add(others, 2);
        }
    }
    let height = |v: usize, own: i32| if fixed[v] { own } else { means[v].rounded() };
    tile.positions.iter().enumerate().map(|(v, &[x, y, z])| [x, y, height(v, z)]).collect()
}

/// Returns for each cell of `grid` the height of the surface that is seen there: the mean height of those of `positions` in it that
/// are not below the mean of all. Over a crown that is its top, and over bare ground the ground. It is 0 where the cell has none.
pub(crate) fn seen_heights(positions: &[[i32; 3]], grid: &SquareGrid) -> Vec<i32> {
    let mut all = vec![Mean::default(); grid.cells()];
    positions.iter().for_each(|p| all[grid.cell(p[0], p[1])].add(p[2].into(), 1));
    let means: Vec<i32> = all.iter().map(|mean| mean.rounded()).collect();
    let mut upper = vec![Mean::default(); grid.cells()];
    for p in positions {
        let cell = grid.cell(p[0], p[1]);
        if p[2] >= means[cell] {
            upper[cell].add(p[2].into(), 1);
        }
    }
    // Rounding up may leave nothing above the mean.
    upper.iter().zip(means).map(|(upper, mean)| if upper.count > 0 { upper.rounded() } else { mean }).collect()
}

/// A mean of heights.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: i64,
    count: i64,
}

impl Mean {
    /// Adds `count` heights.
    fn add(&mut self, heights: i64, count: i64) {
        *self = Mean { sum: self.sum + heights, count: self.count + count };
    }

    /// Returns the nearest whole number, of two the greater, or 0 without heights. It lies within the range of the heights.
    fn rounded(self) -> i32 {
        let count = self.count.max(1);
        (2 * self.sum + count).div_euclid(2 * count) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Bounds;

    #[test]
    fn a_crown_is_seen_from_above_and_ground_stays_ground() {
        let crown = [0, 100, 0, 104, 1, 96].into_iter().zip(0..).map(|(z, x)| [x, 0, z]);
        let ground = [7, 7, 8, 7].into_iter().zip(10..).map(|(z, x)| [x, 0, z]);
        let positions: Vec<[i32; 3]> = crown.chain(ground).collect();
        let grid = SquareGrid::new(Bounds { min: [0, 0], max: [19, 0] }, 10.0, 100.0);
        assert_eq!(seen_heights(&positions, &grid), [100, 7]);
        // Seven and a half is rounded to eight.
        assert_eq!(seen_heights(&[[0, 0, 7], [1, 0, 8]], &grid), [8, 0]);
        assert_eq!(seen_heights(&[[0, 0, -3], [1, 0, -3]], &grid), [-3, 0]);
    }

    #[test]
    fn a_spike_sinks_and_a_fixed_vertex_stays() {
        let corners = [[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]];
        let wheel: Vec<[u32; 3]> = (0..4).map(|i| [4, i, (i + 1) % 4]).collect();
        let positions = corners.into_iter().chain([[4, 4, 60]]).collect();
        let tile = Tile { positions, triangles: wheel, ..Tile::default() };
        let heights = |fixed: [bool; 5]| smoothed(&tile, &fixed).iter().map(|p| p[2]).collect::<Vec<_>>();
        assert_eq!(heights([true, true, true, true, false]), [0, 0, 0, 0, 20]);
        assert_eq!(heights([true; 5])[4], 60);
    }
}
