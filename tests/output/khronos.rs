//! The Khronos validator has nothing to say about what is written.

use std::path::Path;
use std::process::Command;

use gdt_batch::output::Tile;
use gdt_batch::output::frame::Frame;
use gdt_batch::output::terrain::write_terrain;

use crate::model::{cloud, cut_by_place, grid, lattice, terrain, utm, write_tiles};

#[test]
fn the_khronos_validator_finds_nothing() {
    let npm = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/npm");
    if !npm.join("node_modules/gltf-validator").exists() {
        eprintln!("not tested: no gltf-validator; run `npm ci` in tests/npm");
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let (frame, mesh) = (utm(), terrain(&utm(), &cloud(41, 3_000, 200_000)));
    let tiles = cut_by_place(&mesh, 3);
    write_tiles(directory.path(), &frame, &tiles);
    let paths: Vec<_> = (0..tiles.len()).map(|i| directory.path().join(format!("tiles/{i:05}.glb"))).collect();
    write_terrain(&directory.path().join("terrain.glb"), &paths).unwrap();
    let bare = Tile { normals: None, colors: None, ..mesh };
    write_tiles(&directory.path().join("bare"), &frame, &[bare]);
    let points = grid(300, 300, 10);
    let triangles = (0..points.len() as u32 - 301).map(|v| [v, v + 1, v + 301]).collect();
    let long = Tile { positions: points, triangles, ..Tile::default() };
    let fine = Frame::new(&lattice([0.0; 3], 1e-6, 0.001), 1.0, 1.0, None).unwrap();
    write_tiles(&directory.path().join("parts"), &fine, &[terrain(&fine, &grid(40, 25, 1_000_000))]);
    write_tiles(&directory.path().join("long"), &frame, &[long]);
    let output = Command::new("node").arg(npm.join("validate.mjs")).arg(directory.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains(&format!("{} files", tiles.len() + 4)), "{said}");
}
