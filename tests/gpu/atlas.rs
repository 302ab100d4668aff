//! Steps G1 to G3 on an atlas of many leaves: shader against twin, and what they promise.

use super::clouds::{Cloud, clouds, hard_clouds, real_cloud};
use super::flips::stuck_after_flips;
use super::linked::LinkedMesh;
use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::{REACH, Site};
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};
use delaunay_gpu::atlas::{Atlas, AtlasLeaf};
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::leaf_flags::ISLANDS_LEFT;
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels;
use delaunay_gpu::reference_kernels::atlas::WrittenSites;
use delaunay_gpu::reference_kernels::c4_flip::AT_INFINITY;
use delaunay_gpu::texture_size::TextureSize;
use std::collections::BTreeSet;

/// An atlas, and the sites of its vertices.
pub(crate) struct Filled {
    pub(crate) atlas: Atlas,
    pub(crate) sites: Vec<Site>,
}

impl Filled {
    /// Fills an atlas with clouds, in textures of `pixels_per_site`.
    pub(crate) fn new(clouds: &[Cloud], pixels_per_site: f64) -> Filled {
        let resolution = TextureResolution::PixelsPerSite(pixels_per_site);
        let request = TextureRequest { resolution, max_side: 16_384, max_pixels: 1 << 24 };
        let mut filled = Filled { atlas: Atlas::default(), sites: Vec::new() };
        for cloud in clouds {
            assert!(filled.atlas.add(&cloud.sites, &request, 1 << 25), "{}", cloud.name);
            filled.sites.extend(&cloud.sites);
            filled.sites.push([AT_INFINITY, 0]);
        }
        filled
    }

    /// Returns the pixel of a leaf's every site, by its number; `None` if it is missing.
    fn placed(&self, leaf: &AtlasLeaf, texture: &[u32]) -> Vec<Option<[u32; 2]>> {
        let mut placed = vec![None; leaf.sites as usize];
        for y in 0..leaf.height {
            for x in 0..leaf.width {
                let number = texture[leaf.at(x, y) as usize];
                if number != 0 {
                    let place = &mut placed[(!number - leaf.first_site) as usize];
                    assert_eq!(*place, None, "a site has two pixels");
                    *place = Some([x, y]);
                }
            }
        }
        placed
    }
}

/// Returns small leaves of unusual shapes.
fn small_clouds() -> Vec<Cloud> {
    let mut random = Random(99);
    let far = [[-REACH, -REACH], [REACH, REACH], [-REACH, REACH], [REACH, 0], [0, 0], [1, 0], [1, 1]];
    let crowded = (0..3000).map(|_| [random.below(40) as i32, random.below(4000) as i32]);
    let crowded: BTreeSet<Site> = crowded.chain([[1 << 20, 0]]).collect();
    let uniform: BTreeSet<Site> = (0..2000).map(|_| [0; 2].map(|_: i32| random.below(3000) as i32)).collect();
    vec![
        Cloud { name: "three sites", sites: vec![[0, 0], [5, 5], [9, 0]] },
        Cloud { name: "three neighbours", sites: vec![[3, 3], [4, 3], [3, 4]] },
        Cloud { name: "one row", sites: (0..700).map(|x| [x * x, 7]).collect() },
        Cloud { name: "one column", sites: (0..700).map(|y| [-7, y * y]).collect() },
        Cloud { name: "all pixels", sites: (0..63 * 64).map(|i| [i % 63, i / 63]).collect() },
        Cloud { name: "very far apart", sites: far.to_vec() },
        Cloud { name: "crowded", sites: crowded.into_iter().rev().collect() },
        Cloud { name: "numbered from the east", sites: uniform.into_iter().rev().collect() },
        Cloud { name: "three more", sites: vec![[-9, -9], [-9, 9], [9, 9]] },
    ]
}

fn all_clouds() -> Vec<Cloud> {
    let mut all = small_clouds();
    all.extend(clouds());
    all.extend(real_cloud());
    all.extend(hard_clouds());
    all.extend(small_clouds());
    all
}

