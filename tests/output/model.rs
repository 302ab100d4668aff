//! Small exact triangulations, and ways to cut them into tiles.

use std::collections::HashMap;
use std::path::Path;

use delaunay::geometry::Bounds;
use delaunay::geometry::predicates::{in_circle, orient2d};
use lattice::{Lattice, shortest_decimal};
use spade::{DelaunayTriangulation, Point2, Triangulation};
use tiles::attributes::PointAttributes;
use tiles::frame::Frame;
use tiles::gltf::glb::GlbEncoder;
use tiles::normals::NormalSums;
use tiles::{Compression, Tile};

use crate::random::Random;

/// Returns the lattice with these numbers, read as decimals.
pub(crate) fn lattice(offset: [f64; 3], resolution: f64, resolution_z: f64) -> Lattice {
    let decimal = |v: f64| shortest_decimal(v).unwrap();
    Lattice { offset: offset.map(decimal), resolution: decimal(resolution), resolution_z: decimal(resolution_z) }
}

/// Returns the frame of a job in metres at UTM coordinates, with steps of a centimetre.
pub(crate) fn utm() -> Frame {
    Frame::new(&lattice([273357.14, 5274357.14, 788.99], 0.01, 0.01), 1.0, 1.0, Some("LOCAL_CS[\"x\"]".into())).unwrap()
}

/// Returns random points, distinct in x and y, within `extent` lattice steps of zero.
pub(crate) fn cloud(seed: u64, count: usize, extent: u64) -> Vec<[i32; 3]> {
    let mut random = Random(seed);
    let mut coordinate = |limit: u64| random.below(2 * limit + 1) as i64 as i32 - limit as i32;
    let mut points: Vec<[i32; 3]> =
        (0..count).map(|_| [coordinate(extent), coordinate(extent), coordinate(extent / 8)]).collect();
    points.sort_unstable();
    points.dedup_by_key(|p| [p[0], p[1]]);
    points
}

/// Returns the points of a regular grid, in which every cell is a tie.
pub(crate) fn grid(columns: i32, rows: i32, step: i32) -> Vec<[i32; 3]> {
    (0..columns * rows)
        .map(|i| (i % columns, i / columns))
        .map(|(x, y)| [x * step, y * step, (x * y) % 7 * 3])
        .collect()
}

/// Returns the canonical Delaunay triangulation: that of spade, with edges flipped until none is wrong.
pub(crate) fn triangulate(points: &[[i32; 3]]) -> Vec<[u32; 3]> {
    let mut delaunay = DelaunayTriangulation::<Point2<f64>>::new();
    for p in points {
        delaunay.insert(Point2::new(p[0] as f64, p[1] as f64)).unwrap();
    }
    let corners = |face: spade::handles::FaceHandle<'_, _, Point2<f64>, (), (), ()>| {
        face.vertices().map(|v| v.fix().index() as u32)
    };
    let mut triangles: Vec<[u32; 3]> = delaunay.inner_faces().map(corners).collect();
    while flip_once(points, &mut triangles) {}
    triangles
}

/// Flips wrong edges that share no triangle, and tells whether there were any.
fn flip_once(points: &[[i32; 3]], triangles: &mut [[u32; 3]]) -> bool {
    let site = |v: u32| [points[v as usize][0], points[v as usize][1]];
    let edges = edges(triangles);
    let mut touched = vec![false; triangles.len()];
    let mut any = false;
    for (&(u, v), &(t, apex)) in &edges {
        let Some(&(s, opposite)) = edges.get(&(v, u)) else { continue };
        if !touched[t] && !touched[s] && in_circle(site(u), site(v), site(apex), site(opposite)) {
            (triangles[t], triangles[s]) = ([apex, u, opposite], [opposite, v, apex]);
            (touched[t], touched[s], any) = (true, true, true);
        }
    }
    any
}

/// Returns the directed edges with their triangle and its third corner.
pub(crate) fn edges(triangles: &[[u32; 3]]) -> HashMap<(u32, u32), (usize, u32)> {
    let of = |(t, &[a, b, c]): (usize, &[u32; 3])| [((a, b), (t, c)), ((b, c), (t, a)), ((c, a), (t, b))];
    triangles.iter().enumerate().flat_map(of).collect()
}

