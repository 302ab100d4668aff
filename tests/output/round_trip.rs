//! Tests that tiles read back are the tiles written.

use std::collections::HashMap;

use delaunay::geometry::Bounds;
use delaunay::mesh::triangle_order::TriangleSorter;
use proptest::prelude::*;
use sys::Error;
use tiles::attributes::PointAttributes;
use tiles::frame::Frame;
use tiles::gltf::read::{TileFile, TilePart, read_tile};
use tiles::{Compression, Tile};
use verify::SourceGrid;

use crate::model::{COMPRESSIONS, attributed, cloud, cut, encode_tile, framed, grid, lattice, terrain, utm};
use crate::random::Random;

fn written(frame: &Frame, tile: &Tile) -> Vec<u8> {
    encode_tile(frame, tile, Compression::None).unwrap()
}

fn read_bytes(bytes: &[u8]) -> sys::Result<TileFile> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    read_tile(file.path())
}

fn there_and_back(frame: &Frame, tile: &Tile) -> TileFile {
    read_bytes(&written(frame, tile)).unwrap()
}

fn there_and_back_as(compression: Compression, frame: &Frame, tile: &Tile) -> TileFile {
    let bytes = encode_tile(&framed(frame, compression), tile, compression).unwrap();
    read_bytes(&bytes).unwrap()
}

/// Returns the lattice integers of all parts, one after the other.
fn integers(file: &TileFile) -> Vec<[i32; 3]> {
    file.parts.iter().flat_map(|part| integers_of(file, part)).collect()
}

fn integers_of(file: &TileFile, part: &TilePart) -> Vec<[i32; 3]> {
    let source = SourceGrid::new(&file.extras).unwrap();
    let of = |world| match part.scale == [1.0; 3] {
        true => source.integers(world),
        false => source.integers_on(world, part.scale),
    };
    (0..part.positions.len()).map(|v| of(part.world(v)).unwrap()).collect()
}

/// Returns the triangles of all parts as the lattice integers of their corners, least corner first, sorted.
fn triangles(file: &TileFile) -> Vec<[[i32; 3]; 3]> {
    let of_part = |part: &TilePart| {
        let points = integers_of(file, part);
        part.triangles.iter().map(|t| t.map(|v| points[v as usize])).collect::<Vec<_>>()
    };
    canonical(file.parts.iter().flat_map(of_part).collect())
}

fn canonical(mut triangles: Vec<[[i32; 3]; 3]>) -> Vec<[[i32; 3]; 3]> {
    for triangle in &mut triangles {
        let least = (0..3).min_by_key(|&k| triangle[k]).unwrap();
        triangle.rotate_left(least);
    }
    triangles.sort_unstable();
    triangles
}

fn meant(tile: &Tile) -> Vec<[[i32; 3]; 3]> {
    canonical(tile.triangles.iter().map(|t| t.map(|v| tile.positions[v as usize])).collect())
}

#[test]
fn packed_tiles_hold_the_same_vertices_and_triangles() {
    let tile = attributed(terrain(&utm(), &cloud(1, 5_000, 20_000)));
    for compression in [Compression::Quantized, Compression::Meshopt] {
        let file = there_and_back_as(compression, &utm(), &tile);
        let [part] = &file.parts[..] else { panic!("{} parts", file.parts.len()) };
        assert_eq!(triangles(&file), meant(&tile));
        let (normals, colors) = (part.normals.as_ref().unwrap(), part.colors.as_ref().unwrap());
        for (v, point) in integers(&file).iter().enumerate() {
            let old = tile.positions.binary_search(point).unwrap();
            let [x, y, z] = tile.normals.as_ref().unwrap()[old];
            let cosine: f32 = [x, z, -y].iter().zip(normals.get(v)).map(|(a, b)| a * b).sum();
            assert!(cosine > 0.99, "{point:?}: {cosine}");
            let color = tile.colors.as_ref().unwrap()[old];
            assert!((0..3).all(|k| color[k].abs_diff(colors[v][k]) <= 129) && colors[v][3] == 65535);
            let look = |all: &PointAttributes, v: usize| {
                (all.classification.as_ref().unwrap()[v], all.intensity.as_ref().unwrap()[v])
            };
            assert_eq!(look(&part.attributes, v), look(&tile.attributes, old));
        }
    }
}

