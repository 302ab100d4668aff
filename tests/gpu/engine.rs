//! The engine that jobs use: several atlases in flight, each in one submission from its sites to its meshes.

use super::clouds::{clouds, real_cloud};
use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::TextureResolution;
use delaunay_gpu::device::AdapterRequest;
use delaunay_gpu::filled_atlas::{AtlasLimits, FilledAtlas, MAX_PIXELS};
use delaunay_gpu::landed::Landed;
use delaunay_gpu::mesh_engine::{GpuMeshEngine, MAX_IN_FLIGHT, MeshEngine};
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::recording::{GpuCommand, GpuStep, Recording};
use delaunay_gpu::reference_kernels;
use delaunay_gpu::returned::ReturnedAtlas;

/// What comes back may stay in buffers of so many bytes: enough for some atlases of these tests, but not for all.
const LENT: u64 = 1 << 20;

/// Returns an atlas of these leaves, in textures of so many pixels a site.
fn filled<'a>(leaves: impl IntoIterator<Item = &'a [Site]>, pixels_per_site: f64, limits: AtlasLimits) -> FilledAtlas {
    let mut filled = FilledAtlas::default();
    for leaf in leaves {
        assert!(filled.add(leaf, TextureResolution::PixelsPerSite(pixels_per_site), limits), "the atlas is full");
    }
    filled
}

fn uniform(random: &mut Random, count: usize) -> Vec<Site> {
    let mut sites: Vec<Site> = (0..count).map(|_| [0; 2].map(|_: i32| random.below(1 << 20) as i32)).collect();
    sites.sort_unstable();
    sites.dedup();
    sites
}

#[test]
fn three_atlases_in_flight_are_those_of_the_twins() {
    if Rig::new().is_none() {
        return;
    }
    for method in [VoronoiMethod::Exact, VoronoiMethod::Jfa] {
        let mut engine = GpuMeshEngine::open(AdapterRequest::new(None, true), method, LENT).expect("the adapter opens");
        let limits = AtlasLimits::of(&engine.device().limits);
        let mut random = Random(3);
        let leaves: Vec<Vec<Site>> =
            [3, 40, 900, 4000, 70, 2000].map(|count| uniform(&mut random, count)).into_iter().collect();
        let atlases = [&leaves[..1], &leaves[1..4], &leaves[4..]];
        // Slots are used again, for larger and for smaller atlases.
        for turn in 0..2 {
            let atlases: Vec<_> = (0..MAX_IN_FLIGHT)
                .map(|slot| filled(atlases[(slot + turn) % 3].iter().map(Vec::as_slice), 16.0, limits))
                .collect();
            let started = atlases.iter().enumerate().map(|(slot, atlas)| engine.start(slot, atlas));
            let pending: Vec<_> = started.collect::<Result<_, _>>().expect("the steps run");
            for (slot, (atlas, pending)) in atlases.iter().zip(pending).enumerate() {
                let Landed { numbers: returned, times, .. } = engine.finish(slot, pending).expect("they come back");
                let expected = reference_kernels::atlas::mesh(&atlas.atlas, &atlas.sites, method);
                assert!((*returned).as_ref() == expected, "{method:?}, slot {slot}");
                assert!(times.iter().all(|&time| time == 0) || times[GpuStep::Flips as usize] > 0, "{times:?}");
            }
        }
    }
}

/// What an atlas may cost, all steps together.
#[test]
fn an_atlas_is_few_dispatches_and_few_bytes() {
    let limits = AtlasLimits { pixels: 1 << 24, bytes: 1 << 27 };
    let cloud = &clouds().swap_remove(0).sites;
    for (pixels_per_site, most) in [(8.0, 1100.0), (16.0, 1300.0)] {
        let atlas = filled(cloud.chunks(10_000), pixels_per_site, limits);
        let recording = Recording::mesh(&atlas.atlas, &atlas.sites, VoronoiMethod::Exact);
        let up = recording.commands.iter().map(|command| match command {
            GpuCommand::Upload(_, numbers) => 4 * numbers.len() as u64,
            _ => 0,
        });
        let each = |bytes: u64| bytes as f64 / cloud.len() as f64;
        let (dispatches, over_the_bus) = (recording.dispatches(), each(up.sum::<u64>() + atlas.bytes_back()));
        let traffic = each(recording.traffic());
        println!(
            "{pixels_per_site} pixels a site: {dispatches} dispatches, {over_the_bus:.1} bytes a site over the bus, {traffic:.0} in all"
        );
        assert!(dispatches <= 80 && over_the_bus <= 75.0 && traffic <= most);
    }
}

/// What the device leaves of real terrain.
#[test]
fn the_engine_leaves_little_of_real_terrain() {
    let (Some(_), Some(cloud)) = (Rig::new(), real_cloud()) else { return };
    let request = AdapterRequest::new(None, true);
    let mut engine = GpuMeshEngine::open(request, VoronoiMethod::Auto, LENT).expect("the adapter opens");
    let atlas = filled(cloud.sites.chunks(10_000), 16.0, AtlasLimits::of(&engine.device().limits));
    let pending = engine.start(0, &atlas).expect("the steps run");
    let returned = engine.finish(0, pending).expect("they come back").numbers;
    let returned = ReturnedAtlas::new(&atlas.atlas, (*returned).as_ref()).expect("all numbers came back");
    let mut exceptions = 0;
    for leaf in 0..atlas.atlas.leaves.len() {
        let leaf = returned.leaf(leaf).expect("it came back");
        assert_eq!(leaf.flags, 0);
        exceptions += leaf.missing.iter().chain(leaf.unfinished).map(|word| word.count_ones()).sum::<u32>();
    }
    let share = f64::from(exceptions) / cloud.sites.len() as f64;
    println!("exceptions: {:.3} % of the sites", 100.0 * share);
    assert!(share <= 0.002);
}

/// This takes minutes on a software GPU, so it runs only with GDT_TEST_LARGE=1.
#[test]
fn the_largest_atlas_is_that_of_the_twins() {
    let Some(mut rig) = Rig::new() else { return };
    if std::env::var_os("GDT_TEST_LARGE").is_none() {
        return eprintln!("not tested: the largest atlas; set GDT_TEST_LARGE=1");
    }
    let mut random = Random(11);
    let mut atlas = FilledAtlas::default();
    while atlas.add(&uniform(&mut random, 35_000), TextureResolution::PixelsPerSite(16.0), rig.limits()) {}
    // Mesa's software renderer has just less than MAX_PIXELS.
    assert!(atlas.sites.len() > 1_800_000 || rig.limits().pixels < MAX_PIXELS / 2, "{}", atlas.sites.len());
    for comparison in rig.compare(&atlas) {
        assert_eq!(comparison.differing, 0, "{comparison:?}");
    }
}
