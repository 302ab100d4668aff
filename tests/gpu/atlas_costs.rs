//! What an atlas costs: dispatches, bytes, and what the device leaves to the CPU.

use super::atlas_mesh::{assert_whole, compare};
use super::clouds::{clouds, real_cloud};
use super::placed::{PlacedAtlas, recorded};
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay_gpu::mesh_steps::FLIP_ROUNDS;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels::atlas::make_triangles;
use delaunay_gpu::reference_kernels::c4_flip::{FlipState, flip_round};
use delaunay_gpu::returned::{ReturnedAtlas, ReturnedLayout};

/// What the device leaves of a real cloud is rare.
#[test]
fn real_terrain_has_few_exceptions() {
    let (Some(mut rig), Some(cloud)) = (Rig::new(), real_cloud()) else { return };
    for (pixels_per_site, most) in [(5.0, 0.006), (8.0, 0.002), (16.0, 0.001)] {
        let (west, east) = cloud.sites.split_at(cloud.sites.len() / 2);
        let placed = PlacedAtlas::new([west, east], pixels_per_site);
        let twins = compare(&mut rig, cloud.name, &placed);
        assert_whole(cloud.name, &placed, &twins);
        let returned = ReturnedAtlas::new(&placed.atlas, &twins.returned).expect("all numbers came back");
        let leaves: Vec<_> = (0..2).map(|leaf| returned.leaf(leaf).expect("it came back")).collect();
        let bits = |words: &[u32]| words.iter().map(|word| word.count_ones()).sum::<u32>();
        let missing: u32 = leaves.iter().map(|leaf| bits(leaf.missing)).sum();
        let unfinished: u32 = leaves.iter().map(|leaf| bits(leaf.unfinished)).sum();
        let share = |count: u32| f64::from(count) / cloud.sites.len() as f64;
        eprintln!(
            "{pixels_per_site} pixels a site: missing {:.3} %, unfinished {:.3} % of the sites",
            100.0 * share(missing),
            100.0 * share(unfinished)
        );
        assert!(share(missing + unfinished) <= most);
    }
}

/// The rounds of flips read all triangles once. What they do after that is little.
#[test]
fn the_rounds_move_few_bytes_for_a_site() {
    let Some(cloud) = real_cloud() else { return };
    for pixels_per_site in [8.0, 16.0] {
        let placed = PlacedAtlas::new([cloud.sites.as_slice()], pixels_per_site);
        let triangles = placed.atlas.records;
        let mut state = FlipState::new(make_triangles(placed.diagram(), &mut [0]));
        let (mut dirty, mut flips) = (0, 0);
        for round in 1..=FLIP_ROUNDS {
            let marks = &state.marks[state.sections().dirty(round)];
            dirty += if round == 1 { 0 } else { marks.iter().map(|word| word.count_ones()).sum::<u32>() };
            flip_round(&mut state, &placed.sites, round);
            let is_flipped = |record: &&[u32]| record[3] >> 2 == round;
            flips += state.records.chunks_exact(8).filter(is_flipped).count() as u32 / 2;
        }
        let mut recording = Recording::default();
        recording.flip(triangles);
        // A dirty triangle takes its record, the corners of three neighbours and six sites. A flip takes two records, to read and to
        // write, and the notes and links of four neighbours.
        let moved = recording.traffic() + 128 * u64::from(dirty) + 192 * u64::from(flips);
        let each = |count: u64| count as f64 / cloud.sites.len() as f64;
        eprintln!(
            "{pixels_per_site} pixels a site: {:.2} dirty triangles and {:.2} flips a site; {:.0} bytes declared, {:.0} in all",
            each(u64::from(dirty)),
            each(u64::from(flips)),
            each(recording.traffic()),
            each(moved)
        );
        assert!(each(moved) <= 350.0);
    }
}

#[test]
fn all_steps_are_few_fixed_dispatches_with_little_traffic() {
    let sites: Vec<Site> = clouds().swap_remove(0).sites;
    for (pixels_per_site, most, most_in_all) in [(8.0, 320.0, 1100.0), (16.0, 420.0, 1300.0)] {
        let placed = PlacedAtlas::new([sites.as_slice()], pixels_per_site);
        let mut recording = recorded(&placed);
        assert!(recording.dispatches() <= 80);
        assert!(recording.commands.iter().all(|c| !matches!(c, GpuCommand::Run(_, _, _, 0))), "all are counted");
        let each = |bytes: u64| bytes as f64 / sites.len() as f64;
        let (all, dispatches) = (each(recording.traffic()), recording.dispatches());
        // Up go the sites and the tables.
        let uploads = recording.commands.iter().map(|command| match command {
            GpuCommand::Upload(_, numbers) => 4 * numbers.len() as u64,
            _ => 0,
        });
        let up = each(uploads.sum());
        recording.commands.clear();
        recording.flip(placed.atlas.records);
        let flips = each(recording.traffic());
        recording.commands.clear();
        recording.atlas_mesh(&placed.atlas);
        let own = each(recording.traffic()) - flips;
        let back = each(4 * ReturnedLayout::of(&placed.atlas).numbers() as u64);
        eprintln!(
            "{pixels_per_site} pixels a site: {dispatches} dispatches, {all:.0} bytes of traffic a site, {flips:.0} by flips, {own:.0} by \
             G4 to G6 and the return; {up:.2} bytes go up, {back:.2} come back"
        );
        // The rounds of flips may take 350 bytes; what they declare is less.
        assert!(all - flips + 350.0 <= most_in_all && own <= most);
        assert!(up + back <= 75.0);
    }
}
