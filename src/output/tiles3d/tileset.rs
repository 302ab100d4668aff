//! `tileset.json`: the tiles as 3D Tiles 1.1 (OGC 22-025r4).
//!
//! A tileset is Z up, x east and y north here, in metres from the scene's origin; its GLB contents are Y up, and readers turn them.

use serde_json::{Value, json};

use crate::output::frame::Frame;
use crate::output::gltf::schema::GENERATOR;
use crate::output::tiles3d::globe::{applied, relative};

/// Half the least extent of a bounding volume, metres: viewers divide by it.
const LEAST_HALF: f64 = 0.005;

/// A tile and all below it.
#[derive(Clone, Debug)]
pub struct Node {
    /// Path of its GLB from `tileset.json`; `None` for a tile that only holds others.
    pub uri: Option<String>,
    /// The least and greatest lattice x, y, z of the exact mesh below.
    pub bounds: [[i32; 3]; 2],
    /// The lattice x, y of the place where its transform is to be exact.
    pub middle: [i32; 2],
    /// The greatest distance to the exact mesh, metres: along the vertical, and what transforms put elsewhere.
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

/// The tile below one that `above` places on the globe, and what its bounding volume takes in the frame of that one. The volume
/// holds those of its children.
fn tile_json(frame: &Frame, node: &Node, above: Option<&[f64; 16]>) -> (Value, Extent) {
    // Without content it is to be refined from everywhere.
    let error = if node.uri.is_some() { node.error } else { diagonal(frame, node).max(node.error) };
    let own = node.transform.as_ref();
    let below = node.children.iter().map(|child| tile_json(frame, child, own.or(above)));
    let (children, volumes): (Vec<Value>, Vec<Extent>) = below.unzip();
    let volume = volumes.into_iter().fold(thick(corners(frame, node.bounds)), around);
    let mut tile = json!({"boundingVolume": {"box": box_of(volume)}, "geometricError": error});
    if let Some(uri) = &node.uri {
        tile["content"] = json!({"uri": uri});
    }
    if !children.is_empty() {
        tile["children"] = children.into();
    }
    let Some(own) = own else { return (tile, volume) };
    let transform = above.map_or(*own, |above| relative(above, own));
    tile["transform"] = transform.to_vec().into();
    (tile, image(&transform, volume))
}

/// What a box takes once it is transformed: that of its corners, since the map is affine.
fn image(transform: &[f64; 16], extent: Extent) -> Extent {
    let corner = |i: usize| applied(transform, [0, 1, 2].map(|k| extent[i >> k & 1][k]));
    (0..8).map(|i| [corner(i); 2]).reduce(around).unwrap_or(extent)
}

/// The corners, at least twice [`LEAST_HALF`] apart along every axis.
fn thick([low, high]: Extent) -> Extent {
    let lacking = [0, 1, 2].map(|k| (LEAST_HALF - (high[k] - low[k]) / 2.0).max(0.0));
    [[0, 1, 2].map(|k| low[k] - lacking[k]), [0, 1, 2].map(|k| high[k] + lacking[k])]
}

fn around(a: Extent, b: Extent) -> Extent {
    [[0, 1, 2].map(|k| a[0][k].min(b[0][k])), [0, 1, 2].map(|k| a[1][k].max(b[1][k]))]
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
        numbers[3 + 4 * k] = (high[k] - low[k]) / 2.0;
    }
    numbers
}

fn diagonal(frame: &Frame, node: &Node) -> f64 {
    let [low, high] = corners(frame, node.bounds);
    (0..3).map(|k| (high[k] - low[k]) * (high[k] - low[k])).sum::<f64>().sqrt().max(2.0 * LEAST_HALF)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lattice::{Lattice, shortest_decimal};

    #[test]
    fn a_flat_tile_at_the_rim_stays_within_its_parent() {
        let decimal = |v: f64| shortest_decimal(v).unwrap();
        let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(0.001), resolution_z: decimal(0.001) };
        let frame = Frame::new(&lattice, 1.0, 1.0, None).unwrap();
        let node = |bounds, children| Node { uri: None, bounds, middle: [0; 2], error: 0.0, transform: None, children };
        let child = node([[0, 0, 5], [3, 4_000, 5]], Vec::new());
        let root = node([[0, 0, 5], [9_000, 9_000, 5]], vec![child]);
        let json = tileset_json(&frame, &root);
        let numbers = |tile: &Value| -> Vec<f64> {
            tile["boundingVolume"]["box"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
        };
        let (outer, inner) = (numbers(&json["root"]), numbers(&json["root"]["children"][0]));
        for k in 0..3 {
            assert!(inner[3 + 4 * k] >= LEAST_HALF);
            assert!(inner[k] - inner[3 + 4 * k] >= outer[k] - outer[3 + 4 * k] - 1e-12, "axis {k}");
            assert!(inner[k] + inner[3 + 4 * k] <= outer[k] + outer[3 + 4 * k] + 1e-12, "axis {k}");
        }
    }
}
