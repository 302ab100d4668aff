//! `tileset.json`: the tiles as 3D Tiles 1.1 (OGC 22-025r4).
//!
//! A tileset is Z up, x east and y north here, in metres from the scene's origin; its GLB contents are Y up, and readers turn them.

use serde_json::{Value, json};

use super::document::GENERATOR;
use super::frame::Frame;

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
    /// Finer tiles, which replace it.
    pub children: Vec<Node>,
}

/// The content of `tileset.json`, without a line's end. `transform` places the terrain on the globe: metres x, y, z of the tileset
/// to earth-centred ones, column by column.
pub fn tileset_json(frame: &Frame, root: &Node, transform: Option<[f64; 16]>) -> Value {
    let whole = diagonal(frame, root);
    let mut tile = tile_json(frame, root);
    tile["refine"] = "REPLACE".into();
    if let Some(transform) = transform {
        tile["transform"] = transform.to_vec().into();
    }
    json!({
        "asset": {"version": "1.1", "generator": GENERATOR, "extras": frame.extras()},
        // What is wrong where nothing is shown.
        "geometricError": whole.max(root.error),
        "root": tile,
    })
}

fn tile_json(frame: &Frame, node: &Node) -> Value {
    // Without content it is to be refined from everywhere.
    let error = if node.uri.is_some() { node.error } else { diagonal(frame, node).max(node.error) };
    let mut tile = json!({"boundingVolume": {"box": box_of(frame, node.bounds)}, "geometricError": error});
    if let Some(uri) = &node.uri {
        tile["content"] = json!({"uri": uri});
    }
    if !node.children.is_empty() {
        tile["children"] = node.children.iter().map(|child| tile_json(frame, child)).collect();
    }
    tile
}

/// Metres x, y, z of the tileset at the two corners of `bounds`.
pub fn corners(frame: &Frame, bounds: [[i32; 3]; 2]) -> [[f64; 3]; 2] {
    bounds.map(|corner| {
        let [x, up, z] = frame.world(corner);
        [x, 0.0 - z, up]
    })
}

/// Centre and half axes.
fn box_of(frame: &Frame, bounds: [[i32; 3]; 2]) -> [f64; 12] {
    let [low, high] = corners(frame, bounds);
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
