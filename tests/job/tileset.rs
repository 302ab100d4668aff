//! Reads `tileset.json` as viewers do, and checks it against the rules of 3D Tiles.

use std::collections::BTreeMap;

use gdt_batch::output::gltf::read::read_tile;
use serde_json::Value;

use crate::program::Job;

/// A 4 x 4 matrix, column by column.
pub(crate) type Transform = [f64; 16];

const UNMOVED: Transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// A tile of the tileset.
pub(crate) struct Tile {
    pub(crate) json: Value,
    /// Indices of its ancestors, nearest first.
    pub(crate) above: Vec<usize>,
    /// Indices of the leaves at or below it.
    pub(crate) leaves: Vec<usize>,
    /// The transform from its own frame to its parent's.
    step: Transform,
    /// The transform from its own frame to the world.
    pub(crate) placed: Transform,
}

/// Returns all tiles, children after their parents.
pub(crate) fn tiles(job: &Job) -> Vec<Tile> {
    fn add(found: &mut Vec<Tile>, json: &Value, above: &[usize]) {
        let own = found.len();
        let step = numbers(&json["transform"]).unwrap_or(UNMOVED);
        let placed = above.first().map_or(step, |&parent| product(&found[parent].placed, &step));
        found.push(Tile { json: json.clone(), above: above.to_vec(), leaves: Vec::new(), step, placed });
        let children = json["children"].as_array();
        if children.is_none() {
            found[own].leaves.push(own);
            above.iter().for_each(|&parent| found[parent].leaves.push(own));
        }
        let above: Vec<usize> = [&[own], above].concat();
        children.into_iter().flatten().for_each(|child| add(found, child, &above));
    }
    let json: Value = serde_json::from_slice(&std::fs::read(job.out().join("tileset.json")).unwrap()).unwrap();
    assert_eq!(json["asset"]["version"], "1.1");
    assert!(error(&json) >= error(&json["root"]));
    assert_eq!(json["root"]["refine"], "REPLACE");
    let mut found = Vec::new();
    add(&mut found, &json["root"], &[]);
    found
}

pub(crate) fn error(tile: &Value) -> f64 {
    tile["geometricError"].as_f64().unwrap()
}

/// Returns a list of `N` numbers, or `None` if the value is something else.
pub(crate) fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    serde_json::from_value::<Vec<f64>>(value.clone()).ok()?.try_into().ok()
}

/// Returns the transform that applies `inner` and then `outer`.
fn product(outer: &Transform, inner: &Transform) -> Transform {
    std::array::from_fn(|i| (0..4).map(|k| outer[4 * k + i % 4] * inner[i / 4 * 4 + k]).sum())
}

/// Returns where `transform` puts a place.
pub(crate) fn applied(transform: &Transform, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| transform[k] * x + transform[4 + k] * y + transform[8 + k] * z + transform[12 + k])
}

/// Returns the least and the greatest x, y, z of the tile's box.
pub(crate) fn extent(tile: &Value) -> [[f64; 3]; 2] {
    let numbers: [f64; 12] = numbers(&tile["boundingVolume"]["box"]).unwrap();
    let half = [numbers[3], numbers[7], numbers[11]];
    assert!(half.iter().all(|&h| h > 0.0) && numbers[3..].iter().filter(|&&n| n != 0.0).count() == 3);
    [-1.0, 1.0].map(|side| [0, 1, 2].map(|k| numbers[k] + side * half[k]))
}

/// Tells whether a place lies in a box. Both are rounded: a box is a centre and half sides, and a place went through transforms.
fn is_within(place: [f64; 3], [low, high]: [[f64; 3]; 2]) -> bool {
    (0..3).all(|k| place[k] >= low[k] - 1e-6 && place[k] <= high[k] + 1e-6)
}

/// Tells whether the box of `tile`, where its transform puts it, lies in the box of its parent.
fn is_in_its_parents(tile: &Tile, parent: &Tile) -> bool {
    let (own, outer) = (extent(&tile.json), extent(&parent.json));
    (0..8).all(|i| is_within(applied(&tile.step, [0, 1, 2].map(|k| own[i >> k & 1][k])), outer))
}

/// Returns the triangles of a tile's content: x east, y north, z up, in metres from the scene's origin.
pub(crate) fn triangles(job: &Job, tile: &Tile) -> Vec<[[f64; 3]; 3]> {
    let path = job.out().join(tile.json["content"]["uri"].as_str().unwrap());
    let mut found = Vec::new();
    for part in read_tile(&path).unwrap().parts {
        let corner = |v: u32| {
            let [x, up, z] = part.world(v as usize);
            [x, -z, up]
        };
        found.extend(part.triangles.iter().map(|t| t.map(corner)));
    }
    found
}

/// Returns the height of a triangle at x, y, or `None` outside it.
pub(crate) fn height(t: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> Option<f64> {
    let area = |a: [f64; 3], b: [f64; 3]| (a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y);
    let weights = [area(t[1], t[2]), area(t[2], t[0]), area(t[0], t[1])];
    let total: f64 = weights.iter().sum();
    weights.iter().all(|&w| w >= 0.0).then(|| (0..3).map(|i| weights[i] * t[i][2]).sum::<f64>() / total)
}

/// Asserts the rules of 3D Tiles 1.1, and that every GLB file is the content of exactly one tile.
#[track_caller]
pub(crate) fn keeps_the_rules(job: &Job, tiles: &[Tile]) {
    let mut shown = BTreeMap::<String, usize>::new();
    for tile in tiles {
        let own = extent(&tile.json);
        if let Some(&parent) = tile.above.first() {
            assert!(is_in_its_parents(tile, &tiles[parent]), "{}", tile.json["boundingVolume"]);
            assert!(error(&tile.json) <= error(&tiles[parent].json));
            assert!(tile.json["refine"].is_null());
        }
        let Some(uri) = tile.json["content"]["uri"].as_str() else { continue };
        *shown.entry(uri.to_owned()).or_default() += 1;
        let points: Vec<[f64; 3]> = triangles(job, tile).into_iter().flatten().collect();
        assert!(!points.is_empty() && points.iter().all(|&p| is_within(p, own)), "{uri}");
        assert_eq!(uri.starts_with("tiles/"), tile.json["children"].is_null(), "{uri}");
        assert!(uri.starts_with("levels/") || error(&tile.json) == 0.0, "{uri}");
    }
    let files = |folder: &str| std::fs::read_dir(job.out().join(folder)).map_or(0, |entries| entries.count());
    assert!(shown.values().all(|&count| count == 1));
    assert_eq!(shown.len(), files("tiles") + files("levels"));
}
