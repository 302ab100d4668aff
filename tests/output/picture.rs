//! Tests of the preview.

use delaunay::geometry::predicates::orient2d;
use proptest::prelude::*;
use tiles::Tile;
use tiles::color::HeightRange;
use tiles::frame::Frame;
use tiles::preview::canvas::{Canvas, LONGER_SIDE, PreviewPixel};
use tiles::preview::layout::world_file;
use tiles::preview::panel::Legend;
use tiles::preview::picture::Picture;

use std::collections::BTreeSet;

use crate::model::{cloud, cut, grid, terrain, utm};
use crate::random::Random;

fn canvas_of(frame: &Frame, mesh: &Tile) -> Canvas {
    let bounds = mesh.bounds().unwrap();
    Canvas::new(frame, bounds, HeightRange::of(bounds), LONGER_SIDE)
}

#[test]
fn every_pixel_of_a_rectangle_is_drawn_once() {
    let frame = utm();
    for (columns, rows, step) in [(20, 20, 6_000), (5, 9, 1), (2, 2, 1), (300, 2, 77)] {
        let mesh = terrain(&frame, &grid(columns, rows, step));
        let canvas = canvas_of(&frame, &mesh);
        let [width, height] = canvas.size();
        let mut pixels: Vec<u32> = canvas.draw(&mesh).unwrap().iter().map(|pixel| pixel.pixel).collect();
        pixels.sort_unstable();
        // The last column or row may have its centre outside.
        assert!((LONGER_SIDE as u32 - 1..=LONGER_SIDE as u32).contains(&width.max(height)));
        let covered: Vec<u32> =
            (0..width * height).filter(|i| i % width + 1 < width && i / width + 1 < height).collect();
        let inner: Vec<u32> = pixels.iter().copied().filter(|p| covered.binary_search(p).is_ok()).collect();
        assert!(inner == covered, "{} of {} pixels", inner.len(), covered.len());
        assert!(pixels.windows(2).all(|pair| pair[0] < pair[1]), "a pixel twice");
    }
}

/// Slivers over many rows are drawn in another way than other triangles.
#[test]
fn a_fan_of_slivers_covers_the_pixels_of_its_outline_once() {
    let frame = utm();
    for [end, hub] in
        [[[90_000, 0], [40_000, 70_000]], [[0, 80_000], [90_000, 30_000]], [[70_000, 70_000], [90_000, 100]]]
    {
        let count = 3_000;
        let on_line = |i: i32| [end[0] / count * i, end[1] / count * i, 0];
        let points: Vec<[i32; 3]> = (0..=count).map(on_line).chain([[hub[0], hub[1], 500]]).collect();
        let hub = points.len() as u32 - 1;
        let turned = |a: u32, b: u32| {
            let [p, q, r] = [a, b, hub].map(|v| [points[v as usize][0], points[v as usize][1]]);
            if orient2d(p, q, r) > 0 { [a, b, hub] } else { [b, a, hub] }
        };
        let tile = |triangles: Vec<[u32; 3]>| Tile { triangles, positions: points.clone(), ..Tile::default() };
        let fan = tile((0..hub - 1).map(|i| turned(i, i + 1)).collect());
        let outline = tile(vec![turned(0, hub - 1)]);
        let canvas = canvas_of(&frame, &fan);
        let pixels = |tile: &Tile| {
            let mut pixels: Vec<u32> = canvas.draw(tile).unwrap().iter().map(|pixel| pixel.pixel).collect();
            pixels.sort_unstable();
            pixels
        };
        assert!(pixels(&outline).len() > 100_000);
        assert!(pixels(&fan) == pixels(&outline));
    }
}

/// Returns the width and the rows of a preview.
fn decoded(png: &[u8]) -> (usize, Vec<[u8; 4]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    (
        reader.info().width as usize,
        pixels.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2], pixel[3]]).collect(),
    )
}

/// The height of the strip with the legend.
const STRIP: usize = 64;

