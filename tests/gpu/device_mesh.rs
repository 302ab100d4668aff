//! Leaves whose mesh a device has made: the same mesh as without it, whatever the device returns.

use super::clouds::{clouds, hard_clouds, real_cloud};
use super::instant::Answer;
use super::random::Random;
use delaunay::geometry::REACH;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::mesh::index::HalfEdgeIndex;
use delaunay::triangulation::canonical;
use delaunay::voronoi::PipelineBuffers;
use delaunay::voronoi::rejection::Rejection;
use std::collections::{BTreeSet, HashMap};

const UNUSED: u32 = u32::MAX;

/// Returns the set of triangles, each from its least corner.
fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.corners().iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()).collect()
}

fn on_cpu(sites: &[Site]) -> BTreeSet<[u32; 3]> {
    triangles(&canonical(sites).unwrap())
}

/// Asserts that every half-edge of the mesh has the twin that its triangles say.
fn assert_linked(mesh: &HalfEdgeMesh) {
    let ends: HashMap<_, _> = mesh.half_edges().map(|h| ([mesh.origin(h), mesh.destination(h)], h)).collect();
    for h in mesh.half_edges() {
        let back = ends.get(&[mesh.destination(h), mesh.origin(h)]);
        assert_eq!(back.copied().unwrap_or(HalfEdgeIndex::HULL), mesh.twin(h));
    }
}

#[test]
fn a_device_gives_the_same_mesh_as_the_cpu() {
    let mut buffers = PipelineBuffers::default();
    let (mut missing, mut inverted) = (0, 0);
    for cloud in clouds().into_iter().chain(real_cloud()) {
        let expected = on_cpu(&cloud.sites);
        for pixels_per_site in [8.0, 16.0] {
            let answer = Answer::new(&cloud.sites, pixels_per_site);
            let (mesh, counts) = match answer.complete(&cloud.sites, &mut buffers) {
                Err(Rejection::Crowded) if cloud.name == "clusters" => continue,
                done => done.unwrap_or_else(|why| panic!("{}: {why}", cloud.name)),
            };
            assert!(triangles(&mesh) == expected, "{} at {pixels_per_site} pixels a site", cloud.name);
            assert_linked(&mesh);
            (missing, inverted) = (missing + counts.missing, inverted + counts.inverted);
            buffers.recycle(mesh);
        }
    }
    assert!(missing > 100 && inverted > 10, "the clouds are too easy: {missing} missing, {inverted} inverted");
}

#[test]
fn hard_clouds_give_the_same_mesh_or_are_rejected() {
    let mut buffers = PipelineBuffers::default();
    let mut accepted = 0;
    for cloud in hard_clouds() {
        match Answer::new(&cloud.sites, 16.0).complete(&cloud.sites, &mut buffers) {
            Ok((mesh, _)) => {
                accepted += 1;
                assert!(triangles(&mesh) == on_cpu(&cloud.sites), "{}", cloud.name);
            }
            Err(why) => println!("{}: {why}", cloud.name),
        }
    }
    assert!(accepted > 0);
}

