//! Vertices of surfaces that no few triangles come close to, such as woods.

use crate::mesh::{LAST, Node};

/// The columns and rows of cells in a tile.
const CELLS: usize = 128;

/// The steps along a cell.
const SIDE: usize = (LAST as usize).div_ceil(CELLS);

/// The vertices of a tile by cells.
pub(crate) struct Cells<'a> {
    nodes: &'a [Node],
    /// The numbers of the vertices, cell by cell, and where each cell begins among them.
    order: Vec<u32>,
    starts: Vec<u32>,
}

impl<'a> Cells<'a> {
    pub(crate) fn new(nodes: &'a [Node]) -> Cells<'a> {
        let mut starts = vec![0u32; CELLS * CELLS + 1];
        nodes.iter().for_each(|node| starts[cell_of(node) + 1] += 1);
        (0..CELLS * CELLS).for_each(|cell| starts[cell + 1] += starts[cell]);
        let (mut next, mut order) = (starts.clone(), vec![0; nodes.len()]);
        for (number, node) in (0..).zip(nodes) {
            let place = &mut next[cell_of(node)];
            order[*place as usize] = number;
            *place += 1;
        }
        Cells { nodes, order, starts }
    }

    fn of(&self, cell: usize) -> impl Iterator<Item = &Node> {
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        self.order[range].iter().map(|&number| &self.nodes[number as usize])
    }

    /// Returns how many vertices lie more than `bound` above or below a plane through their cell that follows the cells around it.
    pub(crate) fn off_plane(&self, bound: u64) -> usize {
        let means: Vec<Option<f64>> = (0..CELLS * CELLS).map(|cell| mean(self.of(cell).map(|node| node.h))).collect();
        let slope = |low: Option<f64>, high: Option<f64>| match (low, high) {
            (Some(low), Some(high)) => (high - low) / (2.0 * SIDE as f64),
            _ => 0.0,
        };
        let mut count = 0;
        for (cell, own) in means.iter().enumerate() {
            let Some(own) = own else { continue };
            let (column, row) = (cell % CELLS, cell / CELLS);
            let beside = |is_inside: bool, cell: usize| is_inside.then(|| means[cell]).flatten();
            let east = slope(beside(column > 0, cell.wrapping_sub(1)), beside(column + 1 < CELLS, cell + 1));
            let north = slope(beside(row > 0, cell.wrapping_sub(CELLS)), beside(row + 1 < CELLS, cell + CELLS));
            let middle = [column, row].map(|number| (number * SIDE + SIDE / 2) as f64);
            let is_off = |node: &&Node| {
                let plane = own + east * (f64::from(node.u) - middle[0]) + north * (f64::from(node.v) - middle[1]);
                (f64::from(node.h) - plane).abs() > bound as f64
            };
            count += self.of(cell).filter(is_off).count();
        }
        count
    }

    /// Returns of each cell the vertex with the median height.
    pub(crate) fn medians(&self) -> Vec<Node> {
        let mut medians = Vec::new();
        let mut sorted: Vec<Node> = Vec::new();
        for cell in 0..CELLS * CELLS {
            sorted.clear();
            sorted.extend(self.of(cell));
            sorted.sort_unstable_by_key(|node| (node.h, node.u, node.v));
            medians.extend(sorted.get(sorted.len() / 2));
        }
        medians
    }
}

fn cell_of(node: &Node) -> usize {
    let [column, row] = [node.u, node.v].map(|along| usize::from(along) / SIDE);
    row.min(CELLS - 1) * CELLS + column.min(CELLS - 1)
}

fn mean(heights: impl Iterator<Item = i32>) -> Option<f64> {
    let (sum, count) = heights.fold((0i64, 0i64), |(sum, count), h| (sum + i64::from(h), count + 1));
    (count > 0).then(|| sum as f64 / count as f64)
}
