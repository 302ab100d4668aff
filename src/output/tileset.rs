//! `tileset.json`: the tiles as 3D Tiles 1.1 (OGC 22-025r4).
//!
//! A tileset is Z up, x east and y north here, in metres from the scene's origin; its GLB contents are Y up, and readers turn them.

use serde_json::{Value, json};

use super::document::GENERATOR;
use super::frame::Frame;
use super::globe::{applied, relative};

/// Half the least extent of a bounding volume, metres: viewers divide by it.
const LEAST_HALF: f64 = 0.005;

/// A tile and all below it.
#[derive(Clone, Debug)]
pub struct Node {
    /// Path of its GLB from `tileset.json`; `None` for a tile that only holds others.
    pub uri: Option<String>,
    /// The least and greatest lattice x, y, z of the exact mesh below.
    pub bounds: [[i32; 3]; 2],
    /// The greatest vertical distance to the exact mesh, metres.
    pub error: f64,
    /// Where it lies on the globe, if it lies there: metres x, y, z of the scene to earth-centred ones, column by column. A tile
    /// without is placed as its parent is.
    pub transform: Option<[f64; 16]>,
    /// Finer tiles, which replace it.
    pub children: Vec<Node>,
}

/// Least and greatest x, y, z, metres.
type Extent = [[f64; 3]; 2];

/// The content of `tileset.json`, without a line's end.
pub fn tileset_json(frame: &Frame, root: &Node) -> Value {
    let whole = diagonal(frame, root);
    let (mut tile, _) = tile_json(frame, root, None);
    tile["refine"] = "REPLACE".into();
    json!({
        "asset": {"version": "1.1", "generator": GENERATOR, "extras": frame.extras()},
        // What is wrong where nothing is shown.
        "geometricError": whole.max(root.error),
        "root": tile,
    })
}

/// The tile below one that `above` places on the globe, and what its bounding volume takes in the frame of that one.
fn tile_json(frame: &Frame, node: &Node, above: Option<&[f64; 16]>) -> (Value, Extent) {
    // Without content it is to be refined from everywhere.
    let error = if node.uri.is_some() { node.error } else { diagonal(frame, node).max(node.error) };
    let own = node.transform.as_ref();
    let children: Vec<(Value, Extent)> =
        node.children.iter().map(|child| tile_json(frame, child, own.or(above))).collect();
    let within = children.iter().map(|&(_, extent)| extent).fold(corners(frame, node.bounds), union);
    let mut tile = json!({"boundingVolume": {"box": box_of(within)}, "geometricError": error});
    if let Some(uri) = &node.uri {
        tile["content"] = json!({"uri": uri});
    }
    if !children.is_empty() {
        tile["children"] = children.into_iter().map(|(child, _)| child).collect();
    }
    let Some(own) = own else { return (tile, within) };
    let transform = above.map_or(*own, |above| relative(above, own));
    tile["transform"] = transform.to_vec().into();
    (tile, image(&transform, within))
}

fn union(a: Extent, b: Extent) -> Extent {
    [[0, 1, 2].map(|k| a[0][k].min(b[0][k])), [0, 1, 2].map(|k| a[1][k].max(b[1][k]))]
}

/// What a box takes once it is transformed: that of its corners, since the map is affine.
fn image(transform: &[f64; 16], extent: Extent) -> Extent {
    let corner = |i: usize| applied(transform, [0, 1, 2].map(|k| extent[i >> k & 1][k]));
    (0..8).map(|i| [corner(i); 2]).reduce(union).unwrap_or(extent)
}

/// Metres x, y, z of the tileset at the two corners of `bounds`.
pub fn corners(frame: &Frame, bounds: [[i32; 3]; 2]) -> [[f64; 3]; 2] {
    bounds.map(|corner| {
        let [x, up, z] = frame.world(corner);
        [x, 0.0 - z, up]
    })
}

/// Centre and half axes.
fn box_of([low, high]: Extent) -> [f64; 12] {
    let mut numbers = [0.0; 12];
    for k in 0..3 {
        numbers[k] = (low[k] + high[k]) / 2.0;
        numbers[3 + 4 * k] = ((high[k] - low[k]) / 2.0).max(LEAST_HALF);
    }
    numbers
}

fn diagonal(frame: &Frame, node: &Node) -> f64 {
    let [low, high] = corners(frame, node.bounds);
    (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f64>().sqrt().max(2.0 * LEAST_HALF)
}
