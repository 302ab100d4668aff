//! EPT made in memory: the nodes of an octree as files, with an index.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use crate::copc_file::CopcFile;
use crate::las_file::LasFile;

/// The offsets of coordinates, which are hundredths.
const OFFSETS: [f64; 3] = [500_000.0, 4_000_000.0, 0.0];

/// Nodes from this level on are on pages of their own.
const SECOND_PAGE: i32 = 2;

/// How nodes hold their points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeType {
    Laszip,
    Binary,
    Zstandard,
}

impl NodeType {
    pub(crate) const ALL: [NodeType; 3] = [NodeType::Laszip, NodeType::Binary, NodeType::Zstandard];
}

/// The files of a data set, by their names from its folder.
#[derive(Clone)]
pub(crate) struct EptFiles(pub(crate) BTreeMap<String, Vec<u8>>);

impl EptFiles {
    /// Makes the data set of a cloud, whose points have format 7.
    pub(crate) fn of(cloud: &CopcFile, kind: NodeType) -> EptFiles {
        let mut files = BTreeMap::new();
        let mut pages = BTreeMap::<String, Map<String, Value>>::new();
        for (key @ [level, place @ ..], records) in &cloud.nodes {
            let name = name(*key);
            let (ending, bytes) = match kind {
                NodeType::Laszip => {
                    let node = LasFile { records: records.concat(), ..cloud.file.clone() };
                    ("laz", node.laz(&[50_000], false))
                }
                NodeType::Binary => ("bin", records.iter().flat_map(|record| binary(record)).collect()),
                NodeType::Zstandard => {
                    let binary: Vec<u8> = records.iter().flat_map(|record| binary(record)).collect();
                    let level = ruzstd::encoding::CompressionLevel::Fastest;
                    ("zst", ruzstd::encoding::compress_to_vec(&binary[..], level))
                }
            };
            files.insert(format!("ept-data/{name}.{ending}"), bytes);
            let root = "0-0-0-0".to_string();
            if *level < SECOND_PAGE {
                pages.entry(root).or_default().insert(name, records.len().into());
            } else {
                let down = level - SECOND_PAGE;
                let [x, y, z] = place.map(|number| number >> down);
                let page = format!("{SECOND_PAGE}-{x}-{y}-{z}");
                pages.entry(root).or_default().insert(page.clone(), (-1).into());
                // A page begins with its own node, though that may have no points.
                let entries = pages.entry(page.clone()).or_default();
                entries.entry(page).or_insert(0.into());
                entries.insert(name, records.len().into());
            }
        }
        for (root, page) in pages {
            files.insert(format!("ept-hierarchy/{root}.json"), Value::Object(page).to_string().into_bytes());
        }
        files.insert("ept.json".into(), index(cloud, kind).to_string().into_bytes());
        EptFiles(files)
    }

    /// Writes the files to a folder, and returns the path of the index.
    pub(crate) fn write(&self, folder: &Path) -> PathBuf {
        for (name, bytes) in &self.0 {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        folder.join("ept.json")
    }

    /// Changes a file.
    pub(crate) fn edit(&mut self, name: &str, edit: impl FnOnce(&mut Vec<u8>)) {
        edit(self.0.get_mut(name).unwrap_or_else(|| panic!("no {name}")));
    }
}

/// Returns the points of a cloud as one LAZ file, in the order of the nodes, whose header has their box.
pub(crate) fn one_file(cloud: &CopcFile) -> Vec<u8> {
    let records = cloud.nodes.values().flatten().flatten().copied().collect();
    let mut bytes = LasFile { records, ..cloud.file.clone() }.laz(&[1000], false);
    let [min, max] = bounds(cloud);
    for axis in 0..3 {
        for (at, value) in [(179, max[axis]), (187, min[axis])] {
            bytes[at + 16 * axis..at + 16 * axis + 8].copy_from_slice(&value.to_le_bytes());
        }
    }
    bytes
}

fn name([level, x, y, z]: [i32; 4]) -> String {
    format!("{level}-{x}-{y}-{z}")
}

fn index(cloud: &CopcFile, kind: NodeType) -> Value {
    let axis = |name: &str, axis: usize| json!({"name": name, "type": "signed", "size": 4, "scale": 0.01, "offset": OFFSETS[axis]});
    let unsigned = |name: &str, size: usize| json!({"name": name, "type": "unsigned", "size": size});
    let half = f64::from(cloud.half) / 100.0;
    let cube = [OFFSETS.map(|middle| middle - half), OFFSETS.map(|middle| middle + half)].concat();
    let conforming = bounds(cloud).concat();
    let data_type = match kind {
        NodeType::Laszip => "laszip",
        NodeType::Binary => "binary",
        NodeType::Zstandard => "zstandard",
    };
    let points: usize = cloud.nodes.values().map(Vec::len).sum();
    json!({
        "bounds": cube,
        "boundsConforming": conforming,
        "dataType": data_type,
        "hierarchyType": "json",
        "points": points,
        "schema": [
            axis("X", 0), axis("Y", 1), axis("Z", 2), unsigned("Intensity", 2), unsigned("ReturnNumber", 1),
            unsigned("NumberOfReturns", 1), unsigned("ClassFlags", 1), unsigned("Classification", 1),
            unsigned("Red", 2), unsigned("Green", 2), unsigned("Blue", 2)
        ],
        "span": 128,
        "srs": {},
        "version": "1.0.0"
    })
}

/// Returns a record of format 7 as the schema has it.
fn binary(record: &[u8]) -> Vec<u8> {
    let (returns, flags) = (record[14], record[15]);
    [&record[..14], &[returns & 15, returns >> 4, flags & 15, record[16]], &record[30..36]].concat()
}

/// Returns the box of the points.
fn bounds(cloud: &CopcFile) -> [[f64; 3]; 2] {
    let raw = |axis: usize| {
        let records = cloud.nodes.values().flatten();
        records.map(move |record| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap()))
    };
    let value = |axis: usize, raw: i32| OFFSETS[axis] + f64::from(raw) * 0.01;
    [
        [0, 1, 2].map(|axis| value(axis, raw(axis).min().unwrap())),
        [0, 1, 2].map(|axis| value(axis, raw(axis).max().unwrap())),
    ]
}
