//! Tiles of made terrains: whether they meet, come back from their bytes, and have water where lakes are.

mod bytes;
mod meeting;
mod water;

use crate::mesh::{LAST, corner_place, double_area};
use crate::*;
use delaunay::triangulation::canonical;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// A terrain on the tiles of zoom 12 around a corner that four of them share.
struct Terrain {
    points: Vec<GridPoint>,
    triangles: Vec<[u32; 3]>,
}

const SCHEME: Scheme = Scheme::Geographic;
const ZOOM: u8 = 12;
const CORNER: [i32; 2] = [4000, 3000];

fn random(seed: u64) -> impl FnMut(i64) -> i64 {
    let mut state = seed;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as i64).rem_euclid(below)
    }
}

/// Points on a grid of `cell` steps or anywhere, out to `reach` steps from the corner.
fn terrain(seed: u64, count: usize, reach: i64, cell: i64) -> Terrain {
    terrain_with_pairs(seed, count, reach, cell, 0)
}

/// The same. So many of eight points have another one beside them.
fn terrain_with_pairs(seed: u64, count: usize, reach: i64, cell: i64, pairs: i64) -> Terrain {
    let mut next = random(seed);
    let mut places = BTreeMap::new();
    let mut add = |x: i64, y: i64, z: i64| places.insert([x / cell * cell, y / cell * cell], z as i32);
    for corner in [[-reach, -reach], [reach, -reach], [-reach, reach], [reach, reach]] {
        add(corner[0], corner[1], 7);
    }
    for _ in 0..count {
        let place = [next(2 * reach) - reach, next(2 * reach) - reach];
        add(place[0], place[1], next(200_000));
        // Some come in pairs.
        if next(8) < pairs {
            let beside = |along: i64, off: i64| (along + off).clamp(-reach, reach);
            add(beside(place[0], next(7) - 3), beside(place[1], next(7) - 3), next(200_000));
        }
    }
    let points: Vec<GridPoint> = places
        .iter()
        .map(|([x, y], z)| GridPoint { x: x + i64::from(CORNER[0]) * SPAN, y: y + i64::from(CORNER[1]) * SPAN, z: *z })
        .collect();
    let sites: Vec<[i32; 2]> = places.keys().map(|place| place.map(|along| along as i32)).collect();
    Terrain { points, triangles: canonical(&sites).unwrap().corners().to_vec() }
}

/// Cuts a terrain in so many shares, and assembles the tiles.
fn tiles(terrain: &Terrain, shares: usize) -> BTreeMap<[i32; 2], TileMesh> {
    let mut pieces: BTreeMap<[i32; 2], Vec<Piece>> = BTreeMap::new();
    for share in 0..shares {
        // As other tiles of a job would have them: their own vertices, and triangles in another order.
        let own = terrain.triangles.iter().skip(share).step_by(shares).rev().copied();
        let triangles: Vec<[u32; 3]> = own.map(|[a, b, c]| [b, c, a]).collect();
        for (tile, piece) in cut(&terrain.points, &triangles) {
            pieces.entry(tile).or_default().insert(0, piece);
        }
    }
    pieces.into_iter().filter_map(|(tile, pieces)| Some((tile, assemble(pieces)?))).collect()
}

