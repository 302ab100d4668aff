//! Wide areas follow the curve of the earth, tile by tile.

use std::collections::HashMap;

use gdt_batch::output::globe::{Globe, applied};
use gdt_batch::output::read::read_tile;
use serde_json::Value;

use crate::program::Job;
use crate::random::Random;

type Transform = [f64; 16];

/// A LAS file of `count` points within `half` metres of easting 500 km, northing 4000 km of UTM zone 33 north.
fn utm(count: usize, half: f64) -> Vec<u8> {
    let keys: [u16; 12] = [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32633];
    let mut bytes = vec![0; 227];
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(0, b"LASF");
    put(24, &[1, 2]);
    put(94, &227u16.to_le_bytes());
    put(96, &(227 + 54 + 24u32).to_le_bytes());
    put(100, &1u32.to_le_bytes());
    put(105, &20u16.to_le_bytes());
    put(107, &(count as u32).to_le_bytes());
    for axis in 0..3 {
        put(131 + 8 * axis, &0.01f64.to_le_bytes());
        put(155 + 8 * axis, &[500_000.0f64, 4_000_000.0, 0.0][axis].to_le_bytes());
    }
    let mut record = [0; 54];
    record[2..17].copy_from_slice(b"LASF_Projection");
    record[18..20].copy_from_slice(&34735u16.to_le_bytes());
    record[20..22].copy_from_slice(&24u16.to_le_bytes());
    bytes.extend(record);
    bytes.extend(keys.iter().flat_map(|key| key.to_le_bytes()));
    let mut random = Random(7);
    for _ in 0..count {
        let [x, y] = [0; 2].map(|_| ((random.unit() * 2.0 - 1.0) * half * 100.0) as i32);
        bytes.extend([x, y, random.below(50_000) as i32].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0, 0, 9, 2, 0, 0, 0, 0]);
    }
    bytes
}

fn json(job: &Job, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(job.out().join(name)).unwrap()).unwrap()
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    serde_json::from_value::<Vec<f64>>(value.clone()).ok()?.try_into().ok()
}

/// The transform that comes from doing `inner` and then `outer`.
fn product(outer: &Transform, inner: &Transform) -> Transform {
    std::array::from_fn(|i| (0..4).map(|k| outer[4 * k + i % 4] * inner[i / 4 * 4 + k]).sum())
}

fn corners(tile: &Value) -> Vec<[f64; 3]> {
    let b: [f64; 12] = numbers(&tile["boundingVolume"]["box"]).unwrap();
    (0..8).map(|i| [0, 1, 2].map(|k| b[k] + b[3 + 4 * k] * if i >> k & 1 == 0 { -1.0 } else { 1.0 })).collect()
}

/// All tiles with their transforms to the globe; the boxes of those below must lie in each of them.
fn placed<'a>(tile: &'a Value, above: Option<&Transform>, found: &mut Vec<(&'a Value, Transform)>) {
    let own: Transform = numbers(&tile["transform"]).expect("a transform");
    let volume: [f64; 12] = numbers(&tile["boundingVolume"]["box"]).unwrap();
    for child in tile["children"].as_array().into_iter().flatten() {
        let step: Transform = numbers(&child["transform"]).expect("a transform");
        for corner in corners(child) {
            let corner = applied(&step, corner);
            let is_in = (0..3).all(|k| (corner[k] - volume[k]).abs() <= volume[3 + 4 * k] + 1e-6);
            assert!(is_in, "{corner:?} not in {volume:?}");
        }
    }
    let globally = above.map_or(own, |above| product(above, &own));
    found.push((tile, globally));
    tile["children"].as_array().into_iter().flatten().for_each(|child| placed(child, Some(&globally), found));
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_wide_area_follows_the_curve_of_the_earth() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("wide.las");
    std::fs::write(&cloud, utm(40_000, 100_000.0)).unwrap();
    let job = Job::on(&[cloud]).tiles_of(500).with("output", "level_sites = 500");
    job.report();
    let (tileset, georeference) = (json(&job, "tileset.json"), json(&job, "georeference.json"));
    assert_eq!(georeference["globe"]["per_tile"], true);
    let promise = georeference["globe"]["distortion_m"].as_f64().unwrap();
    let offset: [f64; 3] = numbers(&georeference["offset"]).unwrap();
    let globe = Globe::new(georeference["globe"]["definition"].as_str().unwrap(), 1.0).unwrap();
    let mut tiles = Vec::new();
    placed(&tileset["root"], None, &mut tiles);
    let (mut off, mut gap, mut flat) = (0.0f64, 0.0f64, 0.0f64);
    let root = tiles[0].1;
    let mut places = HashMap::new();
    for (tile, transform) in tiles.iter().filter(|(tile, _)| tile["children"].is_null()) {
        let Some(uri) = tile["content"]["uri"].as_str() else { continue };
        for part in read_tile(&job.out().join(uri)).unwrap().parts {
            for v in part.triangles.iter().flatten() {
                let [x, up, z] = part.world(*v as usize);
                let belongs = globe.place(offset[0] + x, offset[1] - z, offset[2] + up).unwrap();
                let found = applied(transform, [x, -z, up]);
                off = off.max(distance(found, belongs));
                flat = flat.max(distance(applied(&root, [x, -z, up]), belongs));
                let first = *places.entry([x, up, z].map(f64::to_bits)).or_insert(found);
                gap = gap.max(distance(first, found));
            }
        }
    }
    eprintln!("promised {promise} m, off {off} m, gap {gap} m, with one transform {flat} m");
    assert!(off <= promise + 1e-3 && gap <= 2.0 * promise + 1e-3, "{off}, {gap}, {promise}");
    assert!(gap > 0.0 && flat > 1000.0 && off < flat / 20.0, "{off} of {flat}, {gap}");
}

#[test]
fn a_small_area_has_one_transform() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("small.las");
    std::fs::write(&cloud, utm(5_000, 1_000.0)).unwrap();
    let job = Job::on(&[cloud]).tiles_of(500).with("output", "level_sites = 500");
    job.report();
    let root = &json(&job, "tileset.json")["root"];
    let georeference = json(&job, "georeference.json");
    assert_eq!(numbers::<16>(&root["transform"]), numbers(&georeference["globe"]["transform"]));
    assert!(!root["children"].as_array().unwrap().is_empty());
    assert_eq!(root["children"].to_string().matches("\"transform\"").count(), 0);
    assert_eq!(georeference["globe"]["per_tile"], false);
}
