//! The Khronos validator finds nothing wrong with the files.

use tiles::frame::Frame;
use tiles::gltf::one_file::write_terrain;
use tiles::{Compression, Tile};

use crate::model::{attributed, cloud, cut_by_place, grid, lattice, terrain, utm, write_tiles, write_tiles_as};
use crate::validator::validate;

#[test]
fn the_khronos_validator_accepts_plain_tiles() {
    let directory = tempfile::tempdir().unwrap();
    let (frame, mesh) = (utm(), terrain(&utm(), &cloud(41, 3_000, 200_000)));
    let tiles = cut_by_place(&mesh, 3);
    write_tiles(directory.path(), &frame, &tiles);
    let paths: Vec<_> = (0..tiles.len()).map(|i| directory.path().join(format!("tiles/{i:05}.glb"))).collect();
    write_terrain(&directory.path().join("terrain.glb"), &paths, None).unwrap();
    let bare = Tile { normals: None, colors: None, ..mesh };
    write_tiles(&directory.path().join("bare"), &frame, &[bare]);
    let points = grid(300, 300, 10);
    let triangles = (0..points.len() as u32 - 301).map(|v| [v, v + 1, v + 301]).collect();
    let long = Tile { positions: points, triangles, ..Tile::default() };
    let fine = Frame::new(&lattice([0.0; 3], 1e-6, 0.001), 1.0, 1.0, None).unwrap();
    write_tiles(&directory.path().join("parts"), &fine, &[terrain(&fine, &grid(40, 25, 1_000_000))]);
    write_tiles(&directory.path().join("long"), &frame, &[long]);
    let of_points = cut_by_place(&attributed(terrain(&utm(), &cloud(43, 3_000, 200_000))), 2);
    write_tiles(&directory.path().join("attributes"), &frame, &of_points);
    validate(directory.path(), tiles.len() + 8);
}

#[test]
fn the_khronos_validator_accepts_packed_tiles() {
    let directory = tempfile::tempdir().unwrap();
    // Heights have finer steps than the plane, and one tile has several parts.
    let frame = Frame::new(&lattice([4e5, 6e6, 0.0], 0.01, 0.001), 1.0, 1.0, None).unwrap();
    let mesh = terrain(&frame, &cloud(42, 3_000, 20_000));
    let tiles = cut_by_place(&mesh, 3);
    for compression in [Compression::Quantized, Compression::Meshopt] {
        let folder = directory.path().join(format!("{compression:?}"));
        write_tiles_as(compression, &folder, &frame, &tiles);
        let paths: Vec<_> = (0..tiles.len()).map(|i| folder.join(format!("tiles/{i:05}.glb"))).collect();
        write_terrain(&folder.join("terrain.glb"), &paths, None).unwrap();
        let bare = Tile { normals: None, colors: None, ..mesh.clone() };
        write_tiles_as(compression, &folder.join("bare"), &frame, &[bare]);
        write_tiles_as(compression, &folder.join("attributes"), &frame, &[attributed(mesh.clone())]);
        write_tiles_as(compression, &folder.join("parts"), &frame, &[terrain(&frame, &grid(90, 90, 2_000))]);
    }
    validate(directory.path(), 2 * (tiles.len() + 4));
}