/// A viewer divides packed normals by the node's scale. They come out right for any ratio of the steps.
#[test]
fn packed_normals_are_true_on_any_lattice() {
    for (resolution_z, most) in [(0.0001, 1.0f64), (0.01, 1.25), (0.003, 5.0), (1.0, 1.0)] {
        let frame = Frame::new(&lattice([0.0; 3], 0.01, resolution_z), 1.0, 1.0, None).unwrap();
        let mut points = cloud(7, 2_000, 20_000);
        points.iter_mut().for_each(|p| p[2] = (p[2] as f64 * 0.01 / resolution_z) as i32);
        let tile = terrain(&frame, &points);
        for compression in [Compression::Quantized, Compression::Meshopt] {
            let file = there_and_back_as(compression, &frame, &tile);
            let part = &file.parts[0];
            for (v, point) in integers(&file).iter().enumerate() {
                let [x, y, z] = tile.normals.as_ref().unwrap()[tile.positions.binary_search(point).unwrap()];
                let seen = [0, 1, 2].map(|k| f64::from(part.normals.as_ref().unwrap().get(v)[k]) / part.scale[k]);
                let length = seen.iter().map(|v| v * v).sum::<f64>().sqrt();
                let cosine: f64 = [x, z, -y].iter().zip(seen).map(|(a, b)| f64::from(*a) * b).sum::<f64>() / length;
                let degrees = cosine.min(1.0).acos().to_degrees();
                assert!(degrees < most, "{compression:?}, z in {resolution_z}: {degrees} degrees");
            }
        }
    }
}

#[test]
fn packed_tiles_are_small() {
    let tile = terrain(&utm(), &grid(150, 150, 40));
    let size = |compression| {
        let bytes = encode_tile(&framed(&utm(), compression), &tile, compression).unwrap();
        bytes.len() / tile.positions.len()
    };
    let [none, quantized, meshopt] = COMPRESSIONS.map(size);
    assert!(none >= 43 && quantized <= 28 && meshopt <= 9, "{none}, {quantized}, {meshopt} bytes a vertex");
}

#[test]
fn tiles_wider_than_16_bits_are_in_single_precision() {
    let frame = Frame::new(&lattice([0.0; 3], 0.001, 0.001), 1.0, 1.0, None).unwrap();
    let is_short = |points: &[[i32; 3]]| {
        let tile = terrain(&frame, points);
        let files = COMPRESSIONS.map(|compression| there_and_back_as(compression, &frame, &tile));
        assert!(files.iter().all(|file| triangles(file) == meant(&tile)));
        assert!(files.iter().all(|file| file.parts.len() == 1));
        files[2].parts[0].positions.as_flattened().iter().all(|v| (0.0..=65535.0).contains(v))
    };
    // 16 bits reach 64 m. The tiles are 60 m, 120 m and 1200 m wide, and 60 m with one point 200 m away.
    assert!(is_short(&grid(61, 61, 1_000)));
    assert!(!is_short(&grid(61, 61, 2_000)));
    assert!(!is_short(&grid(61, 61, 20_000)));
    let mut far = grid(61, 61, 1_000);
    far.push([200_000, 30_000, 0]);
    assert!(!is_short(&far));
}

#[test]
fn wide_packed_tiles_are_nearly_as_small() {
    let frame = framed(&Frame::new(&lattice([0.0; 3], 0.001, 0.001), 1.0, 1.0, None).unwrap(), Compression::Meshopt);
    let size = |points: &[[i32; 3]]| {
        let tile = terrain(&frame, points);
        let bytes = encode_tile(&frame, &tile, Compression::Meshopt).unwrap();
        bytes.len() as f64 / tile.positions.len() as f64
    };
    let (narrow, wide) = (size(&cloud(5, 4_000, 60_000)), size(&cloud(5, 4_000, 480_000)));
    assert!(wide < narrow + 3.0, "{narrow} and {wide} bytes a vertex");
}

