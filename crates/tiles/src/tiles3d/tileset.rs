//! `tileset.json` and external tilesets: the tiles as 3D Tiles 1.1 (OGC 22-025r4).
//!
//! A tileset is Z up, with x east and y north here, in metres from the scene's origin. Its GLB contents are Y up, and readers turn
//! them.
//!
//! An external tileset is the content of a tile without a transform in the file above, so that its root lies as if it were a child
//! there. That tile has the root's error, and its box is the root's in the frame of the tile above.

use serde_json::{Value, json};

use crate::file_names::{relative_uri, tileset_uri};
use crate::frame::Frame;
use crate::gltf::schema::GENERATOR;
use crate::tiles3d::globe::{relative_transform, transform_point};
use delaunay::geometry::Bounds;

/// Cells along a side of a tile at whose corners its bent box is measured.
const BULGE_CELLS: i64 = 8;

/// A length in metres that is below the radius of the earth.
const EARTH: f64 = 6e6;

/// Half the least extent of a bounding volume in metres. Viewers divide by it.
const LEAST_HALF: f64 = 0.005;

/// A tile and all tiles below it.
#[derive(Clone, Debug)]
pub struct TilesetNode {
    /// The path of its GLB from the output directory, or `None` if the tile only holds others.
    pub uri: Option<String>,
    /// The box of the exact mesh below.
    pub bounds: Bounds<3>,
    /// The box of all that is drawn of it by this tile or finer ones.
    pub drawn: Bounds<3>,
    /// The lattice x, y of the place where its transform is exact.
    pub middle: [i32; 2],
    /// The error that viewers choose levels by, in metres.
    pub error: f64,
    /// The greatest distance to the exact mesh in metres: along the vertical, plus the difference between transforms.
    pub greatest_error: f64,
    /// The map from the scene to the globe, if there is one: from metres x, y, z to earth-centred ones, column by column. A tile
    /// without a transform takes its parent's.
    pub transform: Option<[f64; 16]>,
    /// The number of the external tileset that begins with this tile; `None` if the tile is in the file of the one above.
    pub file: Option<usize>,
    /// Finer tiles, which replace it.
    pub children: Vec<TilesetNode>,
}

impl TilesetNode {
    /// Returns a tile without content that holds `children` in a file of its own, or `None` without children.
    pub(super) fn group(children: Vec<TilesetNode>) -> Option<TilesetNode> {
        let bounds = children.iter().map(|child| child.bounds).reduce(Bounds::union)?;
        let drawn = children.iter().map(|child| child.drawn).reduce(Bounds::union)?;
        let error = children.iter().map(|child| child.error).fold(0.0, f64::max);
        let middle = children.first()?.middle;
        let greatest_error = children.iter().map(|child| child.greatest_error).fold(0.0, f64::max);
        let (uri, transform, file) = (None, None, Some(0));
        Some(TilesetNode { uri, bounds, drawn, middle, error, greatest_error, transform, file, children })
    }
}

/// The least and greatest x, y, z in metres.
type MetreBounds = [[f64; 3]; 2];

/// Calls `write` with the number and the text of every file of the tileset below `root`: first the external tilesets, those below
/// others first, then with `None` the main file. `copyright` tells whose the data are. Only the texts of files that refer to each other are in memory at one time.
///
/// # Errors
/// The first error of `write`.
pub fn write_tilesets<E>(
    frame: &Frame,
    root: &TilesetNode,
    copyright: Option<&str>,
    mut write: impl FnMut(Option<usize>, &str) -> Result<(), E>,
) -> Result<(), E> {
    let mut writer = TilesetWriter { frame, copyright, write: &mut write };
    let (tile, _) = writer.tile(root, None, &tileset_uri(None))?;
    writer.file(None, root, tile)
}

/// What takes the number and the text of each file.
type WriteFile<'a, E> = &'a mut dyn FnMut(Option<usize>, &str) -> Result<(), E>;

struct TilesetWriter<'a, E> {
    frame: &'a Frame,
    copyright: Option<&'a str>,
    write: WriteFile<'a, E>,
}

