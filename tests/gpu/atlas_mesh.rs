//! Steps G4 to G6 in an atlas and what goes back: shader against twin, number by number, and whether the meshes are whole.

use super::clouds::{Cloud, clouds, hard_clouds};
use super::flips::Flipped;
use super::placed::{PlacedAtlas, recorded};
use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::TextureResolution;
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::leaf_flags::{LONG_EDGE, TOO_MANY_TRIANGLES};
use delaunay_gpu::mesh_steps::FLIP_ROUNDS;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels::atlas::{MeshOnDevice, count, find_vertices, give_back, make_triangles};
use delaunay_gpu::reference_kernels::c4_flip::{FlipState, flip_round};
use delaunay_gpu::returned::ReturnedAtlas;
use std::collections::BTreeSet;

const FREE: u32 = u32::MAX;

/// Runs what `record` records; asserts that buffer `id` has the `expected` numbers then.
fn assert_same(rig: &mut Rig, name: &str, recording: &mut Recording, results: &[(BufferId, &[u32])]) {
    rig.run(recording);
    recording.commands.clear();
    for &(id, expected) in results {
        let numbers = rig.numbers(id, expected.len() as u64);
        let differing = (0..expected.len()).find(|&i| numbers[i] != expected[i]);
        assert_eq!(differing.map(|i| (i, numbers[i], expected[i])), None, "{name}: {id:?}");
    }
}

/// What the twins make of an atlas.
pub(crate) struct Twins {
    records: Vec<u32>,
    flipped: FlipState,
    flags: Vec<u32>,
    pub(crate) returned: Vec<u32>,
}

/// Runs all steps on the device and as twins, and compares all numbers.
pub(crate) fn compare(rig: &mut Rig, name: &str, placed: &PlacedAtlas) -> Twins {
    let (atlas, mut recording) = (&placed.atlas, placed.upload());
    // What was there before must not matter.
    for (id, numbers) in [(BufferId::Records, 8 * atlas.records), (BufferId::BlockStarts, 2 * atlas.blocks + 2)] {
        recording.commands.push(GpuCommand::Reserve(id, 4 * u64::from(numbers)));
        recording.commands.push(GpuCommand::Upload(id, vec![0x5555_5555; numbers as usize]));
    }
    let (rows, counts) = find_vertices(placed.diagram());
    recording.atlas_vertices(atlas);
    assert_same(rig, name, &mut recording, &[(BufferId::CornerRows, &rows), (BufferId::BlockStarts, &counts)]);
    let starts = count(&counts);
    recording.atlas_count(atlas);
    assert_same(rig, name, &mut recording, &[(BufferId::BlockStarts, &starts)]);
    let mut flags = placed.flags.clone();
    let records = make_triangles(placed.diagram(), &mut flags);
    recording.atlas_triangles(atlas);
    assert_same(rig, name, &mut recording, &[(BufferId::Records, &records), (BufferId::Flags, &flags)]);
    let mut flipped = FlipState::new(records.clone());
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut flipped, &placed.sites, round));
    recording.flip(atlas.records);
    let results = [(BufferId::Records, flipped.records.as_slice()), (BufferId::Marks, &flipped.marks)];
    assert_same(rig, name, &mut recording, &results);
    let mesh = MeshOnDevice {
        records: &flipped.records,
        marks: &flipped.marks,
        missing: &placed.missing,
        starts: &starts,
        flags: &flags,
    };
    let returned = give_back(atlas, mesh);
    recording.give_back(atlas);
    assert_same(rig, name, &mut recording, &[(BufferId::Returned, &returned)]);
    Twins { records, flipped, flags, returned }
}