#[test]
fn a_tile_comes_back_whole() {
    let frame = utm();
    let tile = attributed(terrain(&frame, &cloud(1, 500, 30_000)));
    let file = there_and_back(&frame, &tile);
    assert_eq!(file.parts.len(), 1);
    assert_eq!(file.parts[0].attributes, tile.attributes);
    assert_eq!(integers(&file), tile.positions);
    let mut sorter = TriangleSorter::<u32>::default();
    assert_eq!(file.parts[0].triangles, sorter.ascending(tile.positions.len(), &tile.triangles));
    let normals = file.parts[0].normals.as_ref().unwrap();
    assert!(normals.iter().zip(tile.normals.as_ref().unwrap()).all(|(g, s)| g == [s[0], s[2], -s[1]]));
    let colors = file.parts[0].colors.as_ref().unwrap();
    assert!(colors.iter().zip(tile.colors.as_ref().unwrap()).all(|(g, s)| *g == [s[0], s[1], s[2], 65535]));
    assert_eq!(&file.extras, frame.extras());
}

#[test]
fn the_extras_lead_back_to_the_source() {
    let (foot, us_foot) = (0.3048, 1200.0 / 3937.0);
    let frame = Frame::new(&lattice([635577.79, 848882.15, 406.14], 0.01, 0.001), foot, us_foot, None).unwrap();
    let tile = terrain(&frame, &cloud(2, 300, 400_000));
    let file = there_and_back(&frame, &tile);
    let extras = &file.extras;
    for (v, p) in tile.positions.iter().enumerate() {
        let [x, y, z] = file.parts[0].world(v);
        let exact = [0, 1, 2].map(|k| extras.offset[k] + p[k] as f64 * if k == 2 { 0.001 } else { 0.01 });
        assert!((extras.offset[0] + x / extras.metres_per_unit - exact[0]).abs() < 0.0051);
        assert!((extras.offset[1] - z / extras.metres_per_unit - exact[1]).abs() < 0.0051);
        assert!((extras.offset[2] + y / extras.metres_per_unit_z - exact[2]).abs() < 0.00051);
    }
}

#[test]
fn the_same_tile_gives_the_same_bytes() {
    let frame = utm();
    let tile = terrain(&frame, &cloud(3, 200, 5_000));
    assert_eq!(written(&frame, &tile), written(&frame, &tile));
}

#[test]
fn short_indices_stop_before_the_restart_value() {
    let frame = utm();
    for (rows, bytes_of_corner) in [(255, 2), (256, 4)] {
        let points = grid(257, rows, 10);
        let triangles: Vec<[u32; 3]> = (0..points.len() as u32 - 258).map(|v| [v, v + 1, v + 258]).collect();
        let tile = Tile { positions: points, triangles, ..Tile::default() };
        let bytes = written(&frame, &tile);
        assert!(bytes.len() - 12 * tile.positions.len() - bytes_of_corner * 3 * tile.triangles.len() < 1500);
        assert_eq!(there_and_back(&frame, &tile).parts[0].triangles, tile.triangles);
    }
}

#[test]
fn wide_tiles_are_cut_into_parts() {
    let frame = Frame::new(&lattice([0.0; 3], 1e-6, 0.001), 1.0, 1.0, None).unwrap();
    let tile = terrain(&frame, &grid(40, 25, 1_000_000));
    let file = there_and_back(&frame, &tile);
    assert!(file.parts.len() > 4);
    assert_eq!(file.parts.iter().map(|p| p.triangles.len()).sum::<usize>(), tile.triangles.len());
    let found: std::collections::BTreeSet<_> = integers(&file).into_iter().collect();
    assert!(found.into_iter().eq(tile.positions.iter().copied().collect::<std::collections::BTreeSet<_>>()));
}