impl<E> TilesetWriter<'_, E> {
    /// Writes the file with this number, whose root is `tile`, made from `node`.
    fn file(&mut self, number: Option<usize>, node: &TilesetNode, mut tile: Value) -> Result<(), E> {
        tile["refine"] = "REPLACE".into();
        let mut asset = json!({"version": "1.1", "generator": GENERATOR});
        // The name that glTF has for it: 3D Tiles have none, and viewers look for this one.
        if let Some(copyright) = self.copyright {
            asset["copyright"] = copyright.into();
        }
        if number.is_none() {
            asset["extras"] = json!(self.frame.extras());
        }
        // The error of showing nothing.
        let error = diagonal(self.frame, node).max(node.error);
        let mut text = json!({"asset": asset, "geometricError": error, "root": tile}).to_string();
        text.push('\n');
        (self.write)(number, &text)
    }

    /// Returns what the file `from` says of a tile below one that `above` places on the globe, and the space that its bounding volume
    /// takes in the parent's frame. The volume holds those of its children.
    fn tile(&mut self, node: &TilesetNode, above: Option<&[f64; 16]>, from: &str) -> Result<(Value, MetreBounds), E> {
        let Some(number) = node.file else { return self.tile_here(node, above, from) };
        let own_file = tileset_uri(Some(number));
        let (root, volume) = self.tile_here(node, above, &own_file)?;
        self.file(Some(number), node, root)?;
        Ok((tile_json(volume, self.error(node), Some(relative_uri(from, &own_file))), volume))
    }

    /// As [`TilesetWriter::tile`], in the file `from` whatever file the tile has.
    fn tile_here(
        &mut self,
        node: &TilesetNode,
        above: Option<&[f64; 16]>,
        from: &str,
    ) -> Result<(Value, MetreBounds), E> {
        let own = node.transform.as_ref();
        let mut volume = thickened(bounds_in_metres(self.frame, node.drawn));
        let mut children = Vec::with_capacity(node.children.len());
        for child in &node.children {
            let (child, of_child) = self.tile(child, own.or(above), from)?;
            children.push(child);
            volume = union(volume, of_child);
        }
        let mut tile = tile_json(volume, self.error(node), node.uri.as_ref().map(|uri| relative_uri(from, uri)));
        if !children.is_empty() {
            tile["children"] = children.into();
            if node.uri.is_some() {
                tile["extras"] = json!({"maxError": node.greatest_error});
            }
        }
        let Some(own) = own else { return Ok((tile, volume)) };
        let transform = above.map_or(*own, |above| relative_transform(above, own));
        tile["transform"] = transform.to_vec().into();
        Ok((tile, image(&transform, volume)))
    }

    /// Returns the error of showing a tile in place of those below.
    fn error(&self, node: &TilesetNode) -> f64 {
        // A tile without content must be refined wherever the viewer is.
        if node.uri.is_some() { node.error } else { diagonal(self.frame, node).max(node.error) }
    }
}