/// Checks that a mesh covers its tile once, or more where rounding has turned triangles over, and ends at its sides alone.
fn check_whole(mesh: &TileMesh) {
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for triangle in &mesh.triangles {
        assert!(double_area(triangle.map(|v| mesh.nodes[v as usize])) > 0);
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    for ([a, b], count) in edges {
        let [a, b] = [a, b].map(|v| mesh.nodes[v as usize]);
        let is_side = |a: u16, b: u16| a == b && (a == 0 || a == LAST);
        let on_side = is_side(a.u, b.u) || is_side(a.v, b.v);
        assert_eq!(count != 0, on_side, "{a:?} {b:?} {count}");
    }
    for corner in 0..4 {
        let [u, v] = corner_place(corner);
        assert_eq!(mesh.nodes.iter().filter(|node| [node.u, node.v] == [u, v]).count(), 1);
    }
    let sorted = mesh.nodes.windows(2).all(|pair| pair[0].order() < pair[1].order());
    assert!(sorted && mesh.triangles.windows(2).all(|pair| pair[0] < pair[1]));
}

/// The vertices of a side: steps along it, and heights.
fn side(mesh: &TileMesh, side: usize) -> Vec<[i32; 2]> {
    let end = if side.is_multiple_of(2) { 0 } else { LAST };
    let along = |node: &Node| match side < 2 {
        true => (node.u == end).then_some([i32::from(node.v), node.h]),
        false => (node.v == end).then_some([i32::from(node.u), node.h]),
    };
    let mut along: Vec<[i32; 2]> = mesh.nodes.iter().filter_map(along).collect();
    along.sort_unstable();
    along
}

fn check_meeting(meshes: &BTreeMap<[i32; 2], TileMesh>) {
    for ([x, y], mesh) in meshes {
        if let Some(east) = meshes.get(&[x + 1, *y]) {
            assert_eq!(side(mesh, 1), side(east, 0));
        }
        if let Some(north) = meshes.get(&[*x, y + 1]) {
            assert_eq!(side(mesh, 3), side(north, 2));
        }
    }
}

/// Returns the height of a mesh over a place, of the highest triangle there.
fn height_over(mesh: &TileMesh, [u, v]: [f64; 2]) -> Option<f64> {
    let over = |triangle: &[u32; 3]| {
        let corners = triangle.map(|v| mesh.nodes[v as usize]);
        let [a, b, c] = corners.map(|node| [f64::from(node.u), f64::from(node.v)]);
        let area =
            |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let parts = [area(b, c, [u, v]), area(c, a, [u, v]), area(a, b, [u, v])];
        let whole = area(a, b, c);
        let height = (0..3).map(|k| parts[k] * f64::from(corners[k].height(0))).sum::<f64>() / whole;
        parts.iter().all(|part| *part >= 0.0).then_some(height)
    };
    mesh.triangles.iter().filter_map(over).reduce(f64::max)
}

/// Returns where a vertex of a tile lies in the tile above, by its longitude and latitude.
fn in_parent(tile: Tile, steps: [u16; 2]) -> [f64; 2] {
    let parent = tile.parent();
    [0, 1].map(|axis: usize| {
        let place = tile.south_west()[axis] + tile.sides()[axis] * f64::from(steps[axis]) / f64::from(LAST);
        (place - parent.south_west()[axis]) / parent.sides()[axis] * f64::from(LAST)
    })
}

/// Returns the tiles of the zoom before.
fn coarser_tiles(finer: BTreeMap<[i32; 2], TileMesh>, scheme: Scheme, zoom: u8) -> BTreeMap<[i32; 2], TileMesh> {
    let mut children: BTreeMap<[i32; 2], Vec<Child>> = BTreeMap::new();
    for ([x, y], mesh) in finer {
        let child = Child { quadrant: [(x & 1) as u8, (y & 1) as u8], nodes: mesh.nodes };
        children.entry([x >> 1, y >> 1]).or_default().push(child);
    }
    let make = |([x, y], children): ([i32; 2], Vec<Child>)| {
        ([x, y], coarser(Tile { scheme, zoom, x, y }, &children, 0).unwrap().0)
    };
    children.into_iter().map(make).collect()
}

#[test]
fn a_tile_beside_the_terrain_follows_the_curve_of_the_earth() {
    check_whole(&TileMesh::surroundings());
    for scheme in [Scheme::Geographic, Scheme::WebMercator] {
        let mesh = flat(Tile { scheme, zoom: 0, x: 0, y: 0 }).unwrap();
        check_whole(&mesh);
        assert_eq!(mesh.nodes.len(), 33 * 33);
        assert!(mesh.nodes.iter().all(|node| node.h == OUTSIDE));
    }
}

/// Far from the terrain, both halves of the globe have the same vertices between them, close enough for its curve.
#[test]
fn the_halves_of_the_globe_meet() {
    let leaf = Child { quadrant: [1, 1], nodes: tiles(&terrain(3, 40, 9_000, 1), 1).pop_first().unwrap().1.nodes };
    let (east, _) = coarser(Tile { scheme: SCHEME, zoom: 0, x: 1, y: 0 }, &[leaf], 0).unwrap();
    check_whole(&east);
    let west = flat(Tile { scheme: SCHEME, zoom: 0, x: 0, y: 0 }).unwrap();
    assert_eq!(side(&east, 0), side(&west, 1));
    assert!(side(&west, 1).len() == 33);
}

#[test]
fn the_list_names_each_tile_once() {
    let mut next = random(3);
    let tiles: Vec<Tile> =
        (0..200).map(|_| Tile { scheme: SCHEME, zoom: 5, x: next(20) as i32 - 10, y: next(12) as i32 }).collect();
    let about = LayerAbout { scheme: SCHEME, has_water: false, bounds: [0.0; 4], attribution: Some("(c) Example") };
    let text = layer(&[ZoomTiles::new(&tiles)], &about);
    let list: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(list["attribution"], "(c) Example");
    let mut found = Vec::new();
    for rectangle in list["available"][0].as_array().unwrap() {
        let number = |key: &str| rectangle[key].as_i64().unwrap() as i32;
        for y in number("startY")..=number("endY") {
            found.extend((number("startX")..=number("endX")).map(|x| [y, x]));
        }
    }
    let expected: BTreeSet<[i32; 2]> = tiles.iter().map(|tile| [tile.y, tile.column()]).collect();
    assert_eq!(found.len(), expected.len());
    assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), expected);
}