/// Asserts that the records of every leaf close a sphere over its placed sites, before the flips and after, and come back as they are.
pub(crate) fn assert_whole(name: &str, placed: &PlacedAtlas, twins: &Twins) {
    let flagged: Vec<_> = (0..twins.flags.len()).filter(|&leaf| twins.flags[leaf] != 0).collect();
    assert!(flagged.is_empty(), "{name}: flagged {flagged:?}, the first is {:?}", placed.atlas.leaves[flagged[0]]);
    for records in [&twins.records, &twins.flipped.records] {
        Flipped { records, sites: &placed.sites }.assert_linked(name);
    }
    let returned = ReturnedAtlas::new(&placed.atlas, &twins.returned).expect("all numbers came back");
    for (i, leaf) in placed.atlas.leaves.iter().enumerate() {
        let back = returned.leaf(i).expect("the leaf came back");
        assert_eq!(back.flags, 0, "{name}, leaf {i}");
        let is_missing = |site: usize| back.missing[site / 32] >> (site % 32) & 1 != 0;
        let has_bit = |at: usize| placed.missing[at / 32] >> (at % 32) & 1 != 0;
        assert!((0..leaf.sites as usize).all(|site| is_missing(site) == has_bit(leaf.first_site as usize + site)));
        let missing = (0..leaf.sites as usize).filter(|&site| is_missing(site)).count();
        let on_sphere = leaf.sites as usize - missing + 1;
        assert_eq!(back.records.len() / 8, 2 * on_sphere - 4, "{name}, leaf {i}");
        let mut used = BTreeSet::<u32>::new();
        for (t, record) in back.records.chunks_exact(8).enumerate() {
            used.extend(&record[..3]);
            assert!(record[3] == 0 && record[7] == 0);
            for i in 0..3 {
                let twin = record[4 + i] as usize;
                assert_eq!(back.records[twin + 4] as usize, 8 * t + i, "{name}: triangle {t}");
            }
        }
        let expected = (0..=leaf.sites).filter(|&site| site == leaf.sites || !is_missing(site as usize));
        assert!(used.into_iter().eq(expected), "{name}, leaf {i}: other sites have triangles");
        assert_eq!(back.block_starts.len() as u32, leaf.blocks_x() * leaf.blocks_y());
        assert!(back.block_starts.is_sorted() && back.block_starts[0] == 0);
        assert_starts_are_near(placed, i, &twins.records, back.block_starts);
    }
}

/// Asserts that the first triangle of a block, as step G6 makes it, has a site not far from the block.
fn assert_starts_are_near(placed: &PlacedAtlas, leaf: usize, records: &[u32], starts: &[u32]) {
    let leaf = &placed.atlas.leaves[leaf];
    for (block, pair) in starts.windows(2).enumerate().filter(|(_, pair)| pair[0] < pair[1]) {
        let [x, y] = [block as u32 % leaf.blocks_x(), block as u32 / leaf.blocks_x()].map(|i| 32 * i);
        let first = 8 * (leaf.first_record + pair[0]) as usize;
        let pixels = records[first..first + 3]
            .iter()
            .filter(|&&v| v != leaf.first_site + leaf.sites)
            .map(|&v| leaf.pixel(placed.sites[v as usize]));
        let distance = pixels.map(|[px, py]| px.abs_diff(x).max(py.abs_diff(y))).min().expect("a finite corner");
        assert!(distance < leaf.width.max(leaf.height).min(200), "block {block}: {distance}");
    }
}

/// Leaves of few sites, thin leaves and lattices whose textures just fill their blocks, or just do not.
fn small_leaves() -> Vec<Vec<Site>> {
    let mut random = Random(17);
    let far = delaunay::geometry::REACH;
    let mut leaves = vec![
        vec![[0, 0], [5, 5], [9, 0]],
        vec![[3, 3], [4, 3], [3, 4]],
        vec![[-far, -far], [far, far], [-far, far]],
        vec![[7, 0], [8, 0], [9, 0]],
        vec![[7, 0], [7, 1], [7, 2]],
        (0..100).map(|i| [i * i, 0]).collect(),
        (0..100).map(|i| [1000, i * 3]).collect(),
        (0..200).map(|i| [i * 5, i * 5]).collect(),
        (0..200).map(|i| [i * 7, 900 - i * 3]).collect(),
        (0..500).map(|i| [i, random.below(2) as i32]).collect(),
    ];
    for side in [30, 31, 32, 33, 63, 64, 65] {
        leaves.push((0..side * side).map(|i| [i % side, i / side]).collect());
        leaves.push((0..side).map(|i| [i, (i * 7) % 10]).collect());
    }
    for count in [3, 4, 5, 8, 31, 32, 33, 100, 1000] {
        let sites: BTreeSet<Site> = (0..count)
            .map(|_| [random.below(1 << 20) as i32 + far - (1 << 21), random.below(1 << 18) as i32 - far])
            .collect();
        leaves.push(sites.into_iter().collect());
    }
    leaves
}

/// Sites of a texture one pixel high.
const THREE: [Site; 3] = [[0, 0], [1 << 20, 1], [1 << 21, 0]];

/// Adds leaves whose pixels have any colours, so that there are corners of every shape.
fn add_patchworks(placed: &mut PlacedAtlas) {
    let first = placed.atlas.leaves.len();
    (0..30).for_each(|_| placed.add(&[[0, 0], [4, 0], [0, 4], [4, 4]], TextureResolution::Side(5)));
    placed.place();
    let mut random = Random(23);
    for leaf in &placed.atlas.leaves[first..] {
        for (x, y) in (0..25).map(|i| (i % 5, i / 5)) {
            placed.labels[leaf.at(x, y) as usize] = ((4 * random.below(2)) << 16) | (4 * random.below(2));
        }
    }
}

