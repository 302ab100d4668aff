//! A terrain with fewer triangles, for looking at from afar: meshoptimizer collapses edges, and what comes back is checked.
//!
//! Vertices of the outline stay, and so do its edges: two terrains that meet along a part of their outlines still meet there when
//! both, or either of them, are simplified. No other vertex moves, some go.

use meshopt::{SimplifyOptions, simplify_with_locks_decoder};

use super::Tile;
use super::deviation::deviation;
use super::frame::Frame;
use crate::geometry::predicates::orient2d;

/// Heights are handed over this much smaller. All triangles are nearly level then, so that the simplifier's error is the vertical
/// distance, and its test against triangles that turn over sees what turns over in the plane, be the walls ever so steep.
const FLATNESS: f64 = 1.0 / 4096.0;

/// Simplifications of one tile before it is left as it is.
const ATTEMPTS: usize = 4;

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// Its vertices are some of the original's, in their order.
    pub tile: Tile,
    /// The greatest vertical distance to the original, metres.
    pub error: f64,
}

/// `tile`, a terrain over ground that it covers once, with about `triangles` triangles; with more where its outline has too many.
pub fn simplify(frame: &Frame, tile: &Tile, triangles: usize) -> Simplified {
    match collapse(frame, tile, triangles) {
        Some(coarse) => {
            let error = deviation(&tile.positions, &tile.triangles, &coarse) * frame.resolution_metres()[1];
            Simplified { tile: subset(tile, coarse), error }
        }
        None => Simplified { tile: tile.clone(), error: 0.0 },
    }
}

/// Triangles over the same ground, all counterclockwise. Where some turn over although the simplifier has looked (its coordinates
/// are rounded), their corners and those around them are locked, and it tries again.
fn collapse(frame: &Frame, tile: &Tile, triangles: usize) -> Option<Vec<[u32; 3]>> {
    let positions = flattened(frame, &tile.positions);
    let mut locked = vec![false; positions.len()];
    for _ in 0..ATTEMPTS {
        let corners = tile.triangles.as_flattened();
        let options = SimplifyOptions::LockBorder;
        let coarse = simplify_with_locks_decoder(corners, &positions, &locked, 3 * triangles, f32::MAX, options, None);
        let coarse: Vec<[u32; 3]> = coarse.as_chunks().0.to_vec();
        let turned: Vec<[u32; 3]> = coarse.iter().filter(|t| !is_counterclockwise(tile, t)).copied().collect();
        if turned.is_empty() {
            return (outline(&coarse) == outline(&tile.triangles)).then_some(coarse);
        }
        lock_around(tile, &turned, &mut locked);
    }
    None
}

/// x and y in lattice steps from the middle, z in the same unit but flattened.
fn flattened(frame: &Frame, positions: &[[i32; 3]]) -> Vec<[f32; 3]> {
    let [xy, up] = frame.resolution_metres();
    let first = positions.first().copied().unwrap_or_default();
    let [low, high] = positions
        .iter()
        .fold([first; 2], |[low, high], p| [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]);
    let middle = [0, 1, 2].map(|k| (low[k] as f64 + high[k] as f64) / 2.0);
    let scale = [1.0, 1.0, up / xy * FLATNESS];
    positions.iter().map(|p| [0, 1, 2].map(|k| ((p[k] as f64 - middle[k]) * scale[k]) as f32)).collect()
}

fn is_counterclockwise(tile: &Tile, triangle: &[u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|v| tile.positions[v as usize]).map(|p| [p[0], p[1]]);
    orient2d(a, b, c) > 0
}

/// Locks the corners of the `turned` triangles and of all original triangles that touch them.
fn lock_around(tile: &Tile, turned: &[[u32; 3]], locked: &mut [bool]) {
    let mut touched = vec![false; locked.len()];
    turned.iter().flatten().for_each(|&v| touched[v as usize] = true);
    for triangle in tile.triangles.iter().filter(|t| t.iter().any(|&v| touched[v as usize])) {
        triangle.iter().for_each(|&v| locked[v as usize] = true);
    }
}

/// A number that is the same for meshes with the same outline: the sum over all directed edges of one for the edge less one for
/// its reverse, which cancel inside. Counterclockwise triangles with the outline of a mesh that covers its ground once cover
/// that ground once: the winding number of the outline says how many lie over a point.
fn outline(triangles: &[[u32; 3]]) -> u64 {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    edges.fold(0, |sum, (a, b)| sum.wrapping_add(mixed(a, b)).wrapping_sub(mixed(b, a)))
}

/// The finalizer of splitmix64 over an edge.
fn mixed(a: u32, b: u32) -> u64 {
    let mut v = (u64::from(a) << 32 | u64::from(b)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

/// The tile of these triangles, without the vertices that they do not use.
fn subset(tile: &Tile, mut triangles: Vec<[u32; 3]>) -> Tile {
    let mut used = vec![false; tile.positions.len()];
    triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let number = |next: &mut u32, &used: &bool| Some(std::mem::replace(next, *next + used as u32));
    let numbers: Vec<u32> = used.iter().scan(0, number).collect();
    triangles.iter_mut().flatten().for_each(|v| *v = numbers[*v as usize]);
    Tile {
        positions: kept(&tile.positions, &used),
        normals: tile.normals.as_ref().map(|normals| kept(normals, &used)),
        colors: tile.colors.as_ref().map(|colors| kept(colors, &used)),
        triangles,
    }
}

fn kept<T: Copy>(values: &[T], used: &[bool]) -> Vec<T> {
    values.iter().zip(used).filter(|(_, used)| **used).map(|(value, _)| *value).collect()
}
