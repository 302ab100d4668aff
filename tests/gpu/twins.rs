//! Every step against its twin, on textures that are random, dense, sparse, tiny, one row, one column, full or empty.

use super::random::{Random, cases};
use super::rig::Rig;
use gdt_batch::gpu::buffer_id::BufferId;
use gdt_batch::gpu::device;
use gdt_batch::gpu::steps::{GpuCommand, Recording};
use gdt_batch::gpu::texture_size::TextureSize;
use gdt_batch::gpu::twins;

#[test]
fn every_step_is_the_same_bit_for_bit() {
    let Some(mut rig) = Rig::new() else { return };
    for (name, size, pixels) in cases() {
        let comparisons = rig.compare(size, &pixels);
        let differing: Vec<_> = comparisons.iter().filter(|c| c.differing > 0).collect();
        assert!(differing.is_empty(), "{name}: {differing:?}");
        let steps: Vec<_> = comparisons.iter().map(|c| c.step).collect();
        assert_eq!(steps, ["G1", "G2 jfa", "G3", "G2 exact", "G4", "G5", "G6"]);
        assert_eq!(comparisons[0].numbers, size.pixels());
    }
}

/// Tests the longest rows and columns, and the whole square if the adapter can bind it, which no software renderer can. It takes
/// minutes on software, so it needs GDT_TEST_LARGE=1.
#[test]
fn the_largest_texture_is_the_same_bit_for_bit() {
    if std::env::var_os("GDT_TEST_LARGE").is_none() {
        return eprintln!("not tested: textures of 16384 pixels a side; set GDT_TEST_LARGE=1");
    }
    let Some(mut rig) = Rig::new() else { return };
    let side = device::MAX_SIDE;
    let across = (rig.max_pixels() / u64::from(side)).min(u64::from(side)) as u32;
    for (width, height) in [(side, across), (across, side)] {
        let size = TextureSize { width, height };
        // The triangles of more sites would not fit a buffer of a software renderer.
        for count in [40, size.pixels() as usize / 16] {
            let pixels = Random(11).pixels(size, count);
            let differing: Vec<_> = rig.compare(size, &pixels).into_iter().filter(|c| c.differing > 0).collect();
            assert!(differing.is_empty(), "{width} x {height}, {count} sites: {differing:?}");
            eprintln!("{width} x {height}, {count} sites: every step the same");
        }
    }
}

/// The twin of the exact transform agrees with the definition, and jump flooding almost does.
#[test]
fn the_twins_compute_nearest_sites() {
    let mut random = Random(3);
    for (width, height, count) in [(1, 1, 1), (40, 30, 7), (40, 30, 300), (3, 200, 9), (120, 2, 30), (64, 64, 1)] {
        let size = TextureSize { width, height };
        let pixels = random.pixels(size, count);
        let texture = twins::write_sites(size, &pixels);
        let nearest = |x: u32, y: u32| {
            let key = |p: u32| ((p & 0xffff).abs_diff(x).pow(2) + (p >> 16).abs_diff(y).pow(2), p & 0xffff, p >> 16);
            pixels.iter().copied().min_by_key(|&p| key(p)).unwrap()
        };
        let expected: Vec<u32> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| nearest(x, y)).collect();
        assert_eq!(twins::voronoi_exact(size, &texture), expected);
        let wrong = twins::voronoi_jfa(size, &texture).iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert!(50 * wrong <= expected.len(), "1+JFA misses {wrong} of {} pixels", expected.len());
    }
}

/// The islands of a worse diagram: whole patches of labels lie where they do not belong.
#[test]
fn islands_anywhere_are_removed_as_by_the_twin() {
    let Some(mut rig) = Rig::new() else { return };
    let size = TextureSize { width: 200, height: 150 };
    let mut random = Random(7);
    let pixels = random.pixels(size, 900);
    let texture = twins::write_sites(size, &pixels);
    let clean = twins::voronoi_exact(size, &texture);
    for patches in [1, 40, 400, 20_000] {
        let mut labels = clean.clone();
        for _ in 0..patches {
            let at = random.below(labels.len() as u32) as usize;
            let from = random.below(labels.len() as u32) as usize;
            let length = (1 + random.below(4) as usize).min(labels.len() - at);
            labels[at..at + length].fill(clean[from]);
        }
        let mut recording = Recording::default();
        recording.commands.push(GpuCommand::Reserve(BufferId::Labels, 4 * size.pixels()));
        recording.commands.push(GpuCommand::Upload(BufferId::Labels, labels.clone()));
        recording.remove_islands(size);
        rig.run(&recording);
        let before = labels.clone();
        twins::remove_islands(size, &mut labels);
        assert_eq!(labels == before, patches == 20_000, "a texture full of islands is left alone, others are not");
        assert!(rig.numbers(BufferId::Labels, size.pixels()) == labels, "{patches} patches");
    }
}