fn assert_same(name: &str, shader: &[u32], twin: &[u32]) {
    let differing: Vec<_> = (0..twin.len()).filter(|&i| shader[i] != twin[i]).collect();
    let first = differing.first().map(|&i| (i, shader[i], twin[i]));
    assert_eq!(first, None, "{name}: {} of {} differ", differing.len(), twin.len());
}

#[test]
fn every_step_on_an_atlas_is_the_same_bit_for_bit() {
    let Some(mut rig) = Rig::new() else { return };
    let clouds = all_clouds();
    for pixels_per_site in [5.0, 16.0] {
        let Filled { atlas, sites } = Filled::new(&clouds, pixels_per_site);
        let written = reference_kernels::atlas::write_sites(&atlas, &sites);
        for method in [VoronoiMethod::Exact, VoronoiMethod::Jfa] {
            let mut recording = Recording::default();
            recording.upload_atlas(&atlas, &sites);
            recording.write_atlas_sites(&atlas);
            recording.atlas_voronoi(&atlas, method);
            rig.run(&recording);
            assert_same("texture", &rig.numbers(BufferId::Texture, written.texture.len() as u64), &written.texture);
            assert_same("missing", &rig.numbers(BufferId::Missing, written.missing.len() as u64), &written.missing);
            let mut labels = reference_kernels::atlas::voronoi(&atlas, &written.texture, method);
            assert_same("labels", &rig.numbers(BufferId::Labels, labels.len() as u64), &labels);

            let mut islands = Recording::default();
            islands.remove_atlas_islands(&atlas);
            rig.run(&islands);
            let flags = reference_kernels::atlas::remove_islands(&atlas, &mut labels);
            assert_same("islands", &rig.numbers(BufferId::Labels, labels.len() as u64), &labels);
            assert_same("flags", &rig.numbers(BufferId::Flags, flags.len() as u64), &flags);
            let flagged: Vec<_> =
                clouds.iter().zip(&flags).filter(|(_, flag)| **flag != 0).map(|(cloud, _)| cloud.name).collect();
            eprintln!("{pixels_per_site} pixels a site, {method:?}: leaves with islands left: {flagged:?}");
        }
    }
}

/// Every site is in the row of its pixel, at most one column away, or missing; and the sites of a row lie in the order of their x.
#[test]
fn losers_move_by_one_pixel_and_keep_the_order_of_x() {
    let clouds = all_clouds();
    for pixels_per_site in [5.0, 16.0] {
        let filled = Filled::new(&clouds, pixels_per_site);
        let WrittenSites { texture, missing } = reference_kernels::atlas::write_sites(&filled.atlas, &filled.sites);
        let mut moved = 0;
        for leaf in &filled.atlas.leaves {
            let placed = filled.placed(leaf, &texture);
            for (number, place) in (leaf.first_site..).zip(&placed) {
                let home = leaf.pixel(filled.sites[number as usize]);
                assert_eq!(place.is_none(), missing[number as usize / 32] >> (number % 32) & 1 != 0);
                let Some([x, y]) = place else { continue };
                assert!(*y == home[1] && x.abs_diff(home[0]) <= 1, "{home:?} {place:?}");
                moved += (*x != home[0]) as usize;
            }
            let infinity = leaf.first_site + leaf.sites;
            assert_eq!(missing[infinity as usize / 32] >> (infinity % 32) & 1, 0);
            for y in 0..leaf.height {
                let row = &texture[leaf.at(0, y) as usize..][..leaf.width as usize];
                let numbers: Vec<u32> = row.iter().filter(|&&number| number != 0).map(|&number| !number).collect();
                // Neighbours from the same pixel lie in order; others are in order because their pixels are.
                let key = |number: u32| (filled.sites[number as usize][0], filled.sites[number as usize][1], number);
                let home = |number: u32| leaf.pixel(filled.sites[number as usize])[0];
                assert!(numbers.is_sorted_by(|&a, &b| home(a) < home(b) || (home(a) == home(b) && key(a) < key(b))));
            }
        }
        assert!(moved > 1000, "the clouds are too easy");
    }
}

