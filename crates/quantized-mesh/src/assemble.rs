//! Joining the pieces of a tile.

use crate::cut::Piece;
use crate::fill::{fill, planar, within_border};
use crate::groups::Groups;
use crate::mesh::{LAST, Node, OUTSIDE, TileMesh, corner_place, double_area, each_once, in_order};
use crate::unfold::unfolded;
use std::cmp::Ordering;

/// Twice the area of a tile in square steps.
const WHOLE: i64 = 2 * (LAST as i64) * (LAST as i64);

/// Joins what the terrain has in a tile, and fills the rest of it. Of vertices that share a place the highest stays. `None` if the terrain does not
/// reach the tile.
pub fn assemble(pieces: Vec<Piece>) -> Option<TileMesh> {
    let mut corners = [None; 4];
    for piece in &pieces {
        corners.iter_mut().zip(piece.corners).for_each(|(known, more)| *known = (*known).max(more));
    }
    let (nodes, numbers) = joined_nodes(&pieces, corners);
    let all = joined_triangles(pieces, numbers);
    let area_of = |triangle: &[u32; 3]| double_area(triangle.map(|v| nodes[v as usize]));
    // Triangles that rounding has turned over have negative areas, so that the sum is that of the terrain.
    let areas = all.iter().map(area_of);
    let (area, is_upright) = areas.fold((0, true), |(sum, all), area| (sum + area, all && area > 0));
    let (mut kept, is_unfolded) = if is_upright { (all, true) } else { unfolded(&nodes, all) };
    if kept.is_empty() {
        // The terrain only touches the tile: those beside it have these vertices too.
        if nodes.iter().all(|node| !node.is_on_border() || node.h == OUTSIDE) {
            return None;
        }
        let triangles = within_border(&nodes);
        return Some(without_unused(nodes, triangles));
    }
    if !is_unfolded || !has_all_on_border(&nodes, &kept) {
        kept = planar(&nodes, kept);
    } else if area != WHOLE {
        let around = ends(nodes.len(), &kept);
        let inner: Vec<[u32; 2]> = around.iter().copied().filter(|edge| !is_on_side(&nodes, *edge)).collect();
        kept.extend(fill(&nodes, &inner, &around));
    }
    Some(without_unused(nodes, kept))
}

/// Returns the vertices of all pieces in order, each place once, and the four corners. Returns the number of each vertex of the pieces among
/// them too.
fn joined_nodes(pieces: &[Piece], corners: [Option<i32>; 4]) -> (Vec<Node>, Vec<u32>) {
    let of_pieces = pieces.iter().flat_map(|piece| piece.nodes.iter().copied());
    let of_corners = (0..4).map(|corner| {
        let [u, v] = corner_place(corner);
        Node { u, v, h: OUTSIDE }
    });
    let mut all: Vec<Node> = Vec::with_capacity(pieces.iter().map(|piece| piece.nodes.len()).sum::<usize>() + 4);
    all.extend(of_pieces.chain(of_corners));
    let (mut nodes, numbers) = each_once(&all);
    for node in &mut nodes {
        // A crossing may round to a corner that the terrain does not cover: the tiles around it would not know that.
        if let Some(corner) = node.corner() {
            node.h = corners[corner].unwrap_or(OUTSIDE);
        }
    }
    (nodes, numbers)
}

/// Returns the triangles of all pieces, whose vertices have these numbers one after the other. Pieces are dropped on the way.
fn joined_triangles(pieces: Vec<Piece>, numbers: Vec<u32>) -> Vec<[u32; 3]> {
    let mut all = Vec::with_capacity(pieces.iter().map(|piece| piece.triangles.len()).sum());
    let mut first = 0;
    for piece in pieces {
        all.extend(piece.triangles.iter().map(|triangle| triangle.map(|v| numbers[first + v as usize])));
        first += piece.nodes.len();
    }
    all
}

/// Tells whether triangles have all vertices on the border of the tile but its corners.
fn has_all_on_border(nodes: &[Node], triangles: &[[u32; 3]]) -> bool {
    let mut is_used: Vec<bool> = nodes.iter().map(|node| !node.is_on_border() || node.corner().is_some()).collect();
    triangles.iter().flatten().for_each(|&v| is_used[v as usize] = true);
    is_used.into_iter().all(|used| used)
}

/// Returns the edges that only one of the triangles has, or more on one side than on the other, in order and with the triangles on their left.
fn ends(vertices: usize, triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(|[from, to]| from != to);
    // By the lesser vertex: the other one, and whether the edge begins there.
    let of_least = Groups::new(vertices, edges.map(|[from, to]| (from.min(to), [from.max(to), u32::from(from > to)])));
    let mut ends = Vec::new();
    for (least, group) in of_least.all() {
        for same in group.chunk_by(|a, b| a[0] == b[0]) {
            let back = same.iter().filter(|[_, is_back]| *is_back == 1).count();
            match (same.len() - back).cmp(&back) {
                Ordering::Greater => ends.push([least, same[0][0]]),
                Ordering::Less => ends.push([same[0][0], least]),
                Ordering::Equal => {}
            }
        }
    }
    ends.sort_unstable();
    ends
}

/// Tells whether an edge lies on a side of the tile.
fn is_on_side(nodes: &[Node], edge: [u32; 2]) -> bool {
    let [a, b] = edge.map(|v| nodes[v as usize]);
    let same = |a: u16, b: u16| a == b && (a == 0 || a == LAST);
    same(a.u, b.u) || same(a.v, b.v)
}

/// Returns the mesh of these triangles, without the vertices that none of them has.
pub(crate) fn without_unused(nodes: Vec<Node>, mut triangles: Vec<[u32; 3]>) -> TileMesh {
    let mut is_used = vec![false; nodes.len()];
    triangles.iter().flatten().for_each(|&v| is_used[v as usize] = true);
    if is_used.iter().all(|used| *used) {
        let triangles = in_order(nodes.len(), triangles);
        return TileMesh { nodes, triangles };
    }
    let mut count = 0;
    let numbers: Vec<u32> = is_used
        .iter()
        .map(|used| {
            count += u32::from(*used);
            count.saturating_sub(1)
        })
        .collect();
    let nodes: Vec<Node> = nodes.into_iter().zip(&is_used).filter(|(_, used)| **used).map(|(node, _)| node).collect();
    triangles.iter_mut().flatten().for_each(|v| *v = numbers[*v as usize]);
    let triangles = in_order(nodes.len(), triangles);
    TileMesh { nodes, triangles }
}