#[test]
fn every_shape_of_corner_is_linked() {
    let Some(mut rig) = Rig::new() else { return };
    let mut placed = PlacedAtlas::default();
    add_patchworks(&mut placed);
    let twins = compare(&mut rig, "patchworks", &placed);
    assert!(twins.flags.iter().all(|&flags| flags == 0));
    for records in [&twins.records, &twins.flipped.records] {
        Flipped { records, sites: &placed.sites }.assert_linked("patchworks");
    }
}

#[test]
fn small_and_thin_leaves_are_the_same_bit_for_bit() {
    let Some(mut rig) = Rig::new() else { return };
    for pixels_per_site in [1.0, 5.0, 16.0] {
        let leaves = small_leaves();
        let placed = PlacedAtlas::new(leaves.iter().map(Vec::as_slice), pixels_per_site);
        let twins = compare(&mut rig, "small leaves", &placed);
        assert_whole("small leaves", &placed, &twins);
    }
}

#[test]
fn large_leaves_are_the_same_bit_for_bit() {
    let Some(mut rig) = Rig::new() else { return };
    let clouds: Vec<Cloud> = clouds().into_iter().chain(hard_clouds()).collect();
    for pixels_per_site in [5.0, 8.0] {
        let placed = PlacedAtlas::new(clouds.iter().map(|cloud| cloud.sites.as_slice()), pixels_per_site);
        let twins = compare(&mut rig, "large leaves", &placed);
        assert_whole("large leaves", &placed, &twins);
    }
}

/// A leaf that goes wrong is flagged, and the leaves beside it are as if they were alone.
#[test]
fn a_bad_leaf_is_flagged_and_harms_no_other() {
    let Some(mut rig) = Rig::new() else { return };
    let sites: Vec<Vec<Site>> = clouds().into_iter().map(|cloud| cloud.sites[..2000].to_vec()).collect();
    let mut placed = PlacedAtlas::default();
    let pixels = TextureResolution::PixelsPerSite;
    placed.add(&sites[0], pixels(5.0));
    placed.add(&THREE, TextureResolution::Side(16_000));
    placed.add(&sites[1], pixels(5.0));
    placed.add(&sites[2], pixels(5.0));
    placed.add(&sites[3], pixels(8.0));
    placed.place();
    // Leaf 3 is all noise.
    let noisy = placed.atlas.leaves[3];
    let pixels: Vec<u32> = sites[2].iter().map(|&site| noisy.pixel(site)).map(|[x, y]| y << 16 | x).collect();
    let mut random = Random(5);
    for y in 0..noisy.height {
        for x in 0..noisy.width {
            placed.labels[noisy.at(x, y) as usize] = pixels[random.below(pixels.len() as u32) as usize];
        }
    }
    let twins = compare(&mut rig, "bad leaves", &placed);
    assert_eq!(twins.flags, [0, LONG_EDGE, 0, TOO_MANY_TRIANGLES, 0]);
    let returned = ReturnedAtlas::new(&placed.atlas, &twins.returned).expect("all numbers came back");
    assert!(returned.leaf(3).expect("it came back").records.is_empty());
    let long = returned.leaf(1).expect("it came back");
    assert_eq!(long.records.len(), 4 * 8);
    assert!(long.records.contains(&FREE), "no edge was too long");
    for (leaf, cloud, pixels_per_site) in [(0, 0, 5.0), (2, 1, 5.0), (4, 3, 8.0)] {
        let alone = PlacedAtlas::new([sites[cloud].as_slice()], pixels_per_site);
        let expected = make_triangles(alone.diagram(), &mut [0]);
        assert!(relative(&placed, &twins.records, leaf) == relative(&alone, &expected, 0), "leaf {leaf}");
    }
}

/// Returns the records of a leaf as if it were alone.
fn relative(placed: &PlacedAtlas, records: &[u32], leaf: usize) -> Vec<u32> {
    let leaf = &placed.atlas.leaves[leaf];
    let own = &records[8 * leaf.first_record as usize..][..8 * leaf.records() as usize];
    let base = |i: usize| [leaf.first_site, 8 * leaf.first_record][i / 4 % 2];
    let shifted = |(i, &number): (usize, &u32)| if number == FREE || i % 4 == 3 { number } else { number - base(i) };
    own.iter().enumerate().map(shifted).collect()
}

