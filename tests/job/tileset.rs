//! Reads `tileset.json` and external tilesets as viewers do, and checks them against the rules of 3D Tiles.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tiles::gltf::read::read_tile;

use crate::program::Job;

/// A 4 x 4 matrix, column by column.
pub(crate) type Transform = [f64; 16];

const UNMOVED: Transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// A tile of the tileset. The tile that stands for an external tileset is not one of its own.
pub(crate) struct Tile {
    /// What its file says of it. The URI of its content is the path from the output directory.
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
    let mut reader = TilesetReader { job, found: Vec::new(), files: Vec::new() };
    reader.file("tileset.json", &[]);
    // Every file of the folder is in use, once.
    let mut expected: Vec<String> = files_below(&job.out().join("tilesets"))
        .iter()
        .map(|path| path.strip_prefix(job.out()).unwrap().to_str().unwrap().to_owned())
        .collect();
    expected.push("tileset.json".into());
    expected.sort_unstable();
    reader.files.sort_unstable();
    assert_eq!(reader.files, expected);
    reader.found
}

/// Returns the files in `folder` and in the folders in it; none if there is no such folder.
pub(crate) fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// Returns the path from the output directory to which `uri` leads from the file at `from`.
fn resolved(from: &str, uri: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in uri.split('/') {
        if part == ".." { assert!(parts.pop().is_some(), "{uri} leads out of the directory") } else { parts.push(part) }
    }
    parts.join("/")
}

struct TilesetReader<'a> {
    job: &'a Job,
    found: Vec<Tile>,
    /// The paths of the files that were read.
    files: Vec<String>,
}

impl TilesetReader<'_> {
    /// Reads a file whose root lies below the tiles `above`, and returns the root.
    fn file(&mut self, name: &str, above: &[usize]) -> Value {
        let text = std::fs::read(self.job.out().join(name)).unwrap();
        assert!(text.len() <= 1_000_000, "{name} has {} bytes", text.len());
        let json: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(json["asset"]["version"], "1.1");
        assert!(error(&json) >= error(&json["root"]));
        assert_eq!(json["root"]["refine"], "REPLACE");
        self.files.push(name.into());
        let mut root = json["root"].clone();
        if !above.is_empty() {
            root.as_object_mut().unwrap().remove("refine");
        }
        self.tile(name, &root, above);
        root
    }

    fn tile(&mut self, file: &str, json: &Value, above: &[usize]) {
        let mut json = json.clone();
        if let Some(uri) = json["content"]["uri"].as_str() {
            let path = resolved(file, uri);
            if path.ends_with(".json") {
                assert!(json["children"].is_null() && json["transform"].is_null() && json["refine"].is_null());
                let own = self.found.len();
                let root = self.file(&path, above);
                assert_eq!(json["geometricError"], root["geometricError"]);
                // Its box, which has no transform, holds that of the root.
                assert!(is_in(&self.found[own], &json), "{path}");
                return;
            }
            json["content"]["uri"] = path.into();
        }
        let own = self.found.len();
        let step = numbers(&json["transform"]).unwrap_or(UNMOVED);
        let placed = above.first().map_or(step, |&parent| product(&self.found[parent].placed, &step));
        let children = json["children"].as_array().cloned();
        self.found.push(Tile { json, above: above.to_vec(), leaves: Vec::new(), step, placed });
        if children.is_none() {
            self.found[own].leaves.push(own);
            above.iter().for_each(|&parent| self.found[parent].leaves.push(own));
        }
        let above: Vec<usize> = [&[own], above].concat();
        children.iter().flatten().for_each(|child| self.tile(file, child, &above));
    }
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

/// Tells whether the box of `tile`, where its transform puts it, lies in the box of the tile `outer`.
fn is_in(tile: &Tile, outer: &Value) -> bool {
    let (own, outer) = (extent(&tile.json), extent(outer));
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

/// Returns the height of a triangle at x, y, or `None` outside it and for vertical ones.
pub(crate) fn height(t: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> Option<f64> {
    let area = |a: [f64; 3], b: [f64; 3]| (a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y);
    let weights = [area(t[1], t[2]), area(t[2], t[0]), area(t[0], t[1])];
    let total: f64 = weights.iter().sum();
    (total > 0.0 && weights.iter().all(|&w| w >= 0.0))
        .then(|| (0..3).map(|i| weights[i] * t[i][2]).sum::<f64>() / total)
}

/// Asserts the rules of 3D Tiles 1.1, and that every GLB file is the content of exactly one tile.
#[track_caller]
pub(crate) fn keeps_the_rules(job: &Job, tiles: &[Tile]) {
    let mut shown = BTreeMap::<String, usize>::new();
    for tile in tiles {
        let own = extent(&tile.json);
        if let Some(&parent) = tile.above.first() {
            assert!(is_in(tile, &tiles[parent].json), "{}", tile.json["boundingVolume"]);
            // A tile without content is refined wherever the viewer is.
            assert!(tile.json["content"].is_null() || error(&tile.json) <= error(&tiles[parent].json));
            assert!(tile.json["refine"].is_null());
        }
        let Some(uri) = tile.json["content"]["uri"].as_str() else { continue };
        *shown.entry(uri.to_owned()).or_default() += 1;
        let points: Vec<[f64; 3]> = triangles(job, tile).into_iter().flatten().collect();
        assert!(!points.is_empty() && points.iter().all(|&p| is_within(p, own)), "{uri}");
        assert_eq!(uri.starts_with("tiles/"), tile.json["children"].is_null(), "{uri}");
        assert!(uri.starts_with("levels/") || error(&tile.json) == 0.0, "{uri}");
    }
    let files = |folder: &str| files_below(&job.out().join(folder)).len();
    assert!(shown.values().all(|&count| count == 1));
    assert_eq!(shown.len(), files("tiles") + files("levels"));
}