#[test]
fn the_finest_zoom_follows_the_density() {
    // Four points a square metre: tiles of 76 m have 23,000 of them, those of 38 m 6,000.
    assert_eq!(finest_zoom(SCHEME, 1e6, 4_000_000, 0.0), 19);
    assert_eq!(finest_zoom(SCHEME, 1e6, 2_000_000, 0.0), 18);
    assert_eq!(finest_zoom(SCHEME, 1e6, 2_000_000, 1.2), 18);
    assert_eq!(finest_zoom(SCHEME, 0.0, 0, 0.0), 20);
    assert_eq!(finest_zoom(SCHEME, 1e12, 3, 0.0), 10);
    // Tiles of web mercator are as wide one zoom later, and far from the equator they are lower.
    assert_eq!([0.0, 1.2].map(|latitude| finest_zoom(Scheme::WebMercator, 1e6, 2_000_000, latitude)), [19, 18]);
    assert_eq!([(0.0, 0), (1e12, 3)].map(|(area, count)| finest_zoom(Scheme::WebMercator, area, count, 0.0)), [21, 11]);
}

/// Within a row, steps are linear in latitude, so that both tiles beside a border have the same vertices there.
#[test]
fn rows_of_web_mercator_are_linear_in_latitude() {
    for zoom in [0, 1, 11, 18, 21] {
        let mut grid = TileGrid::new(Scheme::WebMercator, zoom);
        let rows = 1i32 << zoom;
        for row in [0, rows / 3, rows / 2, rows - 1] {
            let [south, north] = [row, row + 1].map(|row| Scheme::WebMercator.latitude(zoom, row));
            // Radians of latitude are doubles, a step of which is 1e-16.
            let least = (2e-16 / (north - south) * SPAN as f64).max(1e-6);
            for part in 0..64 {
                let latitude = south + (north - south) * f64::from(part) / 64.0;
                let exact = f64::from(row) * SPAN as f64 + f64::from(part) * SPAN as f64 / 64.0;
                let found = grid.nearest([0.0, latitude], 0.0).unwrap();
                assert!((found.y as f64 - exact).abs() <= 0.5 + least, "{zoom} {row} {part}");
                assert_eq!(found.x, ((SPAN << zoom) + 1) / 2);
            }
            let on_border = grid.nearest([0.0, north], 0.0).unwrap();
            assert_eq!(on_border.y, i64::from(row + 1) * SPAN);
        }
    }
}

/// In web mercator an edge across rows is straight in each of them, with a kink at their border. That is a fifth of a step at most for an edge
/// as long as vertices are apart on average, and 26 steps for one as long as a tile of the coarsest zoom that has all triangles.
#[test]
fn edges_across_rows_are_nearly_straight() {
    let mut most = [0.0f64; 2];
    for zoom in 11..=21 {
        let rows = 1i32 << zoom;
        for row in (1..rows).step_by((rows / 64) as usize) {
            let [low, middle, high] = [row - 1, row, row + 1].map(|row| Scheme::WebMercator.latitude(zoom, row));
            // An edge from below the border to above it, half a length on each side in steps; its middle in latitude.
            for (k, length) in [1.0 / 128.0, 1.0].into_iter().enumerate() {
                let [south, north] = [middle - (middle - low) * length / 2.0, middle + (high - middle) * length / 2.0];
                // Along the edge, at the border: half the steps, and this share of the latitudes.
                let share = (middle - south) / (north - south);
                most[k] = most[k].max((share - 0.5).abs() * length * SPAN as f64);
            }
        }
    }
    assert!(most[0] < 0.2 && most[1] < 26.0, "{most:?}");
}

/// A terrain across the 180th meridian lies in both halves of the one tile of zoom 0.
#[test]
fn the_tile_around_the_globe_is_one() {
    let tile = |zoom: u8, x: i32| Tile { scheme: Scheme::WebMercator, zoom, x, y: 0 };
    assert_eq!([1, 2, -1].map(|x| tile(1, x).parent()), [tile(0, 0); 3]);
    assert_eq!([1, 2, -1].map(|x| tile(1, x).column()), [1, 0, 1]);
    assert_eq!(tile(0, 0).beside([1, 0]), tile(0, 0));
    assert_eq!(tile(2, 3).beside([1, 0]), tile(2, 4));
}