/// Returns a tile without children and without a transform.
fn tile_json(volume: MetreBounds, error: f64, uri: Option<String>) -> Value {
    let mut tile = json!({"boundingVolume": {"box": box_of(volume)}, "geometricError": error});
    if let Some(uri) = uri {
        tile["content"] = json!({"uri": uri});
    }
    tile
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
    let place = |corner| {
        let [x, up, z] = frame.world(corner);
        [x, 0.0 - z, up]
    };
    if frame.extras().curvature.is_none() {
        return [bounds.min, bounds.max].map(place);
    }
    // Between the places looked at, a bent box bulges by their distance squared over the size of the earth.
    let side = [0, 1].map(|k| bounds.extent(k) as f64 * frame.resolution_metres()[0] / BULGE_CELLS as f64);
    let bulge =
        (side[0] * side[0] + side[1] * side[1]) / EARTH + frame.resolution_metres().into_iter().fold(0.0, f64::max);
    let along = |k: usize, n: i64, cells: i64| (bounds.min[k] as i64 + bounds.extent(k) * n / cells) as i32;
    let line = BULGE_CELLS + 1;
    let corners = (0..line * line * 2).map(|i| {
        [along(0, i % line, BULGE_CELLS), along(1, i / line % line, BULGE_CELLS), along(2, i / line / line, 1)]
    });
    let around = corners.map(|corner| [place(corner); 2]).reduce(union).unwrap_or([[0.0; 3]; 2]);
    [around[0].map(|v| v - bulge), around[1].map(|v| v + bulge)]
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
    let [low, high] = bounds_in_metres(frame, node.drawn);
    (0..3).map(|k| (high[k] - low[k]) * (high[k] - low[k])).sum::<f64>().sqrt().max(2.0 * LEAST_HALF)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice::{Lattice, shortest_decimal};
    use std::collections::BTreeMap;
    use std::convert::Infallible;

    fn texts(frame: &Frame, root: &TilesetNode) -> BTreeMap<String, Value> {
        let mut texts = BTreeMap::new();
        let keep = |number: Option<usize>, text: &str| {
            texts.insert(tileset_uri(number), serde_json::from_str(text).unwrap());
            Ok::<(), Infallible>(())
        };
        write_tilesets(frame, root, None, keep).unwrap();
        texts
    }

    #[test]
    fn the_volume_of_a_flat_tile_is_within_its_parents() {
        let decimal = |v: f64| shortest_decimal(v).unwrap();
        let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(0.001), resolution_z: decimal(0.001) };
        let frame = Frame::new(&lattice, 1.0, 1.0, None).unwrap();
        let node = |min, max, children| TilesetNode {
            uri: None,
            bounds: Bounds { min, max },
            drawn: Bounds { min, max },
            middle: [0; 2],
            error: 0.0,
            greatest_error: 0.0,
            transform: None,
            file: None,
            children,
        };
        let child = node([0, 0, 5], [3, 4_000, 5], Vec::new());
        let root = node([0, 0, 5], [9_000, 9_000, 5], vec![child]);
        let json = texts(&frame, &root).remove("tileset.json").unwrap();
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

    /// A transform that moves and turns, so that a wrong chain of them shows.
    fn moved(by: f64) -> [f64; 16] {
        let (sin, cos) = by.sin_cos();
        [cos, sin, 0.0, 0.0, -sin, cos, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 100.0 * by, -50.0 * by, 7.0, 1.0]
    }

    /// Returns where each content lies in the tileset: its path, and the place to which the transforms of all files bring a point.
    fn contents(texts: &BTreeMap<String, Value>) -> BTreeMap<String, [f64; 3]> {
        fn visit(
            texts: &BTreeMap<String, Value>,
            file: &str,
            tile: &Value,
            at: &dyn Fn([f64; 3]) -> [f64; 3],
            found: &mut BTreeMap<String, [f64; 3]>,
        ) {
            let own: Option<[f64; 16]> = serde_json::from_value(tile["transform"].clone()).ok();
            let here = |place: [f64; 3]| at(own.as_ref().map_or(place, |own| transform_point(own, place)));
            if let Some(uri) = tile["content"]["uri"].as_str() {
                // Resolve the path as viewers do.
                let mut path: Vec<&str> = file.split('/').collect();
                path.pop();
                for part in uri.split('/') {
                    if part == ".." { path.pop().map(|_| ()).unwrap() } else { path.push(part) }
                }
                let path = path.join("/");
                if let Some(external) = texts.get(&path) {
                    assert!(tile["children"].is_null(), "a tile that names a tileset has no children");
                    assert_eq!(tile["geometricError"], external["root"]["geometricError"]);
                    visit(texts, &path, &external["root"], &here, found);
                } else {
                    assert_eq!(found.insert(path, here([1.0, 2.0, 3.0])), None, "every tile is there once");
                }
            }
            for child in tile["children"].as_array().into_iter().flatten() {
                visit(texts, file, child, &here, found);
            }
        }
        let mut found = BTreeMap::new();
        visit(texts, "tileset.json", &texts["tileset.json"]["root"], &|place| place, &mut found);
        found
    }

    #[test]
    fn external_tilesets_put_every_tile_where_the_whole_one_does() {
        let decimal = |v: f64| shortest_decimal(v).unwrap();
        let lattice = Lattice { offset: [decimal(0.0); 3], resolution: decimal(0.01), resolution_z: decimal(0.01) };
        let frame = Frame::new(&lattice, 1.0, 1.0, None).unwrap();
        for placed in [false, true] {
            let mut count = 0;
            // A pyramid of tiles with four children each.
            fn pyramid(height: usize, count: &mut i32, placed: bool) -> TilesetNode {
                let children: Vec<_> =
                    (0..if height > 0 { 4 } else { 0 }).map(|_| pyramid(height - 1, count, placed)).collect();
                *count += 1;
                let own = Bounds { min: [*count, -*count, 0], max: [*count + 90, 50 - *count, *count % 9] };
                TilesetNode {
                    uri: Some(format!("tiles/{count}.glb")),
                    bounds: children.iter().map(|child| child.bounds).fold(own, Bounds::union),
                    drawn: children.iter().map(|child| child.drawn).fold(own, Bounds::union),
                    middle: [*count; 2],
                    error: height as f64,
                    greatest_error: 2.0 * height as f64,
                    transform: placed.then(|| moved(f64::from(*count) * 0.01)),
                    file: None,
                    children,
                }
            }
            let whole = pyramid(6, &mut count, placed);
            let mut divided = whole.clone();
            let files = crate::tiles3d::division::divide(&mut divided);
            let (whole, divided) = (texts(&frame, &whole), texts(&frame, &divided));
            assert!(files > 5 && divided.len() == files + 1 && whole.len() == 1);
            let (expected, found) = (contents(&whole), contents(&divided));
            assert!(expected.keys().eq(found.keys()) && expected.len() == count as usize);
            let off = |name: &String| (0..3).map(|k| (expected[name][k] - found[name][k]).abs()).fold(0.0, f64::max);
            assert!(expected.keys().map(off).fold(0.0, f64::max) < 1e-9);
            for text in divided.values() {
                assert_eq!((&text["asset"]["version"], &text["root"]["refine"]), (&json!("1.1"), &json!("REPLACE")));
                assert!(text["geometricError"].as_f64() >= text["root"]["geometricError"].as_f64());
            }
            assert!(divided.values().all(|text| text.to_string().len() < 1_000_000));
        }
    }
}