/// Returns the share of a cloud's sites that are missing, of its triangles that are inverted before the flips, and of its edges that are
/// stuck after them, in thousandths of the sites: with the rule of the CPU and with that of the device.
fn exceptions(cloud: &Cloud, pixels_per_site: f64) -> [[f64; 3]; 2] {
    let one = [Cloud { name: cloud.name, sites: cloud.sites.clone() }];
    let filled = Filled::new(&one, pixels_per_site);
    let leaf = &filled.atlas.leaves[0];
    let written = reference_kernels::atlas::write_sites(&filled.atlas, &filled.sites);
    let placed = filled.placed(leaf, &written.texture);
    let taken = placed.iter().zip(&cloud.sites).filter_map(|(place, &site)| place.map(|[x, y]| ([y, x], site)));
    let size = TextureSize { width: leaf.width, height: leaf.height };
    let on_device = LinkedMesh::of_texture(size, taken.collect(), cloud.sites.len());
    let on_cpu = LinkedMesh::new(&cloud.sites, pixels_per_site);
    [on_cpu, on_device].map(|mesh| {
        let [before, _, stuck] = stuck_after_flips(&mesh);
        [mesh.missing, before, stuck].map(|count| 1000.0 * count as f64 / cloud.sites.len() as f64)
    })
}

#[test]
fn the_device_s_rule_for_losers_is_as_good_as_the_cpu_s() {
    let mut chosen: Vec<Cloud> = clouds().into_iter().filter(|c| ["uniform", "gaussian"].contains(&c.name)).collect();
    chosen.extend(real_cloud());
    for cloud in chosen {
        for pixels_per_site in [5.0, 8.0, 16.0] {
            let [cpu, device] = exceptions(&cloud, pixels_per_site);
            eprintln!(
                "{}, {pixels_per_site} pixels a site, of 1000 sites: missing {:.2} and {:.2}, inverted {:.2} and {:.2}, stuck {:.2} and {:.2}",
                cloud.name, cpu[0], device[0], cpu[1], device[1], cpu[2], device[2]
            );
            for (cpu, device) in cpu.into_iter().zip(device) {
                assert!(device < 1.1 * cpu + 0.3, "{}: {cpu} {device}", cloud.name);
            }
        }
    }
}

/// An atlas whose labels have patches of up to `side` rows and columns that lie where they do not belong, except in the first leaf.
struct Patched {
    filled: Filled,
    labels: Vec<u32>,
}

impl Patched {
    fn new(patches: u32, side: u32) -> Patched {
        let mut random = Random(7);
        let mut uniform = || (0..2000).map(|_| [0; 2].map(|_: i32| random.below(100_000) as i32)).collect();
        let clouds: [BTreeSet<Site>; 4] = [uniform(), uniform(), uniform(), uniform()];
        let clouds = clouds.map(|sites| Cloud { name: "uniform", sites: sites.into_iter().collect() });
        let filled = Filled::new(&clouds, 10.0);
        let written = reference_kernels::atlas::write_sites(&filled.atlas, &filled.sites);
        let clean = reference_kernels::atlas::voronoi(&filled.atlas, &written.texture, VoronoiMethod::Exact);
        let mut labels = clean.clone();
        for _ in 0..patches {
            let leaf = &filled.atlas.leaves[1 + random.below(3) as usize];
            let [from, x] = [0; 2].map(|_: u32| random.below(leaf.width));
            let [from_row, row] = [0; 2].map(|_: u32| random.below(leaf.height));
            let (from, at) = (leaf.at(from, from_row) as usize, leaf.at(x, row) as usize);
            let [length, rows] =
                [leaf.width - x, leaf.height - row].map(|most| (1 + random.below(side)).min(most) as usize);
            for at in (0..rows).map(|i| at + i * leaf.stride as usize) {
                labels[at..at + length].fill(clean[from]);
            }
        }
        Patched { filled, labels }
    }

