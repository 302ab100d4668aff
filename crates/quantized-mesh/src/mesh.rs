//! The mesh of a tile.

use bytemuck::{Pod, Zeroable};

/// A vertex of a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct Node {
    /// Steps from the west border, up to [`SPAN`](crate::SPAN).
    pub u: u16,
    /// Steps from the south border, up to [`SPAN`](crate::SPAN).
    pub v: u16,
    /// Its height in steps, or [`OUTSIDE`].
    pub h: i32,
}

/// The height of a vertex beside the terrain: that of the surroundings, which all tiles of a zoom share.
pub const OUTSIDE: i32 = i32::MIN;

/// The greatest `u` and `v`.
pub(crate) const LAST: u16 = 32_767;

impl Node {
    /// Returns the height, which is `outside` beside the terrain.
    pub fn height(self, outside: i32) -> i32 {
        if self.h == OUTSIDE { outside } else { self.h }
    }

    /// Tells whether it lies on the border of its tile.
    pub(crate) fn is_on_border(self) -> bool {
        [self.u, self.v].iter().any(|&along| along == 0 || along == LAST)
    }

    /// Returns the number of the corner of the tile that it lies on: 1 more in the east, 2 more in the north.
    pub(crate) fn corner(self) -> Option<usize> {
        let end = |along: u16| match along {
            0 => Some(0),
            LAST => Some(1),
            _ => None,
        };
        Some(end(self.u)? + 2 * end(self.v)?)
    }

    /// Returns its place on the Z-order curve.
    pub(crate) fn order(self) -> u32 {
        order([self.u, self.v])
    }
}

/// Returns the place of a column and a row on the Z-order curve.
pub(crate) fn order([column, row]: [u16; 2]) -> u32 {
    spread(column) | spread(row) << 1
}

/// Returns the bits of a number, with a zero bit after each.
fn spread(number: u16) -> u32 {
    let mut bits = u32::from(number);
    for (shift, mask) in [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

/// Returns the corner of a tile with this number.
pub(crate) fn corner_place(corner: usize) -> [u16; 2] {
    [if corner & 1 == 0 { 0 } else { LAST }, if corner & 2 == 0 { 0 } else { LAST }]
}

/// The mesh of a tile. It covers all of the tile. Its vertices are in the order of a Z-order curve, each place once; its triangles are in ascending
/// order, each with its least vertex first, counterclockwise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TileMesh {
    /// The vertices.
    pub nodes: Vec<Node>,
    /// The numbers of their vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl TileMesh {
    /// Returns the mesh of a tile that lies beside the terrain.
    pub fn surroundings() -> TileMesh {
        let corner = |corner: usize| {
            let [u, v] = corner_place(corner);
            Node { u, v, h: OUTSIDE }
        };
        TileMesh { nodes: (0..4).map(corner).collect(), triangles: vec![[0, 1, 3], [0, 3, 2]] }
    }
}

/// Returns twice the area of a triangle in square steps, negative if it is clockwise.
pub(crate) fn double_area([a, b, c]: [Node; 3]) -> i64 {
    let from_a = |p: Node| [i64::from(p.u) - i64::from(a.u), i64::from(p.v) - i64::from(a.v)];
    let ([bu, bv], [cu, cv]) = (from_a(b), from_a(c));
    bu * cv - bv * cu
}

/// Returns a triangle from its least vertex on.
pub(crate) fn least_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    match () {
        () if a < b && a < c => [a, b, c],
        () if b < c => [b, c, a],
        () => [c, a, b],
    }
}

/// Returns the places of vertices in order, each once and with its highest vertex, and the number of the place of each vertex.
pub(crate) fn each_once(all: &[Node]) -> (Vec<Node>, Vec<u32>) {
    let mut order: Vec<u64> = (0..).zip(all).map(|(i, node)| u64::from(node.order()) << 32 | i).collect();
    order.sort_unstable();
    let count = order.chunk_by(|a, b| a >> 32 == b >> 32).count();
    let (mut nodes, mut numbers): (Vec<Node>, Vec<u32>) = (Vec::with_capacity(count), vec![0; all.len()]);
    for of_place in order.chunk_by(|a, b| a >> 32 == b >> 32) {
        let vertices = || of_place.iter().map(|key| (key & u64::from(u32::MAX)) as usize);
        vertices().for_each(|i| numbers[i] = nodes.len() as u32);
        nodes.extend(vertices().map(|i| all[i]).max_by_key(|node| node.h));
    }
    (nodes, numbers)
}

/// Puts triangles into the order of a mesh of so many vertices.
pub(crate) fn in_order(vertices: usize, triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut starts = vec![0u32; vertices + 1];
    let turned: Vec<[u32; 3]> = triangles.into_iter().map(least_first).collect();
    turned.iter().for_each(|triangle| starts[triangle[0] as usize + 1] += 1);
    (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
    let mut sorted = vec![[0; 3]; turned.len()];
    let mut next = starts.clone();
    for triangle in turned {
        let place = &mut next[triangle[0] as usize];
        sorted[*place as usize] = triangle;
        *place += 1;
    }
    let others = |&[_, b, c]: &[u32; 3]| u64::from(b) << 32 | u64::from(c);
    let of_vertex = starts.windows(2).map(|range| range[0] as usize..range[1] as usize);
    of_vertex.filter(|range| range.len() > 1).for_each(|range| sorted[range].sort_unstable_by_key(others));
    sorted
}
