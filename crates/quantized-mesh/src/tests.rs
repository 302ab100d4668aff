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
    pieces.into_iter().filter_map(|(tile, pieces)| Some((tile, assemble(&pieces)?))).collect()
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn tiles_are_whole_and_meet_and_do_not_depend_on_pieces(
        seed in 0u64..1 << 40,
        count in 1usize..400,
        reach in prop::sample::select(vec![40i64, 3_000, 40_000, 70_000]),
        cell in prop::sample::select(vec![1i64, 7, SPAN / 2, SPAN]),
        shares in 1usize..5,
    ) {
        let terrain = terrain(seed, count, reach, cell.min(reach));
        let meshes = tiles(&terrain, 1);
        meshes.values().for_each(check_whole);
        check_meeting(&meshes);
        prop_assert_eq!(tiles(&terrain, shares), meshes);
    }

    /// Points that are closer than a few steps: some come together, and triangles turn over.
    #[test]
    fn rounding_leaves_no_fold(
        seed in 0u64..1 << 40,
        count in 3usize..600,
        reach in prop::sample::select(vec![60i64, 2_000, 40_000]),
        coarseness in prop::sample::select(vec![2i64, 5, 30]),
    ) {
        let mut terrain = terrain_with_pairs(seed, count, reach, 1, 2);
        for point in &mut terrain.points {
            let rounded = |along: i64, zero: i32| {
                let zero = i64::from(zero) * SPAN;
                (along - zero).div_euclid(coarseness) + zero
            };
            (point.x, point.y) = (rounded(point.x, CORNER[0]), rounded(point.y, CORNER[1]));
        }
        let meshes = tiles(&terrain, 1);
        prop_assert_eq!(tiles(&terrain, 3), meshes.clone());
        check_meeting(&meshes);
        for mesh in meshes.values() {
            let areas = mesh.triangles.iter().map(|triangle| double_area(triangle.map(|v| mesh.nodes[v as usize])));
            prop_assert_eq!(areas.sum::<i64>(), 2 * i64::from(LAST) * i64::from(LAST));
            check_whole(mesh);
        }
    }

    #[test]
    fn coarser_tiles_meet_and_keep_the_bound(
        seed in 0u64..1 << 40,
        count in 1usize..600,
        reach in 20_000i64..70_000,
        scheme in prop::sample::select(vec![Scheme::Geographic, Scheme::WebMercator]),
    ) {
        // Slopes are at most this steep, in steps of height for a step along.
        const SPACING: i64 = 4_000;
        const STEEPEST: f64 = 2.0 * 3_000_000.0 / SPACING as f64;
        let mut terrain = terrain(seed, count, reach / SPACING * SPACING, SPACING);
        terrain.points.iter_mut().for_each(|point| point.z *= 15);
        let mut finer = tiles(&terrain, 1);
        for zoom in (8..ZOOM).rev() {
            let mut children: BTreeMap<[i32; 2], Vec<Child>> = BTreeMap::new();
            for ([x, y], mesh) in &finer {
                let child = Child { quadrant: [(x & 1) as u8, (y & 1) as u8], nodes: mesh.nodes.clone() };
                children.entry([x >> 1, y >> 1]).or_default().push(child);
            }
            let make = |(place, children): (&[i32; 2], &Vec<Child>)| {
                let (mesh, bound) = coarser(Tile { scheme, zoom, x: place[0], y: place[1] }, children, 0).unwrap();
                (*place, mesh, bound)
            };
            let made: Vec<_> = children.iter().map(make).collect();
            let bound = made.iter().map(|(_, _, bound)| *bound).max().unwrap();
            let expected = LEVEL_ZERO_ERROR * f64::from(2 / scheme.columns(0));
            prop_assert!(bound as f64 <= expected * HEIGHT_STEPS / 4.0 / f64::from(1 << zoom));
            // A vertex moves by a step of the coarser zoom along each axis, at most.
            let most = bound as f64 + STEEPEST * 4.0 * f64::from(1 << (ZOOM - zoom));
            let coarse: BTreeMap<[i32; 2], TileMesh> = made.into_iter().map(|(place, mesh, _)| (place, mesh)).collect();
            for ([x, y], mesh) in &finer {
                let tile = Tile { scheme, zoom: zoom + 1, x: *x, y: *y };
                for node in &mesh.nodes {
                    let place = in_parent(tile, [node.u, node.v]);
                    let Some(found) = height_over(&coarse[&[x >> 1, y >> 1]], place) else { continue };
                    let off = (found - f64::from(node.height(0))).abs();
                    prop_assert!(off <= most, "{off} {most}");
                }
            }
            coarse.values().for_each(check_whole);
            check_meeting(&coarse);
            finer = coarse;
        }
    }

    /// Vertices that are a few steps from a corner of four tiles, and from their sides.
    #[test]
    fn coarser_tiles_meet_where_vertices_are_dense(
        seed in 0u64..1 << 40,
        count in 1usize..300,
        reach in prop::sample::select(vec![3i64, 20, 2_000, 40_000]),
        scheme in prop::sample::select(vec![Scheme::Geographic, Scheme::WebMercator]),
    ) {
        let mut finer = tiles(&terrain_with_pairs(seed, count, reach, 1, 4), 1);
        for zoom in (ZOOM - 3..ZOOM).rev() {
            let mut children: BTreeMap<[i32; 2], Vec<Child>> = BTreeMap::new();
            for ([x, y], mesh) in finer {
                let child = Child { quadrant: [(x & 1) as u8, (y & 1) as u8], nodes: mesh.nodes };
                children.entry([x >> 1, y >> 1]).or_default().push(child);
            }
            let make = |([x, y], children): ([i32; 2], Vec<Child>)| {
                ([x, y], coarser(Tile { scheme, zoom, x, y }, &children, 0).unwrap().0)
            };
            finer = children.into_iter().map(make).collect();
            finer.values().for_each(check_whole);
            check_meeting(&finer);
        }
    }

    /// A terrain that ends at borders of tiles: those beside it have its vertices there.
    #[test]
    fn tiles_that_terrain_only_touches_meet_it(
        seed in 0u64..1 << 40,
        count in 0usize..200,
        reach in prop::sample::select(vec![40i64, 3_000, SPAN / 2 + 1, SPAN]),
        ends in prop::array::uniform2(-1i64..2),
    ) {
        let mut terrain = terrain(seed, count, reach, 1);
        for point in &mut terrain.points {
            (point.x, point.y) = (point.x + ends[0] * reach, point.y + ends[1] * reach);
        }
        let mut finer = tiles(&terrain, 2);
        let has_heights = |along: Vec<[i32; 2]>| along.iter().any(|[_, height]| *height != OUTSIDE);
        for ([x, y], mesh) in &finer {
            for (number, beside) in [[x - 1, *y], [x + 1, *y], [*x, y - 1], [*x, y + 1]].iter().enumerate() {
                prop_assert!(finer.contains_key(beside) || !has_heights(side(mesh, number)), "{beside:?}");
            }
        }
        finer.values().for_each(check_whole);
        check_meeting(&finer);
        for zoom in (ZOOM - 3..ZOOM).rev() {
            let mut children: BTreeMap<[i32; 2], Vec<Child>> = BTreeMap::new();
            for ([x, y], mesh) in finer {
                let child = Child { quadrant: [(x & 1) as u8, (y & 1) as u8], nodes: mesh.nodes };
                children.entry([x >> 1, y >> 1]).or_default().push(child);
            }
            let make = |([x, y], children): ([i32; 2], Vec<Child>)| {
                ([x, y], coarser(Tile { scheme: SCHEME, zoom, x, y }, &children, 0).unwrap().0)
            };
            finer = children.into_iter().map(make).collect();
            check_meeting(&finer);
        }
    }

    /// At any altitude, and whatever the range of each tile.
    #[test]
    fn heights_on_borders_are_those_of_neighbours(
        seed in 0u64..1 << 40,
        count in 1usize..100,
        altitude in -40_000_000i32..40_000_000,
        range in 1i64..1 << 17,
        peak in 0i32..20_000_000,
    ) {
        let mut terrain = terrain(seed, count, 50_000, 1);
        terrain.points.iter_mut().for_each(|point| point.z = (i64::from(point.z) * range / 200_000) as i32 + altitude);
        terrain.points[0].z += peak;
        let meshes = tiles(&terrain, 1);
        let heights = meshes.values().flat_map(|mesh| mesh.nodes.iter().map(|node| i64::from(node.height(altitude))));
        let (low, high) = heights.fold((i64::MAX, i64::MIN), |(low, high), h| (low.min(h), high.max(h)));
        let steps = HeightSteps::over(high.abs_diff(low), low.unsigned_abs().max(high.unsigned_abs()));
        let mut found: BTreeMap<[i64; 2], f64> = BTreeMap::new();
        for ([x, y], mesh) in &meshes {
            let tile = Tile { scheme: SCHEME, zoom: ZOOM, x: *x, y: *y };
            let surface = Surface { tile, mesh, outside: altitude, around: &[], water: None };
            let decoded = decode(&encode(&surface, steps)).unwrap();
            for (i, [u, v, _]) in decoded.vertices.iter().enumerate() {
                let along = |tile: i32, steps: u16| i64::from(tile) * SPAN + i64::from(steps);
                let place = [along(*x, *u), along(*y, *v)];
                let known = *found.entry(place).or_insert(decoded.height(i));
                prop_assert_eq!(known, decoded.height(i));
            }
        }
    }

    #[test]
    fn tiles_come_back_from_their_bytes(seed in 0u64..1 << 40, count in 1usize..300, range in 1i64..1 << 20) {
        let mut terrain = terrain(seed, count, 50_000, 1);
        terrain.points.iter_mut().for_each(|point| point.z = (i64::from(point.z) * range / 200_000) as i32 - 5_000);
        let steps = HeightSteps::over(2 * range as u64 + 20_000, 2 * range as u64 + 20_000);
        for ([x, y], mesh) in tiles(&terrain, 1) {
            let surface = Surface { tile: Tile { scheme: SCHEME, zoom: ZOOM, x, y }, mesh: &mesh, outside: 3, around: &[], water: None };
            let bytes = encode(&surface, steps);
            let tile = decode(&bytes).unwrap();
            prop_assert_eq!(tile.vertices.len(), mesh.nodes.len());
            prop_assert_eq!(tile.normals.len(), mesh.nodes.len());
            prop_assert_eq!(tile.fault(), None);
            let heights: BTreeMap<[u16; 2], i32> = mesh.nodes.iter().map(|node| ([node.u, node.v], node.height(3))).collect();
            for (i, [u, v, _]) in tile.vertices.iter().enumerate() {
                let off = tile.height(i) - f64::from(heights[&[*u, *v]]) / HEIGHT_STEPS;
                prop_assert!(off.abs() <= steps.metres() / 2.0, "{off} {steps:?}");
            }
            let corners = |triangle: &[u32; 3]| {
                let mut corners = triangle.map(|v| tile.vertices[v as usize]);
                corners.sort_unstable();
                corners.map(|[u, v, _]| [u, v])
            };
            let found: BTreeSet<_> = tile.triangles.iter().map(corners).collect();
            let expected: BTreeSet<_> = mesh.triangles.iter().map(|triangle| {
                let mut corners = triangle.map(|v| [mesh.nodes[v as usize].u, mesh.nodes[v as usize].v]);
                corners.sort_unstable();
                corners
            }).collect();
            prop_assert_eq!(found, expected);
            for (k, of_side) in tile.sides.iter().enumerate() {
                let order = [0, 2, 1, 3][k];
                prop_assert_eq!(of_side.len(), side(&mesh, order).len());
            }
            // No prefix of a tile is one, and none ends in a panic.
            for end in (0..bytes.len()).step_by(bytes.len() / 50 + 1) {
                let _ = decode(&bytes[..end]);
            }
        }
    }

    #[test]
    fn broken_tiles_are_refused(seed in 0u64..1 << 40, changes in 1usize..20) {
        let terrain = terrain(seed, 30, 50_000, 1);
        let (place, mesh) = tiles(&terrain, 1).pop_first().unwrap();
        let surface = Surface { tile: Tile { scheme: SCHEME, zoom: ZOOM, x: place[0], y: place[1] }, mesh: &mesh, outside: 0, around: &[], water: None };
        let mut bytes = encode(&surface, HeightSteps::over(300_000, 300_000));
        let mut next = random(seed);
        for _ in 0..changes {
            let at = 88 + next(bytes.len() as i64 - 88) as usize;
            bytes[at] = next(256) as u8;
        }
        if let Ok(tile) = decode(&bytes) {
            let count = tile.vertices.len() as u32;
            prop_assert!(tile.triangles.iter().flatten().chain(tile.sides.iter().flatten()).all(|v| *v < count));
        }
    }
}