#[test]
fn the_least_leaves_need_no_cpu_alone() {
    let mut buffers = PipelineBuffers::default();
    let leaves: [&[Site]; 5] = [
        &[[0, 0], [9, 1], [3, 8]],
        &[[0, 0], [9, 0], [0, 9], [9, 9]],
        &[[-REACH, -REACH], [REACH, -REACH], [0, REACH], [0, 0]],
        &[[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [2, 1]],
        &[[0, 0], [0, 1], [0, 2], [0, 3], [0, 4], [1, 2]],
    ];
    for sites in leaves {
        let (mesh, _) =
            Answer::new(sites, 16.0).complete(sites, &mut buffers).unwrap_or_else(|why| panic!("{sites:?}: {why}"));
        assert!(triangles(&mesh) == on_cpu(sites), "{sites:?}");
    }
}

#[test]
fn what_no_device_can_do_is_rejected() {
    let mut buffers = PipelineBuffers::default();
    let mut random = Random(3);
    let sites = uniform(&mut random, 500);
    let answer = Answer::new(&sites, 12.0);
    let mut reject = |sites: &[Site], answer: &Answer| answer.complete(sites, &mut buffers).unwrap_err();
    assert_eq!(reject(&sites[..2], &answer), Rejection::TooFew);
    let mut all_missing = answer.clone();
    all_missing.missing.fill(u32::MAX);
    assert_eq!(reject(&sites, &all_missing), Rejection::Crowded);
    let mut empty = answer.clone();
    empty.records.fill(UNUSED);
    assert!(matches!(reject(&sites, &empty), Rejection::NotAccepted(_)));
    let mut far = sites.clone();
    far[7] = [i32::MIN, i32::MAX];
    assert_eq!(reject(&far, &answer), Rejection::OutOfReach);
    let mut twice = sites.clone();
    twice[7] = twice[8];
    assert!(matches!(reject(&twice, &answer), Rejection::NotAccepted(_)));
}

fn uniform(random: &mut Random, count: usize) -> Vec<Site> {
    let sites: BTreeSet<Site> = (0..count).map(|_| [(); 2].map(|()| random.below(100_000) as i32)).collect();
    sites.into_iter().collect()
}

/// Sites in a few heaps, so that some are missing and the hull has pockets.
fn heaps(random: &mut Random, count: usize) -> Vec<Site> {
    let centres: Vec<Site> = (0..5).map(|_| [(); 2].map(|()| random.below(50_000) as i32)).collect();
    let near = |c: i32, random: &mut Random| c + (0..4).map(|_| random.below(1000) as i32).sum::<i32>();
    let sites: BTreeSet<Site> = (0..count).map(|i| centres[i % 5].map(|c| near(c, random))).collect();
    sites.into_iter().collect()
}

/// A way in which a device may go wrong.
type Fault = fn(&mut Answer, &mut Random);

fn pick(random: &mut Random, length: usize) -> usize {
    random.below(length.max(1) as u32) as usize
}

/// Returns a half-edge of a triangle.
fn pick_half_edge(answer: &Answer, random: &mut Random) -> usize {
    loop {
        let h = 8 * pick(random, answer.records.len() / 8) + pick(random, 3);
        if answer.records[h & !7] != UNUSED {
            return h;
        }
    }
}

fn next(h: usize) -> usize {
    if h % 8 == 2 { h - 2 } else { h + 1 }
}

/// Flips an edge as C4 does, whether that is right or wrong.
fn flip(records: &mut [u32], h: usize) {
    let g = records[h + 4] as usize;
    let (h_next, g_next) = (next(h), next(g));
    let (h_apex, g_apex) = (records[next(h_next)], records[next(g_next)]);
    if h_apex == g_apex {
        return;
    }
    let (outer_h, outer_g) = (records[h_next + 4] as usize, records[g_next + 4] as usize);
    records[h_next] = g_apex;
    records[g_next] = h_apex;
    for (a, b) in [(h, outer_g), (g, outer_h), (h_next, g_next)] {
        records[a + 4] = b as u32;
        records[b + 4] = a as u32;
    }
}

fn any_number(answer: &mut Answer, random: &mut Random) {
    for _ in 0..=random.below(5) {
        let at = pick(random, answer.records.len());
        answer.records[at] = random.below(u32::MAX);
    }
}

fn number_of_another(answer: &mut Answer, random: &mut Random) {
    for _ in 0..=random.below(5) {
        let (from, to) = (pick(random, answer.records.len()), pick(random, answer.records.len()));
        answer.records[to] = answer.records[from];
    }
}

fn crossed_links(answer: &mut Answer, random: &mut Random) {
    let [g, h] = [(); 2].map(|()| pick_half_edge(answer, random));
    let [to_g, to_h] = [g, h].map(|h| answer.records[h + 4] as usize);
    for (a, b) in [(g, to_h), (h, to_g)] {
        answer.records[a + 4] = b as u32;
        answer.records[b + 4] = a as u32;
    }
}

fn lost_triangles(answer: &mut Answer, random: &mut Random) {
    for _ in 0..=random.below(3) {
        let t = pick_half_edge(answer, random) & !7;
        answer.records[t] = UNUSED;
        // A record without a triangle has any twins.
        if random.below(2) == 0 {
            answer.records[t + 4..t + 7].fill(UNUSED);
        }
    }
}

fn two_sites_exchanged(answer: &mut Answer, random: &mut Random) {
    let [a, b] = [(); 2].map(|()| answer.records[pick_half_edge(answer, random)]);
    for corner in answer.records.chunks_exact_mut(8).flat_map(|record| &mut record[..3]) {
        *corner = if *corner == a {
            b
        } else if *corner == b {
            a
        } else {
            *corner
        };
    }
}

fn sites_shuffled(answer: &mut Answer, random: &mut Random) {
    let last = answer.records.chunks_exact(8).flat_map(|record| &record[..3]).filter(|&&v| v != UNUSED).max().unwrap();
    let mut numbers: Vec<u32> = (0..=*last).collect();
    for i in (1..numbers.len()).rev() {
        numbers.swap(i, random.below(i as u32 + 1) as usize);
    }
    for corner in answer.records.chunks_exact_mut(8).flat_map(|record| &mut record[..3]).filter(|v| **v != UNUSED) {
        *corner = numbers[*corner as usize];
    }
}

/// Makes wrong flips: all numbers fit together, but the surface is folded.
fn wrong_flips(answer: &mut Answer, random: &mut Random) {
    let most = [3, 30, 300, 3000][pick(random, 4)];
    let is_told = random.below(2) == 0;
    for _ in 0..=random.below(most) {
        let h = pick_half_edge(answer, random);
        if is_told {
            for t in [h / 8, answer.records[h + 4] as usize / 8] {
                answer.unfinished[t / 32] |= 1 << (t % 32);
            }
        }
        flip(&mut answer.records, h);
    }
}

/// Flips ever more edges to one vertex.
fn one_vertex_in_many_triangles(answer: &mut Answer, random: &mut Random) {
    answer.unfinished.fill(u32::MAX);
    let mut h = next(pick_half_edge(answer, random));
    for _ in 0..random.below(1000) {
        flip(&mut answer.records, h);
        h = next(next(h));
        let g = answer.records[h + 4] as usize;
        h = next(next(next(g)));
    }
}

fn other_missing_sites(answer: &mut Answer, random: &mut Random) {
    for _ in 0..=random.below(40) {
        let at = pick(random, answer.missing.len());
        answer.missing[at] ^= 1 << random.below(32);
    }
}

fn nothing_unfinished(answer: &mut Answer, _: &mut Random) {
    answer.unfinished.fill(0);
}

fn all_unfinished(answer: &mut Answer, _: &mut Random) {
    answer.unfinished.fill(u32::MAX);
}

fn wrong_block_starts(answer: &mut Answer, random: &mut Random) {
    let end = [10, answer.records.len() as u32, u32::MAX][pick(random, 3)];
    answer.block_starts.iter_mut().for_each(|start| *start = random.below(end));
}

fn cut_short(answer: &mut Answer, random: &mut Random) {
    let Answer { records, missing, unfinished, block_starts, .. } = answer;
    let list = [records, missing, unfinished, block_starts].into_iter().nth(pick(random, 4)).unwrap();
    let (most, back) = (list.len(), random.below(20) as usize);
    let length = if random.below(2) == 0 { most.saturating_sub(back) } else { pick(random, most) };
    list.truncate(length);
}

fn too_long(answer: &mut Answer, random: &mut Random) {
    let end = answer.records.len() as u32;
    answer.records.extend((0..random.below(100)).map(|_| random.below(end)));
    answer.unfinished.resize(answer.records.len().div_ceil(256), 0);
}

const FAULTS: [(&str, Fault); 15] = [
    ("any number", any_number),
    ("number of another", number_of_another),
    ("crossed links", crossed_links),
    ("lost triangles", lost_triangles),
    ("two sites exchanged", two_sites_exchanged),
    ("sites shuffled", sites_shuffled),
    ("wrong flips", wrong_flips),
    ("one vertex in many triangles", one_vertex_in_many_triangles),
    ("other missing sites", other_missing_sites),
    ("nothing unfinished", nothing_unfinished),
    ("all unfinished", all_unfinished),
    ("wrong block starts", wrong_block_starts),
    ("cut short", cut_short),
    ("too long", too_long),
    ("wrong flips and missing sites", |answer, random| {
        wrong_flips(answer, random);
        other_missing_sites(answer, random);
        wrong_block_starts(answer, random);
    }),
];

/// Corrupts answers in every way, and asserts that the mesh is right or rejected. Prints what becomes of them.
#[test]
fn a_device_that_goes_wrong_never_makes_a_wrong_mesh() {
    let mut random = Random(0x5eed);
    let mut buffers = PipelineBuffers::default();
    let (mut accepted, mut rejected) = (0, 0);
    let cases = [(4, 16.0, 200), (12, 8.0, 200), (60, 3.0, 200), (400, 12.0, 50), (1500, 6.0, 20)];
    for (count, pixels_per_site, rounds) in cases {
        for sites in [uniform(&mut random, count), heaps(&mut random, count)] {
            let (expected, answer) = (on_cpu(&sites), Answer::new(&sites, pixels_per_site));
            for (name, fault) in FAULTS {
                for _ in 0..rounds {
                    let mut wrong = answer.clone();
                    fault(&mut wrong, &mut random);
                    match wrong.complete(&sites, &mut buffers) {
                        Ok((mesh, _)) => {
                            assert!(triangles(&mesh) == expected, "{name}, {} sites", sites.len());
                            accepted += 1;
                            buffers.recycle(mesh);
                        }
                        Err(_) => rejected += 1,
                    }
                }
            }
        }
    }
    println!("{accepted} accepted, {rejected} rejected");
    assert!(accepted > 500 && rejected > 500, "{accepted} accepted, {rejected} rejected");
}