    fn recording(&self) -> Recording {
        let mut recording = Recording::default();
        recording.upload_atlas(&self.filled.atlas, &self.filled.sites);
        recording.commands.push(GpuCommand::Reserve(BufferId::Labels, 4 * self.labels.len() as u64));
        recording.commands.push(GpuCommand::Upload(BufferId::Labels, self.labels.clone()));
        recording.remove_atlas_islands(&self.filled.atlas);
        recording
    }
}

#[test]
fn islands_anywhere_are_removed_as_by_the_twin() {
    let Some(mut rig) = Rig::new() else { return };
    for (patches, side, are_left) in [(1, 1, false), (400, 1, false), (6, 4, true), (400, 4, true), (20_000, 4, true)] {
        let patched = Patched::new(patches, side);
        rig.run(&patched.recording());
        let mut labels = patched.labels.clone();
        let flags = reference_kernels::atlas::remove_islands(&patched.filled.atlas, &mut labels);
        assert!(labels != patched.labels && flags[0] == 0);
        assert_eq!(flags.contains(&ISLANDS_LEFT), are_left, "{patches} patches: {flags:?}");
        assert_same("islands", &rig.numbers(BufferId::Labels, labels.len() as u64), &labels);
        assert_same("flags", &rig.numbers(BufferId::Flags, flags.len() as u64), &flags);
    }
}

/// Puts `wrong` in the place of `right` in the shaders that have it.
fn spoil(recording: &mut Recording, right: &str, wrong: &str) {
    let mut spoilt = 0;
    for command in &mut recording.commands {
        if let GpuCommand::Run(program, ..) = command {
            spoilt += program.source.matches(right).count();
            program.source = program.source.replace(right, wrong).leak();
        }
    }
    assert!(spoilt > 0, "{right}");
}

/// Lines of the shaders that only few leaves depend on are spoilt in turn: the leaves show it.
#[test]
fn the_leaves_find_every_error_in_g1_and_g2() {
    let Some(mut rig) = Rig::new() else { return };
    let mut clouds = small_clouds();
    clouds.extend(super::clouds::clouds().into_iter().filter(|cloud| ["coarse", "gaussian"].contains(&cloud.name)));
    let Filled { atlas, sites } = Filled::new(&clouds, 5.0);
    let written = reference_kernels::atlas::write_sites(&atlas, &sites);
    let [exact, jfa] = [VoronoiMethod::Exact, VoronoiMethod::Jfa]
        .map(|method| reference_kernels::atlas::voronoi(&atlas, &written.texture, method));
    for (method, right, wrong) in [
        (VoronoiMethod::Exact, "&& sites[i].x != AT_INFINITY", ""),
        (VoronoiMethod::Exact, ".first_site <= site", ".first_site < site"),
        (VoronoiMethod::Exact, "2u * steps.x + 1u", "2u * steps.x"),
        (VoronoiMethod::Exact, " + (middle >> 16u)", ""),
        (VoronoiMethod::Exact, " + (hl & 0xffffu)", ""),
        (VoronoiMethod::Exact, "has_lost && own.has_east", "has_lost"),
        (VoronoiMethod::Exact, "!has_place && own.has_west", "!has_place"),
        (VoronoiMethod::Exact, "return p.x < q.x;", "return a < b;"),
        (VoronoiMethod::Exact, "p.y < q.y || (p.y == q.y && a < b)", "a < b"),
        (VoronoiMethod::Exact, "(east >> 30u) == 1u", "false"),
        (VoronoiMethod::Exact, "!has_western(own)", "true"),
        (VoronoiMethod::Exact, "rows << (4u * local.y)", "rows << (3u * local.y)"),
        (VoronoiMethod::Exact, "BLOCK_SIDE + firstLeadingBit(word)", "BLOCK_SIDE + firstTrailingBit(word)"),
        (VoronoiMethod::Exact, "BLOCK_SIDE + firstTrailingBit(word)", "BLOCK_SIDE + firstLeadingBit(word)"),
        (VoronoiMethod::Exact, "y - s <= n - y", "y - s < n - y"),
        (VoronoiMethod::Exact, "d <= best", "d < best"),
        (VoronoiMethod::Exact, "= FRAME;", "= 0u;"),
        (VoronoiMethod::Jfa, "(d == e && is_before(a, b))", "d == e"),
        (VoronoiMethod::Jfa, "p.x < i32(leaves[leaf].width)", "p.x < i32(leaves[leaf].stride)"),
        (VoronoiMethod::Jfa, "all(p >= vec2i(0))", "p.y >= 0"),
    ] {
        let mut recording = Recording::default();
        recording.upload_atlas(&atlas, &sites);
        recording.write_atlas_sites(&atlas);
        recording.atlas_voronoi(&atlas, method);
        spoil(&mut recording, right, wrong);
        rig.run(&recording);
        let labels = if method == VoronoiMethod::Jfa { &jfa } else { &exact };
        let differs = rig.numbers(BufferId::Texture, written.texture.len() as u64) != written.texture
            || rig.numbers(BufferId::Missing, written.missing.len() as u64) != written.missing
            || rig.numbers(BufferId::Labels, labels.len() as u64) != *labels;
        assert!(differs, "{right}");
    }
}

