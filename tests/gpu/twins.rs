//! Every step, each fed with what its twin was fed with.

use super::random::cases;
use super::rig::Rig;
use gdt_batch::config::Voronoi;
use gdt_batch::gpu::buffers::Name;
use gdt_batch::gpu::steps::{Recording, Size, total};
use gdt_batch::gpu::twins;

/// Says where two lists differ first, without printing millions of numbers.
fn same(case: &str, step: &str, shader: &[u32], twin: &[u32]) {
    assert_eq!(shader.len(), twin.len(), "{case}, {step}: lengths");
    if let Some(i) = (0..twin.len()).find(|&i| shader[i] != twin[i]) {
        let differing = (0..twin.len()).filter(|&i| shader[i] != twin[i]).count();
        panic!("{case}, {step}: {differing} numbers differ, first number {i}: {:#x}, not {:#x}", shader[i], twin[i]);
    }
}

fn labels(rig: &mut Rig, size: Size, pixels: &[u32], voronoi: Voronoi, islands: bool) -> Vec<u32> {
    let mut recording = Recording::default();
    recording.write_sites(size, pixels.to_vec());
    recording.voronoi(size, voronoi);
    if islands {
        recording.remove_islands(size);
    }
    rig.run(&recording);
    rig.fetch(Name::Labels, size.pixels())
}

#[test]
fn labels_are_the_same_bit_for_bit() {
    let Some(mut rig) = Rig::new() else { return };
    for (name, size, pixels) in cases() {
        let texture = twins::write_sites(size, &pixels);
        let exact = twins::voronoi_exact(size, &texture);
        let from_exact = labels(&mut rig, size, &pixels, Voronoi::Exact, false);
        same(name, "G1", &rig.fetch(Name::Texture, size.pixels()), &texture);
        same(name, "G2 exact", &from_exact, &exact);
        let mut jfa = twins::voronoi_jfa(size, &texture);
        same(name, "G2 jfa", &labels(&mut rig, size, &pixels, Voronoi::Jfa, false), &jfa);
        let wrong = jfa.iter().zip(&exact).filter(|(a, b)| a != b).count();
        assert!(wrong as f64 <= 2e-3 * exact.len() as f64, "{name}: 1+JFA misses {wrong} pixels");
        twins::remove_islands(size, &mut jfa);
        same(name, "G3", &labels(&mut rig, size, &pixels, Voronoi::Jfa, true), &jfa);
    }
}

#[test]
fn triangles_are_the_same_triples_in_the_same_order() {
    let Some(mut rig) = Rig::new() else { return };
    for (name, size, pixels) in cases() {
        let texture = twins::write_sites(size, &pixels);
        let labels = twins::voronoi_exact(size, &texture);
        let marks = twins::find_vertices(size, &labels);
        let (before, all) = twins::count(size, &marks);
        let triangles = twins::make_triangles(size, &labels, &texture);
        assert_eq!(triangles.len(), all as usize, "{name}: what is counted is made");

        let mut recording = Recording::default();
        recording.write_sites(size, pixels);
        recording.voronoi(size, Voronoi::Exact);
        recording.find_vertices(size);
        rig.run(&recording);
        let vertices = rig.fetch(Name::Vertices, 2 * u64::from(size.all_segments()));
        same(name, "G4", &unpack(size, &vertices), &marks);

        let mut recording = Recording::default();
        recording.count(size);
        recording.make_triangles(size, all.max(1));
        rig.run(&recording);
        let counts = rig.fetch(Name::Counts, u64::from(total(size)) + 1);
        same(name, "G5", &counts[..before.len()], &before);
        assert_eq!(counts[total(size) as usize], all, "{name}: total");
        same(name, "G6", &rig.fetch(Name::Triangles, 3 * u64::from(all)), &triangles.concat());
    }
}

/// Triangles of every corner, out of the two words of every segment.
fn unpack(size: Size, vertices: &[u32]) -> Vec<u32> {
    let corners = size.width as usize - 1;
    let segments = corners.div_ceil(32);
    let bit = |word: u32, x: usize| word >> (x % 32) & 1;
    let corner = |y: usize, x: usize| {
        let at = 2 * (y * segments + x / 32);
        bit(vertices[at], x) + bit(vertices[at + 1], x)
    };
    (0..size.height as usize - 1).flat_map(|y| (0..corners).map(move |x| (y, x))).map(|(y, x)| corner(y, x)).collect()
}

/// Islands as they would be if the diagram were worse: whole patches of labels put where they do not belong.
#[test]
fn islands_go_the_same_way_wherever_they_are() {
    let Some(mut rig) = Rig::new() else { return };
    let size = Size { width: 200, height: 150 };
    let mut random = super::random::Random(7);
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
        recording.commands.push(gdt_batch::gpu::steps::Command::Need(Name::Labels, 4 * size.pixels()));
        recording.commands.push(gdt_batch::gpu::steps::Command::Upload(Name::Labels, labels.clone()));
        recording.remove_islands(size);
        rig.run(&recording);
        let before = labels.clone();
        twins::remove_islands(size, &mut labels);
        assert_eq!(labels == before, patches == 20_000, "a texture full of islands is left alone, others are not");
        same(&format!("{patches} patches"), "G3", &rig.fetch(Name::Labels, size.pixels()), &labels);
    }
}
