//! Tests of `terrain.glb`, the scene of all tiles.

use tiles::Compression;
use tiles::gltf::one_file::write_terrain;
use tiles::gltf::read::read_tile;

use crate::model::{attributed, cloud, cut_by_place, terrain, utm, write_tiles, write_tiles_as};

#[test]
fn the_scene_has_the_parts_of_all_tiles() {
    let frame = utm();
    let directory = tempfile::tempdir().unwrap();
    let tiles = cut_by_place(&attributed(terrain(&frame, &cloud(21, 600, 500_000))), 3);
    write_tiles(directory.path(), &frame, &tiles);
    let paths: Vec<_> = (0..tiles.len()).map(|i| directory.path().join(format!("tiles/{i:05}.glb"))).collect();
    let out = directory.path().join("terrain.glb");
    write_terrain(&out, &paths, None).unwrap();
    let joined = read_tile(&out).unwrap();
    assert_eq!(joined.parts.len(), tiles.len());
    assert_eq!(&joined.extras, frame.extras());
    for (part, path) in joined.parts.iter().zip(&paths) {
        let tile = &read_tile(path).unwrap().parts[0];
        assert_eq!((part.translation, &part.positions), (tile.translation, &tile.positions));
        assert_eq!((&part.normals, &part.colors, &part.triangles), (&tile.normals, &tile.colors, &tile.triangles));
        assert!(part.attributes == tile.attributes && part.attributes.intensity.is_some());
    }
    let names: Vec<_> = std::fs::read_dir(directory.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 2, "nothing but tiles and terrain.glb: {names:?}");
}

#[test]
fn packed_tiles_are_unpacked_in_the_scene() {
    let (frame, directory) = (utm(), tempfile::tempdir().unwrap());
    let tiles = cut_by_place(&attributed(terrain(&frame, &cloud(22, 2_000, 20_000))), 2);
    write_tiles_as(Compression::Meshopt, directory.path(), &frame, &tiles);
    let paths: Vec<_> = (0..tiles.len()).map(|i| directory.path().join(format!("tiles/{i:05}.glb"))).collect();
    let out = directory.path().join("terrain.glb");
    write_terrain(&out, &paths, None).unwrap();
    let bytes = std::fs::read(&out).unwrap();
    let json = String::from_utf8_lossy(&bytes[..20_000]);
    assert!(json.contains("KHR_mesh_quantization") && !json.contains("EXT_meshopt_compression"));
    let joined = read_tile(&out).unwrap();
    for (part, path) in joined.parts.iter().zip(&paths) {
        let tile = &read_tile(path).unwrap().parts[0];
        assert_eq!((part.translation, part.scale, &part.positions), (tile.translation, tile.scale, &tile.positions));
        assert_eq!((&part.normals, &part.colors, &part.triangles), (&tile.normals, &tile.colors, &tile.triangles));
        assert!(part.attributes == tile.attributes && part.attributes.intensity.is_some());
    }
}

#[test]
fn a_damaged_tile_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bad.glb");
    std::fs::write(&path, b"glTF but not really one").unwrap();
    let error = write_terrain(&directory.path().join("terrain.glb"), &[path], None).unwrap_err();
    assert!(error.to_string().contains("bad.glb"), "{error}");
    assert!(!directory.path().join("terrain.glb").exists());
}