#[test]
fn the_patches_find_every_error_in_g3() {
    let Some(mut rig) = Rig::new() else { return };
    let patched = Patched::new(3000, 4);
    let mut labels = patched.labels.clone();
    let flags = reference_kernels::atlas::remove_islands(&patched.filled.atlas, &mut labels);
    for (right, wrong) in [
        ("word | (word << 1u)", "word"),
        (" | (word >> 1u)", ""),
        (" | west", ""),
        (" | east;", ";"),
        ("-1, row < 0", "0, row < 0"),
        ("select(0, 1, row > 31)", "0"),
        ("widened(block, row - 1) | ", ""),
        ("if towards.y != 0 &&", "if"),
        ("d == best && is_before(other, colour)", "d == best"),
        ("left != 0u && at < COLOURS", "left != 0u"),
        ("count += countOneBits(atomicLoad(&found[i]))", "count += 0u"),
        ("at += counts[j]", "at += 0u"),
        ("&flags[blocks[block].leaf]", "&flags[0]"),
    ] {
        let mut recording = patched.recording();
        spoil(&mut recording, right, wrong);
        rig.run(&recording);
        let differs = rig.numbers(BufferId::Labels, labels.len() as u64) != labels
            || rig.numbers(BufferId::Flags, flags.len() as u64) != flags;
        assert!(differs, "{right}");
    }
}

#[test]
fn few_dispatches_move_few_bytes() {
    let sites: Vec<Site> = (0..50_000).map(|i| [i % 250 * 97 + i % 7, i / 250 * 89 + i % 5]).collect();
    let clouds: Vec<Cloud> = (0..6).map(|_| Cloud { name: "lattice", sites: sites.clone() }).collect();
    for (pixels_per_site, most) in [(8.0, 220.0), (16.0, 390.0)] {
        let filled = Filled::new(&clouds, pixels_per_site);
        let mut recording = Recording::default();
        recording.upload_atlas(&filled.atlas, &filled.sites);
        recording.write_atlas_sites(&filled.atlas);
        recording.atlas_voronoi(&filled.atlas, VoronoiMethod::Exact);
        recording.remove_atlas_islands(&filled.atlas);
        assert!(recording.commands.iter().all(|c| !matches!(c, GpuCommand::Run(_, _, _, 0))), "all are counted");
        let bytes = recording.traffic() as f64 / (6 * sites.len()) as f64;
        let pixels = f64::from(filled.atlas.pixels) / (6 * sites.len()) as f64;
        eprintln!(
            "{pixels_per_site} pixels a site ({pixels:.2} with frames): {} dispatches, {bytes:.0} bytes a site",
            recording.dispatches()
        );
        assert_eq!(recording.dispatches(), 18);
        assert!(bytes < most, "{bytes}");
    }
}
