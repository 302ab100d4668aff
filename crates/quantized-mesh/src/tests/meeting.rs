//! Tiles cover their places, and meet.

use super::*;

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
            finer = coarser_tiles(finer, scheme, zoom);
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
            finer = coarser_tiles(finer, SCHEME, zoom);
            check_meeting(&finer);
        }
    }
}

/// A crowd far denser than places waits as its places, not as its points.
#[test]
fn points_that_rounding_puts_in_one_place_are_one_vertex_of_a_piece() {
    let mut crowd = terrain(3, 4_000, 900, 1);
    for point in &mut crowd.points {
        (point.x, point.y) = (point.x.div_euclid(60) + 5, point.y.div_euclid(60) + 5);
    }
    let places: BTreeSet<[i64; 2]> = crowd.points.iter().map(|point| [point.x, point.y]).collect();
    let pieces = cut(&crowd.points, &crowd.triangles);
    let vertices: usize = pieces.iter().map(|(_, piece)| piece.nodes.len()).sum();
    assert!(vertices < 2 * places.len() && places.len() * 4 < crowd.points.len(), "{vertices} of {}", places.len());
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