#[test]
fn a_triangle_too_long_for_gltf_is_refused_and_the_error_says_what_to_do() {
    let frame = Frame::new(&lattice([0.0; 3], 1e-6, 0.001), 1.0, 1.0, None).unwrap();
    let triangle = |length: i32| Tile {
        positions: vec![[0, 0, 0], [length, 0, 0], [0, 1000, 0]],
        triangles: vec![[0, 1, 2]],
        ..Tile::default()
    };
    let longest = (frame.longest_triangle()[0] * 1e6) as i32;
    assert_eq!(integers(&there_and_back(&frame, &triangle(longest - 1))), triangle(longest - 1).positions);
    let error = encode_tile(&frame, &triangle(longest + longest / 100), Compression::None).unwrap_err();
    assert!(matches!(error, Error::Config(_)));
    assert!(error.to_string().contains("resolution = 0.00001"), "{error}");
}

#[test]
fn a_small_job_gets_finer_steps_and_a_wide_one_does_not() {
    let frame = Frame::new(&lattice([0.0; 3], 0.01, 0.01), 1.0, 1.0, None).unwrap();
    let off =
        |frame: &Frame| (0..1000).map(|i| (frame.world([i, 0, 0])[0] - i as f64 * 0.01).abs()).fold(0.0, f64::max);
    assert!((0.0018..0.002).contains(&off(&frame)));
    assert!(off(&frame.clone().refined(Bounds { min: [0; 3], max: [100_000; 3] })) < 0.000_125);
    let wide = vec![[-6_000_000, 0, 0], [6_000_000, 0, 0], [0, 40_000, 9_000]];
    let tile = Tile { positions: wide, triangles: vec![[0, 1, 2]], ..Tile::default() };
    let refined = frame.clone().refined(tile.bounds().unwrap());
    assert_eq!(there_and_back(&refined, &tile).parts.len(), 1);
    assert_eq!(integers(&there_and_back(&refined, &tile)), tile.positions);
    assert_eq!(refined.world([12345, 0, 0]), frame.world([12345, 0, 0]));
}

