//! `tileset.json`: the tiles as 3D Tiles 1.1 (OGC 22-025r4).
//!
//! A tileset is Z up, with x east and y north here, in metres from the scene's origin. Its GLB contents are Y up, and readers turn
//! them.

use serde_json::{Value, json};

use crate::geometry::Bounds;
use crate::output::frame::Frame;
use crate::output::gltf::schema::GENERATOR;
use crate::output::tiles3d::globe::{relative_transform, transform_point};

/// Half the least extent of a bounding volume in metres. Viewers divide by it.
const LEAST_HALF: f64 = 0.005;

/// A tile and all tiles below it.
#[derive(Clone, Debug)]
pub struct TilesetNode {
    /// The path of its GLB from `tileset.json`, or `None` if the tile only holds others.
    pub uri: Option<String>,
    /// The box of the exact mesh below.
    pub bounds: Bounds<3>,
    /// The lattice x, y of the place where its transform is exact.
    pub middle: [i32; 2],
    /// The greatest distance to the exact mesh in metres: along the vertical, plus the difference between transforms.
    pub error: f64,
    /// The map from the scene to the globe, if there is one: from metres x, y, z to earth-centred ones, column by column. A tile
    /// without a transform takes its parent's.
    pub transform: Option<[f64; 16]>,
    /// Finer tiles, which replace it.
    pub children: Vec<TilesetNode>,
}

/// The least and greatest x, y, z in metres.
type MetreBounds = [[f64; 3]; 2];

/// Returns the content of `tileset.json`, without the line break at its end.
pub fn tileset_json(frame: &Frame, root: &TilesetNode) -> Value {
    let whole = diagonal(frame, root);
    let (mut tile, _) = tile_json(frame, root, None);
    tile["refine"] = "REPLACE".into();
    json!({
        "asset": {"version": "1.1", "generator": GENERATOR, "extras": frame.extras()},
        // The error of showing nothing.
        "geometricError": whole.max(root.error),
        "root": tile,
    })
}

/// Returns the tile below one that `above` places on the globe, and the space that its bounding volume takes in the parent's frame.
/// The volume holds those of its children.
fn tile_json(frame: &Frame, node: &TilesetNode, above: Option<&[f64; 16]>) -> (Value, MetreBounds) {
    // A tile without content must be refined wherever the viewer is.
    let error = if node.uri.is_some() { node.error } else { diagonal(frame, node).max(node.error) };
    let own = node.transform.as_ref();
    let below = node.children.iter().map(|child| tile_json(frame, child, own.or(above)));
    let (children, volumes): (Vec<Value>, Vec<MetreBounds>) = below.unzip();
    let volume = volumes.into_iter().fold(thickened(bounds_in_metres(frame, node.bounds)), union);
    let mut tile = json!({"boundingVolume": {"box": box_of(volume)}, "geometricError": error});
    if let Some(uri) = &node.uri {
        tile["content"] = json!({"uri": uri});
    }
    if !children.is_empty() {
        tile["children"] = children.into();
    }
    let Some(own) = own else { return (tile, volume) };
    let transform = above.map_or(*own, |above| relative_transform(above, own));
    tile["transform"] = transform.to_vec().into();
    (tile, image(&transform, volume))
}

/// Returns the box around a transformed box. It is that of the transformed corners, because the map is affine.
fn image(transform: &[f64; 16], extent: MetreBounds) -> MetreBounds {
    let corner = |i: usize| transform_point(transform, [0, 1, 2].map(|k| extent[i >> k & 1][k]));
    (0..8).map(|i| [corner(i); 2]).reduce(union).unwrap_or(extent)
}

/// Widens a box to at least twice [`LEAST_HALF`] along every axis.
fn thickened([low, high]: MetreBounds) -> MetreBounds {
    let lacking = [0, 1, 2].map(|k| (LEAST_HALF - (high[k] - low[k]) / 2.0).max(0.0));
    [[0, 1, 2].map(|k| low[k] - lacking[k]), [0, 1, 2].map(|k| high[k] + lacking[k])]
}

fn union(a: MetreBounds, b: MetreBounds) -> MetreBounds {
    [[0, 1, 2].map(|k| a[0][k].min(b[0][k])), [0, 1, 2].map(|k| a[1][k].max(b[1][k]))]
}

/// Returns the least and greatest x, y, z of `bounds` in metres of the tileset.
pub fn bounds_in_metres(frame: &Frame, bounds: Bounds<3>) -> [[f64; 3]; 2] {
    [bounds.min, bounds.max].map(|corner| {
        let [x, up, z] = frame.world(corner);
        [x, 0.0 - z, up]
    })
}

/// Returns the centre and the half axes of a box.
fn box_of([low, high]: MetreBounds) -> [f64; 12] {
    let mut numbers = [0.0; 12];
    for k in 0..3 {
        numbers[k] = (low[k] + high[k]) / 2.0;
        numbers[3 + 4 * k] = (high[k] - low[k]) / 2.0;
    }
    numbers
}

/// Returns the length of the diagonal of a tile's box in metres.
fn diagonal(frame: &Frame, node: &TilesetNode) -> f64 {
    let [low, high] = bounds_in_metres(frame, node.bounds);
    (0..3).map(|k| (high[k] - low[k]) * (high[k] - low[k])).sum::<f64>().sqrt().max(2.0 * LEAST_HALF)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lattice::{Lattice, shortest_decimal};

    #[test]
    fn the_volume_of_a_flat_tile_is_within_its_parents() {
        let decimal = |v: f64| shortest_decimal(v).unwrap();
        let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(0.001), resolution_z: decimal(0.001) };
        let frame = Frame::new(&lattice, 1.0, 1.0, None).unwrap();
        let node = |min, max, children| TilesetNode {
            uri: None,
            bounds: Bounds { min, max },
            middle: [0; 2],
            error: 0.0,
            transform: None,
            children,
        };
        let child = node([0, 0, 5], [3, 4_000, 5], Vec::new());
        let root = node([0, 0, 5], [9_000, 9_000, 5], vec![child]);
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