#[test]
fn the_picture_is_the_terrain_with_a_legend_below() {
    let frame = utm();
    // As wide as high, wide, and so narrow that the legend is wider.
    for (columns, rows) in [(30, 30), (90, 3), (3, 90)] {
        let mesh = terrain(&frame, &grid(columns, rows, 500));
        let canvas = canvas_of(&frame, &mesh);
        let mut picture = Picture::new(&canvas);
        picture.add(&canvas.draw(&mesh).unwrap());
        let (width, pixels) = decoded(&picture.png(&Legend::new(&canvas, true)).unwrap());
        let [own, height] = canvas.size().map(|side| side as usize);
        assert_eq!((width, pixels.len() / width), (own.max(480), height + STRIP));
        let (above, strip) = pixels.split_at(width * height);
        let seen = above.iter().filter(|pixel| pixel[3] == 255).count();
        assert_eq!(seen, canvas.draw(&mesh).unwrap().len());
        assert!(strip.iter().all(|pixel| pixel[3] == 255));
        // Paper, ink, and the colours of the ramp.
        let kinds: BTreeSet<&[u8; 4]> = strip.iter().collect();
        assert!(kinds.len() > 100, "{}", kinds.len());
        let (_, plain) = decoded(&picture.png(&Legend::new(&canvas, false)).unwrap());
        let is_gray = |pixel: &&[u8; 4]| pixel[0].abs_diff(pixel[2]) < 16;
        assert!(plain[width * height..].iter().all(|pixel| is_gray(&pixel)));
        assert!(strip.iter().filter(is_gray).count() < strip.len() - 1000);
    }
}

#[test]
fn the_world_file_puts_the_picture_where_the_terrain_is() {
    let frame = utm();
    for (columns, rows) in [(40, 40), (90, 3), (3, 90)] {
        let mesh = terrain(&frame, &grid(columns, rows, 500));
        let canvas = canvas_of(&frame, &mesh);
        let mut picture = Picture::new(&canvas);
        picture.add(&canvas.draw(&mesh).unwrap());
        let (width, pixels) = decoded(&picture.png(&Legend::new(&canvas, true)).unwrap());
        let lines: Vec<f64> = world_file(&canvas).lines().map(|line| line.parse().unwrap()).collect();
        let [across, 0.0, 0.0, down, west, north] = lines[..] else { panic!("{lines:?}") };
        assert!(across > 0.0 && down == -across);
        let height = pixels.len() / width - STRIP;
        let covered = |i: &usize| pixels[*i][3] == 255;
        let seen: Vec<[usize; 2]> = (0..width * height).filter(covered).map(|i| [i % width, i / width]).collect();
        let bounds = mesh.bounds().unwrap();
        let extras = frame.extras();
        let source = |corner: [i32; 3]| {
            let [x, _, z] = frame.world(corner);
            [extras.offset[0] + x / extras.metres_per_unit, extras.offset[1] - z / extras.metres_per_unit]
        };
        let (low, high) = (source(bounds.min), source(bounds.max));
        let least = [0, 1].map(|k| seen.iter().map(|place| place[k]).min().unwrap() as f64);
        let most = [0, 1].map(|k| seen.iter().map(|place| place[k]).max().unwrap() as f64);
        // The terrain reaches from the middle of the outermost pixels by half a pixel, or up to one where the last has its middle outside.
        for (found, wanted) in [
            (west + (least[0] - 0.5) * across, low[0]),
            (west + (most[0] + 0.5) * across, high[0]),
            (north + (least[1] - 0.5) * down, high[1]),
            (north + (most[1] + 0.5) * down, low[1]),
        ] {
            assert!((found - wanted).abs() <= across, "{found} {wanted} {across}");
        }
        assert!((west + (least[0] - 0.5) * across - low[0]).abs() < 1e-3 * across);
    }
}

#[test]
fn tiles_have_no_borders_in_the_picture() {
    let frame = utm();
    let mesh = terrain(&frame, &grid(40, 40, 500));
    let canvas = canvas_of(&frame, &mesh);
    let drawn = |tiles: &[Tile]| {
        let mut picture = Picture::new(&canvas);
        tiles.iter().for_each(|tile| picture.add(&canvas.draw(tile).unwrap()));
        picture.png(&Legend::new(&canvas, true)).unwrap()
    };
    let mut random = Random(5);
    assert!(drawn(&cut(&mesh, 4, |_| random.below(4) as usize)) == drawn(std::slice::from_ref(&mesh)));
}