#[test]
fn tiles_at_the_ends_of_the_lattice_come_back() {
    let reach = 1 << 29;
    for (resolution, unit) in [(0.001, 1.0), (0.00025, 0.3048), (1.0, 1.0), (7.0, 0.9)] {
        let frame = Frame::new(&lattice([1e5, -2e6, 0.0], resolution, resolution), unit, unit, None).unwrap();
        for corner in [[-reach, -reach, i32::MIN + 200], [reach - 200, reach - 200, i32::MAX - 200]] {
            let near = |dx, dy| [corner[0] + dx, corner[1] + dy, corner[2] + dx];
            let tile = Tile {
                positions: vec![near(0, 0), near(199, 3), near(2, 198)],
                triangles: vec![[0, 1, 2]],
                ..Tile::default()
            };
            let file = there_and_back(&frame, &tile);
            assert_eq!(integers(&file), tile.positions);
            assert!(file.parts[0].translation.iter().all(|&t| t as f32 as f64 == t), "exact as f32");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn shared_vertices_have_the_same_bits_in_every_tile(
        seed: u64, tiles in 2usize..9, extent in 50u64..2_000_000, compression in prop::sample::select(&COMPRESSIONS[..]),
        resolution in prop::sample::select(vec![0.01, 0.001, 0.00025, 1.0, 0.3]), unit in prop::sample::select(vec![1.0, 0.3048]),
    ) {
        let frame = Frame::new(&lattice([4e5, 6.1e6, 0.0], resolution, 0.01), unit, unit, None).unwrap();
        let mesh = terrain(&frame, &cloud(seed, 60, extent));
        let plain = compression == Compression::None;
        let frame = if plain && seed % 2 == 0 { frame.refined(mesh.bounds().unwrap()) } else { framed(&frame, compression) };
        let mut random = Random(seed);
        let mut worlds = HashMap::new();
        for tile in cut(&mesh, tiles, |_| random.below(tiles as u64) as usize) {
            let file = there_and_back_as(compression, &frame, &tile);
            let vertices = file.parts.iter().flat_map(|part| (0..part.positions.len()).map(|v| part.world(v)));
            for (point, world) in integers(&file).into_iter().zip(vertices) {
                let bits = world.map(f64::to_bits);
                prop_assert_eq!(*worlds.entry(point).or_insert(bits), bits);
                prop_assert_eq!(frame.world(point).map(f64::to_bits), bits);
            }
        }
        prop_assert!(worlds.keys().all(|point| mesh.positions.contains(point)));
    }

    #[test]
    fn damaged_files_give_errors(
        seed: u64, cut_at in 0usize..3000, compression in prop::sample::select(&COMPRESSIONS[..]),
    ) {
        let frame = framed(&utm(), compression);
        let bytes = encode_tile(&frame, &terrain(&frame, &cloud(5, 30, 3_000)), compression).unwrap();
        prop_assert!(read_bytes(&bytes[..cut_at % bytes.len()]).is_err());
        let mut random = Random(seed);
        let mut damaged = bytes.clone();
        for _ in 0..4 {
            let place = random.below(damaged.len() as u64) as usize;
            damaged[place] = random.below(256) as u8;
        }
        // The file may be readable still. Then its parts fit together.
        if let Ok(file) = read_bytes(&damaged) {
            for part in &file.parts {
                prop_assert!(part.triangles.as_flattened().iter().all(|&v| (v as usize) < part.positions.len()));
            }
        }
    }
}

#[test]
fn hostile_packed_files_take_no_memory() {
    let (frame, tile) = (utm().packed(), terrain(&utm(), &cloud(5, 30, 3_000)));
    let bytes = encode_tile(&frame, &tile, Compression::Meshopt).unwrap();
    let said = |from: &str, to: &str| {
        let place = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        let mut file = bytes.clone();
        file.splice(place..place + from.len(), to.bytes());
        assert_eq!(from.len(), to.len());
        read_bytes(&file).unwrap_err().to_string()
    };
    // The extension's numbers of 30 vertices, and of the corners of the triangles.
    assert!(said("\"byteStride\":8,\"count\":30", "\"byteStride\":8,\"count\":99").contains("damaged"));
    assert!(
        said("\"byteStride\":8,\"count\":30", "\"byteStride\":9,\"count\":30").contains("elements of another size")
    );
    let corners = format!("\"byteStride\":2,\"count\":{}", 3 * tile.triangles.len());
    assert!(said(&corners, &corners.replace("\"count\":1", "\"count\":9")).contains("cannot hold"));
    let wider = said(&corners, &corners.replace("\"byteStride\":2", "\"byteStride\":4"));
    assert!(wider.contains("does not hold packed indices"), "{wider}");
    let wider = said("\"byteStride\":4,\"count\":30", "\"byteStride\":8,\"count\":30");
    assert!(wider.contains("elements of another size"), "{wider}");
    assert!(said("ATTRIBUTES", "TRIANGLESS").contains("TRIANGLESS"));
    assert!(said("OCTAHEDRAL", "QUATERNION").contains("QUATERNION"));
}

#[test]
fn hostile_files_take_no_memory() {
    let frame = utm();
    let bytes = written(&frame, &terrain(&frame, &cloud(5, 30, 3_000)));
    let json_length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json = std::str::from_utf8(&bytes[20..20 + json_length]).unwrap();
    let with_json = |json: String| {
        let padded = format!("{json:width$}", width = json.len().next_multiple_of(4));
        let mut file = bytes[..8].to_vec();
        let rest = &bytes[20 + json_length..];
        file.extend(((20 + padded.len() + rest.len()) as u32).to_le_bytes());
        file.extend((padded.len() as u32).to_le_bytes());
        file.extend(*b"JSON");
        file.extend(padded.as_bytes());
        file.extend(rest);
        read_bytes(&file)
    };
    assert!(with_json(json.to_string()).is_ok());
    let message = |json: String| with_json(json).unwrap_err().to_string();
    assert!(message(json.replace("\"count\":30", "\"count\":4000000000000000000")).contains("past the end"));
    assert!(message(json.replace("\"count\":30", "\"count\":31")).contains("past the end"));
    assert!(message(json.replace("\"nodes\":[0]", "\"nodes\":[0,0,0,0,0,0,0,0]")).contains("more than once"));
    assert!(message(json.replace("\"nodes\":[0]", "\"nodes\":[9]")).contains("no node 9"));
    assert!(message(json.replace("\"translation\"", "\"rotation\"")).contains("rotation"));
}
