//! Tiles and their bytes.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

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