/// Returns the triangulation of `points` with normals and colours.
pub(crate) fn terrain(frame: &Frame, points: &[[i32; 3]]) -> Tile {
    let triangles = triangulate(points);
    assert!(triangles.iter().all(|t| {
        let [a, b, c] = t.map(|v| [points[v as usize][0], points[v as usize][1]]);
        orient2d(a, b, c) > 0
    }));
    let color = |p: &[i32; 3]| [p[0] as u16, p[1] as u16, p[2] as u16];
    Tile {
        positions: points.to_vec(),
        normals: Some(NormalSums::new(points, &triangles).unit_normals(frame)),
        colors: Some(points.iter().map(color).collect()),
        attributes: PointAttributes::default(),
        triangles,
    }
}

/// Returns the mesh with a class and an intensity for every vertex, different for neighbours.
pub(crate) fn attributed(mesh: Tile) -> Tile {
    let attributes = PointAttributes {
        classification: Some(mesh.positions.iter().map(|p| (p[0] ^ p[1]) as u8).collect()),
        intensity: Some(mesh.positions.iter().map(|p| (p[0] * 7 + p[1] * 13) as u16).collect()),
    };
    Tile { attributes, ..mesh }
}

/// Cuts a mesh into tiles: triangle number `i` goes to tile `which(i)`.
pub(crate) fn cut(mesh: &Tile, tiles: usize, mut which: impl FnMut(usize) -> usize) -> Vec<Tile> {
    let PointAttributes { classification, intensity } = &mesh.attributes;
    let attributes = PointAttributes {
        classification: classification.as_ref().map(|_| vec![]),
        intensity: intensity.as_ref().map(|_| vec![]),
    };
    let mut cut = vec![Tile { normals: Some(vec![]), colors: Some(vec![]), attributes, ..Tile::default() }; tiles];
    let mut numbers = vec![HashMap::new(); tiles];
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let which = which(i);
        let tile = &mut cut[which];
        let mut number = |v: u32| {
            *numbers[which].entry(v).or_insert_with(|| {
                tile.positions.push(mesh.positions[v as usize]);
                tile.normals.as_mut().unwrap().push(mesh.normals.as_ref().unwrap()[v as usize]);
                tile.colors.as_mut().unwrap().push(mesh.colors.as_ref().unwrap()[v as usize]);
                if let (Some(all), Some(theirs)) = (&mut tile.attributes.classification, classification) {
                    all.push(theirs[v as usize]);
                }
                if let (Some(all), Some(theirs)) = (&mut tile.attributes.intensity, intensity) {
                    all.push(theirs[v as usize]);
                }
                tile.positions.len() as u32 - 1
            })
        };
        let triangle = triangle.map(&mut number);
        tile.triangles.push(triangle);
    }
    cut.retain(|tile| !tile.triangles.is_empty());
    cut
}

/// Cuts a mesh into tiles by place, `side` by `side` of them.
pub(crate) fn cut_by_place(mesh: &Tile, side: usize) -> Vec<Tile> {
    let Bounds { min: low, max: high } = mesh.bounds().unwrap();
    let cell = |v: u32, k: usize| {
        let (above, span) = (mesh.positions[v as usize][k] - low[k], high[k] - low[k] + 1);
        above as usize * side / span as usize
    };
    cut(mesh, side * side, |i| cell(mesh.triangles[i][0], 0) * side + cell(mesh.triangles[i][0], 1))
}

/// Every way to write a tile.
pub(crate) const COMPRESSIONS: [Compression; 3] = [Compression::None, Compression::Quantized, Compression::Meshopt];

/// Returns the frame that goes with a compression.
pub(crate) fn framed(frame: &Frame, compression: Compression) -> Frame {
    if compression == Compression::None { frame.clone() } else { frame.clone().packed() }
}

/// Writes the tiles as a job does, without compression.
pub(crate) fn write_tiles(directory: &Path, frame: &Frame, tiles: &[Tile]) {
    write_tiles_as(Compression::None, directory, frame, tiles);
}

/// Writes the tiles as a job does.
pub(crate) fn write_tiles_as(compression: Compression, directory: &Path, frame: &Frame, tiles: &[Tile]) {
    let folder = directory.join("tiles");
    std::fs::create_dir_all(&folder).unwrap();
    for (number, tile) in tiles.iter().enumerate() {
        let bytes = encode_tile(&framed(frame, compression), tile, compression).unwrap();
        std::fs::write(folder.join(format!("{number:05}.glb")), &bytes).unwrap();
    }
}

/// Returns the bytes of the GLB file of `tile`.
pub(crate) fn encode_tile(frame: &Frame, tile: &Tile, compression: Compression) -> sys::Result<Vec<u8>> {
    let mut glb = GlbEncoder::default();
    glb.encode(frame, tile, compression, None)?;
    Ok(glb.pieces().concat())
}