#[test]
fn faults_of_a_mesh_are_found() {
    let (place, mesh) = tiles(&terrain(8, 60, 50_000, 1), 1).pop_first().unwrap();
    let surface = Surface {
        tile: Tile { scheme: SCHEME, zoom: ZOOM, x: place[0], y: place[1] },
        mesh: &mesh,
        outside: 0,
        around: &[],
        water: None,
    };
    let tile = decode(&encode(&surface, HeightSteps::over(300_000, 300_000))).unwrap();
    let faults = [
        |tile: &mut DecodedTile| tile.triangles[0].swap(0, 1),
        |tile: &mut DecodedTile| tile.triangles.truncate(tile.triangles.len() - 1),
        |tile: &mut DecodedTile| tile.sides[1].truncate(1),
        |tile: &mut DecodedTile| tile.sides[2].reverse(),
        |tile: &mut DecodedTile| tile.sides.swap(0, 2),
    ];
    assert_eq!(tile.fault(), None);
    for (number, make) in faults.iter().enumerate() {
        let mut broken = tile.clone();
        make(&mut broken);
        assert!(broken.fault().is_some(), "{number}");
    }
}

#[test]
fn all_that_the_finest_tiles_have_is_on_the_triangulation() {
    let terrain = terrain(5, 500, 60_000, 1);
    let meshes = tiles(&terrain, 1);
    for triangle in &terrain.triangles {
        let corners = triangle.map(|v| terrain.points[v as usize]);
        let mean = |of: fn(&GridPoint) -> i64| corners.iter().map(|corner| of(corner) as f64).sum::<f64>() / 3.0;
        let [x, y, z] = [mean(|p| p.x), mean(|p| p.y), mean(|p| p.z.into())];
        let tile = [x, y].map(|along| (along / SPAN as f64).floor());
        let place = [x - tile[0] * SPAN as f64, y - tile[1] * SPAN as f64];
        let found = height_over(&meshes[&tile.map(|number| number as i32)], place).unwrap();
        // A crossing is rounded to a step, which is some height on a slope.
        assert!((found - z).abs() < 4_000.0, "{found} {z}");
    }
}

