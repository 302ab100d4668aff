//! The vertices along a side of a coarser tile.

use crate::bound::steps;
use crate::mesh::Node;
use crate::tile::Tile;

/// Selects vertices of a side, given in order with their steps along it, so that all are within the bound of the zoom of a tile of the
/// lines between them (Ramer 1972; Douglas and Peucker 1973, with vertical distances). The first and the last are selected. The result depends on the
/// side alone, so it is the same in both tiles beside it.
pub(crate) fn selected_along(side: &[(u16, Node)], tile: Tile, outside: i32) -> Vec<(u16, Node)> {
    let line: Vec<[i128; 2]> =
        side.iter().map(|(along, node)| [(*along).into(), node.height(outside).into()]).collect();
    let mut is_selected = vec![false; side.len()];
    let mut ranges = Vec::new();
    if let Some(last) = side.len().checked_sub(1) {
        is_selected[0] = true;
        is_selected[last] = true;
        ranges.push((0, last));
    }
    while let Some((first, last)) = ranges.pop() {
        if let Some(worst) = worst_between(&line, [first, last], steps(tile.scheme, tile.zoom)) {
            is_selected[worst] = true;
            ranges.extend([(first, worst), (worst, last)]);
        }
    }
    side.iter().zip(is_selected).filter(|(_, selected)| *selected).map(|(vertex, _)| *vertex).collect()
}

/// Returns the vertex between two that is farthest from the line between them, if it is farther than the bound.
fn worst_between(line: &[[i128; 2]], [first, last]: [usize; 2], bound: u64) -> Option<usize> {
    let ([t0, h0], [t1, h1]) = (line[first], line[last]);
    let distance = |i: usize| {
        let [t, h] = line[i];
        ((h - h0) * (t1 - t0) - (h1 - h0) * (t - t0)).abs()
    };
    let worst = (first + 1..last).max_by_key(|&i| (distance(i), std::cmp::Reverse(i)))?;
    (distance(worst) > i128::from(bound) * (t1 - t0)).then_some(worst)
}