/// Triangles along a road, a slope and a wall cover hardly a centre of a pixel.
#[test]
fn a_very_narrow_terrain_is_seen() {
    let frame = utm();
    let lines: [fn(i32) -> [i32; 3]; 3] =
        [|k| [40 * k, k * k % 3, k % 50], |k| [40 * k, 17 * k + k * k % 3, 0], |k| [k % 2, -40 * k, 7 * k]];
    for line in lines {
        let points: Vec<[i32; 3]> = (0..6_000).map(line).collect();
        let strip: Vec<[u32; 3]> = (0..5_998).map(|v| [v, v + 1, v + 2]).collect();
        let triangles = strip.into_iter().map(|t| {
            let [p, q, r] = t.map(|v| [points[v as usize][0], points[v as usize][1]]);
            if orient2d(p, q, r) < 0 { [t[1], t[0], t[2]] } else { t }
        });
        let mesh = Tile { triangles: triangles.collect(), positions: points.clone(), ..Tile::default() };
        let canvas = canvas_of(&frame, &mesh);
        let drawn = |tiles: &[Tile]| {
            let mut picture = Picture::new(&canvas);
            for tile in tiles {
                let pixels = canvas.draw(tile).unwrap();
                picture.add(&canvas.dots(tile, pixels.len()));
                picture.add(&pixels);
            }
            picture.png(&Legend::new(&canvas, true)).unwrap()
        };
        let (width, pixels) = decoded(&drawn(std::slice::from_ref(&mesh)));
        let seen = pixels[..pixels.len() - STRIP * width].iter().filter(|pixel| pixel[3] == 255).count();
        assert!(seen >= 1000, "{seen} pixels");
    }
    // Elsewhere dots change nothing.
    let mesh = terrain(&frame, &grid(40, 40, 500));
    let canvas = canvas_of(&frame, &mesh);
    let pixels = canvas.draw(&mesh).unwrap();
    assert_eq!(canvas.dots(&mesh, pixels.len()), []);
    let corner = Tile::of(&mesh.positions, mesh.triangles[..1].to_vec());
    let dots = canvas.dots(&corner, 0);
    assert!(!dots.is_empty());
    let with = |dots: &[PreviewPixel]| {
        let mut picture = Picture::new(&canvas);
        picture.add(&pixels);
        picture.add(dots);
        picture.png(&Legend::new(&canvas, true)).unwrap()
    };
    assert!(with(&dots) == with(&[]));
}

#[test]
fn a_slope_towards_the_light_is_brighter() {
    let frame = utm();
    let roof = |x: i32| 300 - (x - 300).abs();
    let points: Vec<[i32; 3]> = (0..=60).flat_map(|x| [0, 300, 600].map(|y| [10 * x, y, roof(10 * x)])).collect();
    let mesh = Tile { colors: Some(vec![[30_000; 3]; points.len()]), ..terrain(&frame, &points) };
    let canvas = canvas_of(&frame, &mesh);
    let mut picture = Picture::new(&canvas);
    picture.add(&canvas.draw(&mesh).unwrap());
    let (width, pixels) = decoded(&picture.png(&Legend::new(&canvas, true)).unwrap());
    let side = canvas.size()[0] as usize;
    let at = |x: usize, y: usize| pixels[y * width + x][0];
    let (to_the_light, away) = (at(side / 4, side / 2), at(side * 3 / 4, side / 2));
    assert!(to_the_light > away + 40, "{to_the_light} {away}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn tiles_draw_the_pixels_of_the_whole(seed: u64, extent in 3u64..(1 << 29), tiles in 1usize..6) {
        let frame = utm();
        let points = cloud(seed, 40, extent);
        let collinear = points.windows(3).all(|w| orient2d([w[0][0], w[0][1]], [w[1][0], w[1][1]], [w[2][0], w[2][1]]) == 0);
        prop_assume!(!collinear);
        let mesh = terrain(&frame, &points);
        let canvas = canvas_of(&frame, &mesh);
        let by_pixel = |mut pixels: Vec<PreviewPixel>| {
            pixels.sort_unstable_by_key(|pixel| pixel.pixel);
            pixels
        };
        let whole = by_pixel(canvas.draw(&mesh).unwrap());
        prop_assert!(whole.windows(2).all(|pair| pair[0].pixel < pair[1].pixel));
        let mut random = Random(seed);
        let cut = cut(&mesh, tiles, |_| random.below(tiles as u64) as usize);
        let pieces = by_pixel(cut.iter().rev().flat_map(|tile| canvas.draw(tile).unwrap()).collect());
        prop_assert!(pieces == whole);
    }
}
