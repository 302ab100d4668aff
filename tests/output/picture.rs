//! Tests of the preview.

use gdt_batch::geometry::predicates::orient2d;
use gdt_batch::output::Tile;
use gdt_batch::output::color::HeightRange;
use gdt_batch::output::frame::Frame;
use gdt_batch::output::preview::canvas::{Canvas, LONGER_SIDE, PreviewPixel};
use gdt_batch::output::preview::picture::Picture;
use proptest::prelude::*;

use crate::model::{cloud, cut, grid, terrain, utm};
use crate::random::Random;

fn canvas_of(frame: &Frame, mesh: &Tile) -> Canvas {
    let bounds = mesh.bounds().unwrap();
    Canvas::new(frame, bounds, HeightRange::of(bounds))
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

#[test]
fn the_picture_is_a_png_of_its_size() {
    let frame = utm();
    let mesh = terrain(&frame, &cloud(31, 300, 50_000));
    let canvas = canvas_of(&frame, &mesh);
    let mut picture = Picture::new(&canvas);
    picture.add(0, &canvas.draw(&mesh).unwrap());
    let png = picture.png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    assert_eq!([reader.info().width, reader.info().height], canvas.size());
    let seen = pixels.chunks_exact(4).filter(|pixel| pixel[3] == 255).count();
    assert_eq!(seen, canvas.draw(&mesh).unwrap().len());
}

#[test]
fn a_slope_towards_the_light_is_brighter() {
    let frame = utm();
    let roof = |x: i32| 300 - (x - 300).abs();
    let points: Vec<[i32; 3]> = (0..=60).flat_map(|x| [0, 300, 600].map(|y| [10 * x, y, roof(10 * x)])).collect();
    let mesh = Tile { colors: Some(vec![[30_000; 3]; points.len()]), ..terrain(&frame, &points) };
    let canvas = canvas_of(&frame, &mesh);
    let mut picture = Picture::new(&canvas);
    picture.add(0, &canvas.draw(&mesh).unwrap());
    let png = picture.png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let side = canvas.size()[0] as usize;
    let at = |x: usize, y: usize| pixels[4 * (y * side + x)];
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
