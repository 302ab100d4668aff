//! A vertex and its neighbours: which of them it may be moved to, and how far the ground would be off then.

use super::topology::{Topology, next};

/// The share of an edge's length that weighs as much as a height.
const LENGTH_WEIGHT: f64 = 0.01;

/// A vertex with more neighbours stays until it has fewer.
const MOST: usize = 24;

/// Neighbours are at most so many lattice steps away in x and y: then areas are whole numbers below 2^53, exact as f64.
const REACH: f64 = (1 << 24) as f64;

/// The neighbours of a vertex, counterclockwise, twice round, relative to it.
pub(super) struct Ring {
    count: usize,
    /// The half-edges to them.
    edges: [u32; MOST],
    x: [f64; 2 * MOST],
    y: [f64; 2 * MOST],
    heights: [f64; 2 * MOST],
    /// Twice the area of the triangle of the vertex, a neighbour and the next.
    areas: [f64; 2 * MOST],
    /// Twice the area of the triangle of the vertex, the target and a neighbour.
    beside: [f64; 2 * MOST],
}

impl Default for Ring {
    fn default() -> Ring {
        let zeros = [0.0; 2 * MOST];
        Ring { count: 0, edges: [0; MOST], x: zeros, y: zeros, heights: zeros, areas: zeros, beside: zeros }
    }
}

impl Ring {
    /// Takes the neighbours of `v`; whether they are neither too many nor too far.
    #[inline(always)]
    pub(super) fn gather(&mut self, v: u32, topology: &Topology, positions: &[[i32; 3]]) -> bool {
        let middle = positions[v as usize].map(f64::from);
        self.count = 0;
        let mut far = 0.0f64;
        for edge in topology.around(v) {
            if self.count == MOST {
                return false;
            }
            let p = positions[topology.origin(next(edge)) as usize];
            let [x, y, z] = [0, 1, 2].map(|k| p[k] as f64 - middle[k]);
            let i = self.count;
            (self.edges[i], self.x[i], self.y[i], self.heights[i]) = (edge, x, y, z);
            far = far.max(x.abs()).max(y.abs());
            self.count += 1;
        }
        self.close();
        far <= REACH
    }

    /// Appends the second round.
    #[inline(always)]
    fn close(&mut self) {
        let count = self.count;
        for i in 0..count {
            (self.x[count + i], self.y[count + i], self.heights[count + i]) = (self.x[i], self.y[i], self.heights[i]);
        }
        for i in 0..count {
            let area = self.x[i] * self.y[i + 1] - self.x[i + 1] * self.y[i];
            (self.areas[i], self.areas[count + i]) = (area, area);
        }
    }

    /// The half-edge along which the vertex would go best, and what that costs, in steps of x and y; `steepness` is a step of z in
    /// those.
    #[inline(always)]
    pub(super) fn best(&mut self, steepness: f64) -> Option<(u32, f64)> {
        let (mut edge, mut least) = (None, f64::INFINITY);
        for to in 0..self.count {
            let length = (self.x[to] * self.x[to] + self.y[to] * self.y[to]) * (LENGTH_WEIGHT * LENGTH_WEIGHT);
            if length >= least || !self.is_fan(to) {
                continue;
            }
            let most = (least - length).sqrt() / steepness;
            if let Some(off) = self.off(to, most) {
                let height = off * steepness;
                (edge, least) = (Some(self.edges[to]), height * height + length);
            }
        }
        edge.map(|edge| (edge, least.sqrt()))
    }

    /// Whether all triangles that neighbour `to` makes with the edges round the vertex are counterclockwise.
    #[inline(always)]
    fn is_fan(&mut self, to: usize) -> bool {
        let (tx, ty) = (self.x[to], self.y[to]);
        for i in to + 1..to + self.count {
            self.beside[i] = tx * self.y[i] - self.x[i] * ty;
        }
        (to + 1..to + self.count - 1).all(|i| self.areas[i] + self.beside[i] - self.beside[i + 1] > 0.0)
    }

    /// The greatest vertical distance, in steps of z, between the triangles as they are and those that neighbour `to` makes;
    /// `None` if it is not below `most`. After [`Ring::is_fan`].
    #[inline(always)]
    fn off(&self, to: usize, most: f64) -> Option<f64> {
        let last = to + self.count - 1;
        // The vertex lies between the new edges to the neighbours `right` and `right + 1`.
        let right = (to + 1..last).take_while(|&i| self.beside[i] > 0.0).last().unwrap_or(to + 1);
        let mut off = self.off_in_middle(to, right);
        for k in to + 2..=right {
            for j in to + 1..k {
                off = off.max(self.off_at_crossing(to, k, j));
            }
        }
        for k in right + 1..last {
            for j in k + 1..=last {
                off = off.max(self.off_at_crossing(to, k, j));
            }
        }
        (off < most).then_some(off)
    }

    /// Between the vertex and the new triangle over it, which ends at the neighbours `right` and the next.
    #[inline(always)]
    fn off_in_middle(&self, to: usize, right: usize) -> f64 {
        let (of_right, of_left) = (self.beside[right], self.beside[right + 1]);
        let weights = [self.areas[right], -of_left, of_right];
        let heights = [self.heights[to], self.heights[right], self.heights[right + 1]];
        let sum: f64 = weights.iter().zip(heights).map(|(w, h)| w * h).sum();
        (sum / (weights[0] + weights[1] + weights[2])).abs()
    }

    /// Where the new edge from `to` to neighbour `k` crosses the old one from the vertex to `j`.
    #[inline(always)]
    fn off_at_crossing(&self, to: usize, k: usize, j: usize) -> f64 {
        // Areas of `to` and `k` beside the old edge, of the vertex and `j` beside the new one.
        let of_to = self.beside[j];
        let of_k = self.x[k] * self.y[j] - self.x[j] * self.y[k];
        let share = of_to / (of_to - of_k);
        let of_middle = self.beside[k];
        let of_j = of_middle - self.beside[j] + of_k;
        let along_old = of_middle / (of_middle - of_j);
        let (old, new) = (self.heights[j] * along_old, self.heights[to] + (self.heights[k] - self.heights[to]) * share);
        (old - new).abs()
    }
}