/// Each line of the shaders that a rare shape depends on is spoilt in turn: the small leaves show it.
#[test]
fn the_small_leaves_find_every_error_in_the_shaders() {
    let Some(mut rig) = Rig::new() else { return };
    let leaves = small_leaves();
    let mut placed = PlacedAtlas::new(leaves.iter().map(Vec::as_slice), 2.0);
    // More than 1024 blocks.
    (0..3).for_each(|_| placed.add(&THREE, TextureResolution::Side(16_000)));
    add_patchworks(&mut placed);
    let twins = compare(&mut rig, "small leaves", &placed);
    let expected = twins.returned;
    let mut alive = Vec::new();
    for (right, wrong) in [
        ("x + i % TILE_SIDE - 1u", "x + i % TILE_SIDE"),
        ("x >= leaf.width ||", "x > leaf.width ||"),
        ("|| y >= leaf.height", "|| y > leaf.height"),
        ("|| colours.y == colours.w", ""),
        ("orientation(a, c, d) > 0", "true"),
        ("!in_circle(a, b, c, d)", "in_circle(a, b, c, d)"),
        ("i < group;", "i <= group;"),
        ("arm - u32(missing < arm)", "arm - u32(missing > arm)"),
        ("vec4u(0u, 1u, 9u, 10u)", "vec4u(0u, 8u, 9u, 2u)"),
        ("ahead_right != left || is_across", "ahead_right != left || !is_across"),
        ("ahead_left != right || !is_across", "ahead_left != right || is_across"),
        ("(arm + 1u) & 3u, ahead_left == left", "(arm + 3u) & 3u, ahead_left == left"),
        ("8u * number - 6u", "8u * number - 7u"),
        ("8u * number + 10u", "8u * number + 9u"),
        ("cut = (missing + 3u) & 3u", "cut = (missing + 1u) & 3u"),
        ("(lane & 1u) != 0u", "(lane & 2u) != 0u"),
        ("if at % 32u != 0u", "if at % 32u == 0u"),
        ("32u - min(leaf.sites - first, 32u)", "0u"),
        ("| marks[3u * bit_params.record_words + i]", ""),
        ("starts[i] - before", "starts[i]"),
    ] {
        let (mut recording, mut found) = (placed.upload(), 0);
        recording.atlas_mesh(&placed.atlas);
        for command in &mut recording.commands {
            if let GpuCommand::Run(program, ..) = command
                && program.file.starts_with("atlas/")
                && program.source.contains(right)
            {
                found += 1;
                program.source = program.source.replace(right, wrong).leak();
            }
        }
        assert!(found > 0, "{right}");
        rig.run(&recording);
        let returned = rig.numbers(BufferId::Returned, expected.len() as u64);
        let differing = returned.iter().zip(&expected).filter(|(a, b)| a != b).count();
        eprintln!("{right}: {differing}");
        alive.extend((differing == 0).then_some(right));
    }
    assert!(alive.is_empty(), "nothing shows these errors: {alive:?}");
}

/// Leaves of the same sites, near and far: what the rounds of flips do to one has nothing to do with the others.
#[test]
fn flips_stay_within_their_leaf() {
    let far = delaunay::geometry::REACH;
    let cloud = clouds().into_iter().find(|cloud| cloud.name == "coarse").expect("there is such a cloud");
    let near: Vec<Site> = cloud.sites[..3000].to_vec();
    let moved = |by: i32| near.iter().map(|&[x, y]| [x - by, y + by - (1 << 21)]).collect::<Vec<_>>();
    let leaves = [near.clone(), near.clone(), moved(far), moved(-far + (1 << 21)), near.clone()];
    let placed = PlacedAtlas::new(leaves.iter().map(Vec::as_slice), 5.0);
    let mut state = FlipState::new(make_triangles(placed.diagram(), &mut [0; 5]));
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut state, &placed.sites, round));
    let mut meshes = BTreeSet::new();
    for leaf in 0..5 {
        let records = relative(&placed, &state.records, leaf);
        let corners = records.chunks_exact(8).filter(|record| record[0] != FREE).map(|record| {
            let [a, b, c] = [record[0], record[1], record[2]];
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("three of them")
        });
        meshes.insert(corners.collect::<BTreeSet<_>>());
        assert!(records.chunks_exact(8).flat_map(|record| &record[..3]).all(|&v| v == FREE || v <= 3000));
    }
    assert_eq!(meshes.len(), 1, "leaves of the same sites have other meshes");
}

#[test]
fn one_submission_from_sites_to_meshes_gives_what_the_twins_give() {
    let Some(mut rig) = Rig::new() else { return };
    let clouds = clouds();
    let small = small_leaves();
    let leaves = clouds.iter().map(|cloud| cloud.sites.as_slice()).chain(small.iter().map(Vec::as_slice));
    let placed = PlacedAtlas::new(leaves, 8.0);
    let expected = compare(&mut rig, "all leaves", &placed).returned;
    rig.run(&recorded(&placed));
    assert!(rig.numbers(BufferId::Returned, expected.len() as u64) == expected);
}
