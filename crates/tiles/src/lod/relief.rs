//! How far the vertices of a tile stand out of the mesh around them. Where many stand out far, a coarser tile needs many vertices.

use bytemuck::{Pod, Zeroable};

/// The numbers of bits that are told apart; distances with more belong to the last.
const BITS: usize = 32;

/// The vertices of a tile by their vertical distance, in lattice steps, from the mean of their neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Relief {
    /// How many vertices have a distance of 0 bits, of 1 bit, of 2 bits, and so on.
    by_bits: [u32; BITS],
}

impl Relief {
    /// Returns the relief of a mesh whose vertices are at `positions`, in lattice integers.
    pub fn of(positions: &[[i32; 3]], triangles: &[[u32; 3]]) -> Relief {
        // The sum of the heights of a vertex's neighbours, one for each triangle and side, and their number.
        let mut around = vec![[0i64; 2]; positions.len()];
        for &[a, b, c] in triangles {
            let [at_a, at_b, at_c] = [a, b, c].map(|v| i64::from(positions[v as usize][2]));
            for (v, sum) in [(a, at_b + at_c), (b, at_c + at_a), (c, at_a + at_b)] {
                let [heights, count] = &mut around[v as usize];
                *heights += sum;
                *count += 2;
            }
        }
        let mut relief = Relief::default();
        for (position, [heights, count]) in positions.iter().zip(around) {
            let distance = (i64::from(position[2]) * count - heights).unsigned_abs() / count.max(1).unsigned_abs();
            relief.by_bits[((u64::BITS - distance.leading_zeros()) as usize).min(BITS - 1)] += 1;
        }
        relief
    }

    /// Adds the vertices of another tile.
    pub fn add(&mut self, other: &Relief) {
        self.by_bits.iter_mut().zip(other.by_bits).for_each(|(sum, other)| *sum = sum.saturating_add(other));
    }

    /// Returns the share of `own` if the `count` vertices of `all` that stand out furthest are chosen, with as many of each tile from the last
    /// ones that are equally far.
    pub fn share(own: &Relief, all: &Relief, count: u64) -> u64 {
        let (mut left, mut share) = (count, 0);
        for (&own, &all) in own.by_bits.iter().zip(&all.by_bits).rev() {
            let (own, all) = (u64::from(own), u64::from(all));
            if all > left {
                return share + own * left / all;
            }
            share += own;
            left -= all;
        }
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a square lattice of 9 by 9 vertices with these heights, and its triangles.
    fn lattice(height: impl Fn(i32, i32) -> i32) -> (Vec<[i32; 3]>, Vec<[u32; 3]>) {
        let positions = (0..81).map(|i| [i % 9, i / 9, height(i % 9, i / 9)]).collect();
        let cells = (0..64u32).map(|i| i / 8 * 9 + i % 8);
        (positions, cells.flat_map(|v| [[v, v + 1, v + 10], [v, v + 10, v + 9]]).collect())
    }

    #[test]
    fn a_plane_has_relief_on_its_border_alone_and_a_tree_where_it_stands() {
        let relief = |height: fn(i32, i32) -> i32| {
            let (positions, triangles) = lattice(height);
            Relief::of(&positions, &triangles).by_bits
        };
        assert_eq!(relief(|_, _| 7)[0], 81);
        assert!(relief(|x, y| 100 * x + 10 * y)[0] >= 49);
        let tree = relief(|x, y| if (x, y) == (4, 4) { 1 << 20 } else { 0 });
        assert_eq!((tree[21], tree[18], tree[0]), (1, 6, 74));
    }

    #[test]
    fn whoever_stands_out_furthest_gets_the_vertices() {
        let relief = |by_bits: &[(usize, u32)]| {
            let mut relief = Relief::default();
            by_bits.iter().for_each(|&(bits, count)| relief.by_bits[bits] = count);
            relief
        };
        let (wood, field) = (relief(&[(10, 80), (5, 20)]), relief(&[(5, 60), (0, 40)]));
        let mut all = wood;
        all.add(&field);
        assert_eq!([40, 80, 120, 200, 300].map(|count| Relief::share(&wood, &all, count)), [40, 80, 90, 100, 100]);
        assert_eq!([40, 80, 120, 200, 300].map(|count| Relief::share(&field, &all, count)), [0, 0, 30, 100, 100]);
    }
}
