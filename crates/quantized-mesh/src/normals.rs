//! Normals of the terrain at vertices, the same in all tiles that share one.

use crate::mesh::{LAST, Node, OUTSIDE, TileMesh};
use crate::number_hash::NumberMap;
use crate::place::{HEIGHT_STEPS, SPAN};
use crate::tile::Tile;
use bytemuck::{Pod, Zeroable};

/// The mean radius of the earth in metres. The scale of a tile needs no more.
const RADIUS: f64 = 6_371_000.0;

/// What the triangles of one tile add to the normal of a vertex on its border.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BorderNormal {
    /// Its place, as that of a [`Node`](crate::Node).
    pub place: [u16; 2],
    /// East, north, up.
    pub sum: [f32; 3],
}

/// Returns for `count` vertices the sum of the normals of their triangles, east, north and up, each as long as twice the area of its triangle. Triangles
/// beside the terrain add nothing. `number` returns the place of a vertex in the list, or one beyond.
fn sums(mesh: &TileMesh, tile: Tile, count: usize, number: impl Fn(u32) -> usize) -> Vec<[f32; 3]> {
    let [east, north] = tile.sides().map(|side| side * RADIUS / SPAN as f64);
    let [x, y, z] = [east * libm::cos(tile.middle()[1]), north, 1.0 / HEIGHT_STEPS];
    // In steps first, then in square metres.
    let scale = [y * z, z * x, x * y];
    let mut sums = vec![[0.0f64; 3]; count];
    for triangle in &mesh.triangles {
        let numbers = triangle.map(&number);
        if numbers.iter().all(|number| *number >= count) {
            continue;
        }
        let [a, b, c] = triangle.map(|v| mesh.nodes[v as usize]);
        if [a, b, c].iter().any(|node| node.h == OUTSIDE) {
            continue;
        }
        let from_a = |node: Node| {
            let along = |to: u16, from: u16| f64::from(i32::from(to) - i32::from(from));
            [along(node.u, a.u), along(node.v, a.v), f64::from(node.h) - f64::from(a.h)]
        };
        let (p, q) = (from_a(b), from_a(c));
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        for number in numbers {
            if let Some(sum) = sums.get_mut(number) {
                (0..3).for_each(|k| sum[k] += normal[k]);
            }
        }
    }
    sums.into_iter().map(|sum| [0, 1, 2].map(|k| (sum[k] * scale[k]) as f32)).collect()
}

/// Returns what a tile adds to the normals on its border.
pub fn border_normals(mesh: &TileMesh, tile: Tile) -> Vec<BorderNormal> {
    let mut places: Vec<[u16; 2]> = Vec::new();
    let number = |node: &Node| {
        let number = if node.is_on_border() { places.len() as u32 } else { u32::MAX };
        places.extend(node.is_on_border().then_some([node.u, node.v]));
        number
    };
    let numbers: Vec<u32> = mesh.nodes.iter().map(number).collect();
    let sums = sums(mesh, tile, places.len(), |v| numbers[v as usize] as usize);
    places.into_iter().zip(sums).map(|(place, sum)| BorderNormal { place, sum }).collect()
}

/// Returns the normals of a tile, of any length. `around` are the borders of the tiles around it, by the columns east and the rows north that they
/// lie, from south to north and from west to east.
pub(crate) fn normals(mesh: &TileMesh, tile: Tile, around: &[([i32; 2], Vec<BorderNormal>)]) -> Vec<[f32; 3]> {
    let mut normals = sums(mesh, tile, mesh.nodes.len(), |v| v as usize);
    let own: Vec<BorderNormal> = (mesh.nodes.iter().zip(&normals))
        .filter(|(node, _)| node.is_on_border())
        .map(|(node, sum)| BorderNormal { place: [node.u, node.v], sum: *sum })
        .collect();
    let mut tiles: Vec<([i32; 2], &[BorderNormal])> =
        around.iter().map(|(place, border)| (*place, &border[..])).collect();
    tiles.push(([0, 0], &own));
    // All tiles around a vertex add in the same order, so that they get the same bits.
    tiles.sort_by_key(|([east, north], _)| [*north, *east]);
    let mut shared: NumberMap<[u16; 2], [f32; 3]> = NumberMap::default();
    for (offset, border) in tiles {
        for normal in border {
            let moved = |axis: usize| {
                let along = i32::from(normal.place[axis]) + offset[axis] * i32::from(LAST);
                u16::try_from(along).ok().filter(|along| *along <= LAST)
            };
            if let (Some(u), Some(v)) = (moved(0), moved(1)) {
                let sum = shared.entry([u, v]).or_default();
                (0..3).for_each(|k| sum[k] += normal.sum[k]);
            }
        }
    }
    for (node, normal) in mesh.nodes.iter().zip(&mut normals).filter(|(node, _)| node.is_on_border()) {
        if let Some(sum) = shared.get(&[node.u, node.v]) {
            *normal = *sum;
        }
    }
    normals
}
