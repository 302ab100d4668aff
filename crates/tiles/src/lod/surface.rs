//! What the vertices of a simplified terrain stand for: the surface around them rather than single returns of the scanner.
//!
//! The returns of a forest alternate between crowns and ground. A coarse triangle between three of them shows a wall that nobody can
//! see, whichever three it takes. So a vertex inside a simplified terrain has the height of the surface that is seen around it. Its x
//! and y stay those of a site, because the triangulation needs that. It also keeps the site's normal and colour: means of them would
//! be smoother, and so brighter, than the terrain looks from afar.

/// This many triangles are looked at together for corners that are wanted.
const AT_ONCE: usize = 256;

/// Returns the heights of one of every `every` vertices of `triangles` between `positions`: the mean of a vertex's own height, twice, and
/// the heights at the other ends of its edges. The vertices that are `fixed` keep theirs.
pub(crate) fn smoothed(positions: &[[i32; 3]], triangles: &[[u32; 3]], fixed: &[bool], every: usize) -> Vec<i32> {
    // Every edge inside counts in both of its triangles, so a vertex that counts twice itself must count four times here.
    let own = |p: &[i32; 3]| Mean { sum: 4 * p[2] as i64, count: 4 };
    let mut means: Vec<Mean> = positions.iter().step_by(every).map(own).collect();
    let height = |v: u32| positions[v as usize][2] as i64;
    // The number of a triangle, times four, and of its corner.
    let mut wanted = [0u32; 3 * AT_ONCE];
    for triangles in triangles.chunks(AT_ONCE) {
        // A branch for each corner would often be foretold wrongly.
        let mut count = 0;
        for (at, corners) in (0..).step_by(4).zip(triangles) {
            for (corner, &v) in (at..).zip(corners) {
                wanted[count] = corner;
                count += usize::from((v as usize).is_multiple_of(every));
            }
        }
        for &corner in &wanted[..count] {
            let [a, b, c] = triangles[corner as usize / 4];
            let [v, to, from] = [[a, b, c], [b, c, a], [c, a, b]][corner as usize % 4];
            means[v as usize / every].add(height(to) + height(from), 2);
        }
    }
    let vertices = positions.iter().zip(fixed).step_by(every);
    vertices.zip(means).map(|((p, fixed), mean)| if *fixed { p[2] } else { mean.rounded() }).collect()
}

/// Returns the height of the surface that is seen in each of so many `cells`: the mean height of those of `positions` in it that are not
/// below the mean of all. Over a crown that is its top, and over bare ground the ground. It is 0 where the cell has none. The cell of
/// each position is in `cell_of`.
pub(crate) fn seen_heights(positions: &[[i32; 3]], cell_of: &[u32], cells: usize) -> Vec<i32> {
    let mut all = vec![Mean::default(); cells];
    positions.iter().zip(cell_of).for_each(|(p, &cell)| all[cell as usize].add(p[2].into(), 1));
    let means: Vec<i32> = all.iter().map(|mean| mean.rounded()).collect();
    let mut upper = vec![Mean::default(); cells];
    for (p, &cell) in positions.iter().zip(cell_of) {
        // Without a branch, which would be foretold wrongly for half of them.
        let count = i64::from(p[2] >= means[cell as usize]);
        upper[cell as usize].add(count * i64::from(p[2]), count);
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

    #[test]
    fn a_crown_is_seen_from_above_and_ground_stays_ground() {
        let crown = [0, 100, 0, 104, 1, 96].map(|z| ([0, 0, z], 1));
        let ground = [7, 7, 8, 7].map(|z| ([0, 0, z], 0));
        let (positions, cells): (Vec<_>, Vec<_>) = crown.into_iter().chain(ground).unzip();
        assert_eq!(seen_heights(&positions, &cells, 3), [7, 100, 0]);
        // Seven and a half is rounded to eight.
        assert_eq!(seen_heights(&[[0, 0, 7], [1, 0, 8]], &[0, 0], 1), [8]);
        assert_eq!(seen_heights(&[[0, 0, -3], [1, 0, -3]], &[0, 0], 1), [-3]);
    }

    #[test]
    fn a_spike_sinks_and_a_fixed_vertex_stays() {
        let corners = [[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]];
        let wheel: Vec<[u32; 3]> = (0..4).map(|i| [4, i, (i + 1) % 4]).collect();
        let positions: Vec<_> = corners.into_iter().chain([[4, 4, 60]]).collect();
        let heights = |fixed: [bool; 5], every| {
            let mut heights: Vec<i32> = positions.iter().map(|p| p[2]).collect();
            let smoothed = smoothed(&positions, &wheel, &fixed, every);
            heights.iter_mut().step_by(every).zip(smoothed).for_each(|(height, smooth)| *height = smooth);
            heights
        };
        let hub = [true, true, true, true, false];
        assert_eq!([heights(hub, 1), heights(hub, 2), heights(hub, 4)], [[0, 0, 0, 0, 20]; 3]);
        assert_eq!([heights(hub, 3)[4], heights([true; 5], 1)[4]], [60; 2]);
    }
}
