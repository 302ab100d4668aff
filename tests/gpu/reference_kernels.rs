//! The twins compute what they should, and the self-test compares every step with its twin.

use super::clouds::clouds;
use super::random::Random;
use super::rig::Rig;
use delaunay::voronoi::texture_request::TextureResolution;
use delaunay_gpu::filled_atlas::{AtlasLimits, FilledAtlas};
use delaunay_gpu::reference_kernels;
use delaunay_gpu::texture_size::TextureSize;

#[test]
fn the_self_test_compares_every_step() {
    let Some(mut rig) = Rig::new() else { return };
    let mut filled = FilledAtlas::default();
    let limits = AtlasLimits { pixels: 1 << 24, bytes: 1 << 27 };
    for cloud in clouds().iter().take(3) {
        assert!(filled.add(&cloud.sites[..4000], TextureResolution::PixelsPerSite(8.0), limits));
    }
    let comparisons = rig.compare(&filled);
    assert!(comparisons.iter().all(|c| c.differing == 0 && c.numbers > 0), "{comparisons:?}");
    let steps: Vec<_> = comparisons.iter().map(|c| c.step).collect();
    assert_eq!(steps, ["G1", "G2 jfa", "G3 jfa", "G2 exact", "G3 exact", "G4", "G5", "G6", "C2, C4", "return"]);
}

/// Returns the texture of sites at these pixels.
fn written(size: TextureSize, pixels: &[u32]) -> Vec<u32> {
    let mut texture = vec![0; size.pixels() as usize];
    for (site, pixel) in (0u32..).zip(pixels) {
        texture[((pixel >> 16) * size.width + (pixel & 0xffff)) as usize] = !site;
    }
    texture
}

/// The twin of the exact transform agrees with the definition, and jump flooding almost does.
#[test]
fn the_twins_compute_nearest_sites() {
    let mut random = Random(3);
    for (width, height, count) in [(1, 1, 1), (40, 30, 7), (40, 30, 300), (3, 200, 9), (120, 2, 30), (64, 64, 1)] {
        let size = TextureSize { width, height };
        let pixels = random.pixels(size, count);
        let texture = written(size, &pixels);
        let nearest = |x: u32, y: u32| {
            let key = |p: u32| ((p & 0xffff).abs_diff(x).pow(2) + (p >> 16).abs_diff(y).pow(2), p & 0xffff, p >> 16);
            pixels.iter().copied().min_by_key(|&p| key(p)).unwrap()
        };
        let expected: Vec<u32> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| nearest(x, y)).collect();
        assert_eq!(reference_kernels::voronoi_exact(size, &texture), expected);
        let wrong =
            reference_kernels::voronoi_jfa(size, &texture).iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert!(50 * wrong <= expected.len(), "1+JFA misses {wrong} of {} pixels", expected.len());
    }
}
