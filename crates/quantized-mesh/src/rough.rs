//! Vertices of surfaces that no few triangles come close to, such as woods.

use crate::mesh::{LAST, Node, OUTSIDE, order};

/// The columns and rows of cells in a tile.
const CELLS: usize = 128;

/// The steps along a cell: a power of two, so that the vertices of a cell follow one another.
const SIDE: usize = (LAST as usize).div_ceil(CELLS);

/// The vertices of a tile by cells, which are in the same order.
pub(crate) struct Cells<'a> {
    nodes: &'a [Node],
    /// Where each cell begins.
    starts: Vec<u32>,
}

impl<'a> Cells<'a> {
    /// Divides vertices, which are in order.
    pub(crate) fn new(nodes: &'a [Node]) -> Cells<'a> {
        let mut starts = vec![0u32; CELLS * CELLS + 1];
        nodes.iter().for_each(|node| starts[cell_of(node) + 1] += 1);
        (0..CELLS * CELLS).for_each(|cell| starts[cell + 1] += starts[cell]);
        Cells { nodes, starts }
    }

    /// Returns the vertices of the terrain in a cell.
    fn of(&self, cell: usize) -> impl Iterator<Item = &Node> {
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        self.nodes[range].iter().filter(|node| node.h != OUTSIDE)
    }

    /// Returns how many vertices lie more than `bound` above or below a plane through their cell that follows the cells around it.
    pub(crate) fn off_plane(&self, bound: u64) -> usize {
        let means: Vec<Option<f64>> = (0..CELLS * CELLS).map(|cell| mean(self.of(cell).map(|node| node.h))).collect();
        let slope = |low: Option<f64>, high: Option<f64>| match (low, high) {
            (Some(low), Some(high)) => (high - low) / (2.0 * SIDE as f64),
            _ => 0.0,
        };
        let mut count = 0;
        for row in 0..CELLS {
            for column in 0..CELLS {
                let cell = order([column as u16, row as u16]) as usize;
                let Some(own) = means[cell] else { continue };
                let at = |column: usize, row: usize| {
                    let is_inside = column < CELLS && row < CELLS;
                    is_inside.then(|| means[order([column as u16, row as u16]) as usize]).flatten()
                };
                let east = slope(at(column.wrapping_sub(1), row), at(column + 1, row));
                let north = slope(at(column, row.wrapping_sub(1)), at(column, row + 1));
                let middle = [column, row].map(|number| (number * SIDE + SIDE / 2) as f64);
                let is_off = |node: &&Node| {
                    let plane = own + east * (f64::from(node.u) - middle[0]) + north * (f64::from(node.v) - middle[1]);
                    (f64::from(node.h) - plane).abs() > bound as f64
                };
                count += self.of(cell).filter(is_off).count();
            }
        }
        count
    }

    /// Returns of each cell the vertex with the median height.
    pub(crate) fn medians(&self) -> Vec<Node> {
        let mut medians = Vec::new();
        let mut of_cell: Vec<Node> = Vec::new();
        for cell in 0..CELLS * CELLS {
            of_cell.clear();
            of_cell.extend(self.of(cell));
            if !of_cell.is_empty() {
                let middle = of_cell.len() / 2;
                medians.push(*of_cell.select_nth_unstable_by_key(middle, |node| (node.h, node.u, node.v)).1);
            }
        }
        medians
    }
}

/// Returns the number of the cell of a vertex on the Z-order curve.
fn cell_of(node: &Node) -> usize {
    node.order() as usize / (SIDE * SIDE)
}

fn mean(heights: impl Iterator<Item = i32>) -> Option<f64> {
    let (sum, count) = heights.fold((0i64, 0i64), |(sum, count), h| (sum + i64::from(h), count + 1));
    (count > 0).then(|| sum as f64 / count as f64)
}