#[test]
fn neighbours_have_the_same_normals() {
    let terrain = terrain(9, 300, 60_000, 1);
    let meshes = tiles(&terrain, 1);
    let tile = |[x, y]: [i32; 2]| Tile { scheme: SCHEME, zoom: ZOOM, x, y };
    let normals_of = |place: [i32; 2]| {
        let others = (-1..=1).flat_map(|y| (-1..=1).map(move |x| [x, y])).filter(|offset| *offset != [0, 0]);
        let around: Vec<([i32; 2], Vec<BorderNormal>)> = others
            .filter_map(|[x, y]| {
                let beside = [place[0] + x, place[1] + y];
                Some(([x, y], border_normals(meshes.get(&beside)?, tile(beside))))
            })
            .collect();
        let normals = crate::normals::normals(&meshes[&place], tile(place), &around);
        let nodes = meshes[&place].nodes.iter().map(|node| [node.u, node.v]);
        nodes.zip(normals).collect::<BTreeMap<_, _>>()
    };
    let (west, east) = (normals_of([CORNER[0] - 1, CORNER[1]]), normals_of(CORNER));
    let along: Vec<u16> = west.keys().filter(|place| place[0] == LAST).map(|place| place[1]).collect();
    assert!(along.len() > 10);
    assert!(along.iter().all(|v| west[&[LAST, *v]] == east[&[0, *v]]));
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

/// Rings of lakes on the grid of a zoom, around the corner of four tiles.
fn lakes(seed: u64, count: u32, reach: i64) -> Vec<Shore> {
    let mut next = random(seed);
    let mut shores = Vec::new();
    for lake in 0..count {
        let middle = CORNER.map(|number| i64::from(number) * SPAN + next(2 * reach) - reach);
        // Rings may cross themselves.
        let ring: Vec<[i64; 2]> =
            (0..next(9) + 3).map(|_| middle.map(|along| along + next(reach) - reach / 2)).collect();
        let ends = ring.iter().zip(ring.iter().cycle().skip(1)).map(|(from, to)| [*from, *to]);
        shores.extend(ends.map(|ends| Shore { lake, ends }));
    }
    shores
}

/// Tells whether a place is in a lake: x and y in parts of a step, by the crossings of a line to the east with each shore.
fn is_in_lake(shores: &[Shore], [x, y]: [i64; 2], parts: i64) -> bool {
    let is_crossed = |shore: &&Shore| {
        let [[ax, ay], [bx, by]] = shore.ends.map(|end| end.map(|along| i128::from(along * parts)));
        let (x, y) = (i128::from(x), i128::from(y));
        // A middle on the shore is in the lake that lies east of it.
        (ay <= y) != (by <= y) && {
            let side = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
            if by > ay { side > 0 } else { side < 0 }
        }
    };
    let lakes = shores.chunk_by(|a, b| a.lake == b.lake);
    lakes.map(|shores| shores.iter().filter(is_crossed).count()).any(|count| count % 2 == 1)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn the_water_mask_is_where_middles_of_cells_are_in_lakes(
        seed in 0u64..1 << 40,
        count in 1u32..6,
        reach in prop::sample::select(vec![100i64, 3_000, 60_000, 300_000]),
        scheme in prop::sample::select(vec![Scheme::Geographic, Scheme::WebMercator]),
        coarser in 0u8..4,
    ) {
        let mut shores = lakes(seed, count, reach);
        let zoom = ZOOM - coarser;
        let of_one_order = Water::new(scheme, [zoom, ZOOM], &shores);
        let corner = CORNER.map(|number| number >> coarser);
        for [east, north] in [[-1, -1], [0, -1], [-1, 0], [0, 0]] {
            let tile = Tile { scheme, zoom, x: corner[0] + east, y: corner[1] + north };
            let mask = of_one_order.mask(tile);
            prop_assert!(mask.len() == 1 || mask.len() == 1 << 16);
            let mut random_cells = random(seed);
            for _ in 0..200 {
                let [column, row] = [random_cells(256), random_cells(256)];
                let found = mask.get((255 - row) as usize * 256 + column as usize).unwrap_or(&mask[0]);
                let x = (2 * (i64::from(tile.x) * 256 + column) + 1) * (SPAN << coarser);
                let [south, north] = [tile.y, tile.y + 1].map(|row| scheme.latitude(zoom, row));
                let latitude = south + (north - south) * ((2 * row + 1) as f64 / 512.0);
                let y = TileGrid::new(scheme, ZOOM).y(latitude, 512);
                prop_assert_eq!(*found == 255, is_in_lake(&shores, [x, y], 512), "{} {}", column, row);
            }
        }
        // Neither the order of edges matters, nor their directions.
        shores.reverse();
        shores.iter_mut().for_each(|shore| shore.ends.reverse());
        let of_another = Water::new(scheme, [zoom, ZOOM], &shores);
        let tile = Tile { scheme, zoom, x: corner[0], y: corner[1] };
        prop_assert_eq!(of_one_order.mask(tile), of_another.mask(tile));
    }
}

#[test]
fn tiles_in_a_lake_and_beside_it_have_one_number() {
    let [west, south] = CORNER.map(|number| i64::from(number) * SPAN);
    let ring = [[west, south], [west + 2 * SPAN, south], [west + 2 * SPAN, south + SPAN], [west, south + SPAN]];
    let shores: Vec<Shore> = (0..4).map(|k| Shore { lake: 0, ends: [ring[k], ring[(k + 1) % 4]] }).collect();
    let water = Water::new(SCHEME, [ZOOM; 2], &shores);
    let mask = |x: i32, y: i32| water.mask(Tile { scheme: SCHEME, zoom: ZOOM, x: CORNER[0] + x, y: CORNER[1] + y });
    assert_eq!(
        [mask(0, 0), mask(1, 0), mask(2, 0), mask(0, 1), mask(-1, 0)],
        [[255], [255], [0], [0], [0]].map(Vec::from)
    );
    let coarser = Water::new(SCHEME, [ZOOM - 1, ZOOM], &shores);
    let mask = coarser.mask(Tile { scheme: SCHEME, zoom: ZOOM - 1, x: CORNER[0] >> 1, y: CORNER[1] >> 1 });
    // The southern half of the tile: the last rows.
    assert!(mask[..1 << 15].iter().all(|cell| *cell == 0) && mask[1 << 15..].iter().all(|cell| *cell == 255));
    // The tile around the globe has water beyond the 180th meridian in its west. A sixteenth of it is sixteen columns.
    let zoom = 4;
    let ends = |[x, y]: [i64; 2]| [(x - west) / SPAN * SPAN + 15 * SPAN, (y - south) / SPAN * SPAN + 8 * SPAN];
    let shores: Vec<Shore> = shores.iter().map(|shore| Shore { lake: 0, ends: shore.ends.map(ends) }).collect();
    let all = Water::new(Scheme::WebMercator, [0, zoom], &shores);
    let root = all.mask(Tile { scheme: Scheme::WebMercator, zoom: 0, x: 0, y: 0 });
    let row = root.as_chunks::<256>().0.iter().find(|row| row[0] == 255).unwrap();
    let columns: Vec<usize> = (0..256).filter(|&column| row[column] == 255).collect();
    assert_eq!(columns, (0..16).chain(240..256).collect::<Vec<usize>>());
}
