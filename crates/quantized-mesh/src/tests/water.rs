//! Water masks.

use super::*;

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
