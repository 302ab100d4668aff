//! Rounds of flips: shader against twin after every round, and what the rounds leave.

use super::clouds::{Cloud, clouds, hard_clouds, real_cloud};
use super::linked::LinkedMesh;
use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::{in_circle, orient2d};
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::mesh_steps::FLIP_ROUNDS;
use delaunay_gpu::recording::{GpuCommand, Recording};
use delaunay_gpu::reference_kernels::c4_flip::{AT_INFINITY, FlipState, flip_round};
use std::collections::BTreeSet;

const FREE: u32 = u32::MAX;

/// A mesh after the rounds, or before them.
pub(crate) struct Flipped<'a> {
    pub(crate) records: &'a [u32],
    pub(crate) sites: &'a [Site],
}

impl Flipped<'_> {
    fn triangles(&self) -> impl Iterator<Item = usize> + use<'_> {
        (0..self.records.len() / 8).filter(|t| self.records[8 * t] != FREE)
    }

    fn half_edges(&self) -> impl Iterator<Item = usize> + use<'_> {
        self.triangles().flat_map(|t| [8 * t, 8 * t + 1, 8 * t + 2])
    }

    fn twin(&self, h: usize) -> usize {
        self.records[h + 4] as usize
    }

    fn site(&self, h: usize) -> Site {
        self.sites[self.records[h] as usize]
    }

    /// Returns twice the area of triangle `t`, or `None` if it has a corner at infinity.
    fn area(&self, t: usize) -> Option<i64> {
        let corners = [0, 1, 2].map(|i| self.site(8 * t + i));
        let is_finite = corners.iter().all(|corner| corner[0] != AT_INFINITY);
        is_finite.then(|| orient2d(corners[0], corners[1], corners[2]))
    }

    fn inverted(&self) -> BTreeSet<usize> {
        self.triangles().filter(|&t| self.area(t).is_some_and(|area| area <= 0)).collect()
    }

    fn whole_area(&self) -> i64 {
        self.triangles().filter_map(|t| self.area(t)).sum()
    }

    /// Returns the finite triangles, each from its least corner.
    fn corners(&self) -> BTreeSet<[u32; 3]> {
        let finite = self.triangles().filter(|&t| self.area(t).is_some());
        let turned = finite.map(|t| {
            let [a, b, c] = [0, 1, 2].map(|i| self.records[8 * t + i]);
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("three of them")
        });
        turned.collect()
    }

    /// Asserts that half-edges and their twins belong together.
    pub(crate) fn assert_linked(&self, name: &str) {
        for h in self.half_edges() {
            let g = self.twin(h);
            assert_eq!(self.twin(g), h, "{name}: half-edge {h}");
            assert_eq!(self.records[h], self.records[next(g)], "{name}: half-edge {h}");
        }
    }

    /// Returns the edges between finite triangles that should be flipped, and those that cannot be flipped although a triangle is
    /// inverted or the in-circle test fails.
    fn wrong_edges(&self) -> (Vec<usize>, Vec<usize>) {
        let is_finite = |h: &usize| self.area(h / 8).is_some() && self.area(self.twin(*h) / 8).is_some();
        let is_wrong = |h: &usize| {
            let [u, v, w, z] = self.quadrilateral(*h);
            orient2d(u, v, w) <= 0 || orient2d(v, u, z) <= 0 || in_circle(u, v, w, z)
        };
        let can_be_flipped = |h: &usize| {
            let [u, v, w, z] = self.quadrilateral(*h);
            orient2d(z, w, u) > 0 && orient2d(w, z, v) > 0
        };
        self.half_edges().filter(|&h| h > self.twin(h)).filter(is_finite).filter(is_wrong).partition(can_be_flipped)
    }

    fn quadrilateral(&self, h: usize) -> [Site; 4] {
        let g = self.twin(h);
        [h, g, next(next(h)), next(next(g))].map(|h| self.site(h))
    }
}

fn next(h: usize) -> usize {
    if h % 8 == 2 { h - 2 } else { h + 1 }
}

/// Returns the triangles whose bits are set in a section of the marks.
fn marked(words: &[u32]) -> BTreeSet<usize> {
    (0..32 * words.len()).filter(|t| words[t / 32] >> (t % 32) & 1 != 0).collect()
}

/// Does all rounds on the device and as a twin, and compares everything after each. Returns the twin's state and the number of the
/// first round after which nothing was dirty.
fn compare_rounds(rig: &mut Rig, name: &str, mesh: &LinkedMesh) -> (FlipState, Option<u32>) {
    let mut twin = FlipState::new(mesh.records.clone());
    let triangles = twin.claims.len() as u32;
    let (mut recording, mut last) = (Recording::default(), None);
    recording.upload_mesh(&mesh.records, &mesh.sites);
    recording.start_flips(triangles);
    for round in 1..=FLIP_ROUNDS {
        recording.flip_round(triangles, round);
        rig.run(&recording);
        recording.commands.clear();
        flip_round(&mut twin, &mesh.sites, round);
        for (id, expected) in
            [(BufferId::Records, &twin.records), (BufferId::Claims, &twin.claims), (BufferId::Marks, &twin.marks)]
        {
            let numbers = rig.numbers(id, expected.len() as u64);
            let differing = (0..expected.len()).find(|&i| numbers[i] != expected[i]);
            assert_eq!(differing.map(|i| (i, numbers[i], expected[i])), None, "{name}, round {round}, {id:?}");
        }
        let is_done = twin.marks[twin.sections().dirty(round + 1)].iter().all(|&word| word == 0);
        last = last.or(is_done.then_some(round));
    }
    (twin, last)
}

/// Returns the number of inverted triangles of a mesh before all rounds of flips, the number after them, and the number of edges that
/// are stuck then.
pub(crate) fn stuck_after_flips(mesh: &LinkedMesh) -> [usize; 3] {
    let mut state = FlipState::new(mesh.records.clone());
    (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut state, &mesh.sites, round));
    let before = Flipped { records: &mesh.records, sites: &mesh.sites };
    let after = Flipped { records: &state.records, sites: &mesh.sites };
    [before.inverted().len(), after.inverted().len(), after.wrong_edges().1.len()]
}

/// Compares the rounds with the twin, asserts that the mesh is whole and that what is left is marked. Returns the number of rounds that
/// were needed, or `None` if more were needed than there are.
fn check(rig: &mut Rig, cloud: &Cloud, pixels_per_site: f64) -> Option<u32> {
    let name = cloud.name;
    let mesh = LinkedMesh::new(&cloud.sites, pixels_per_site);
    let before = Flipped { records: &mesh.records, sites: &mesh.sites };
    before.assert_linked(name);
    let (twin, rounds) = compare_rounds(rig, name, &mesh);
    let after = Flipped { records: &twin.records, sites: &mesh.sites };
    after.assert_linked(name);
    assert_eq!(after.whole_area(), before.whole_area(), "{name}");

    let dirty = marked(&twin.marks[twin.sections().dirty(FLIP_ROUNDS + 1)]);
    let inverted = marked(&twin.marks[twin.sections().inverted()]);
    let is_dirty = |h: usize| dirty.contains(&(h / 8)) || dirty.contains(&(after.twin(h) / 8));
    let is_inverted = |h: usize| inverted.contains(&(h / 8)) || inverted.contains(&(after.twin(h) / 8));
    let (flippable, stuck) = after.wrong_edges();
    assert!(flippable.iter().all(|&h| is_dirty(h)), "{name}: an edge that should be flipped is not marked");
    assert!(stuck.iter().all(|&h| is_inverted(h) || is_dirty(h)), "{name}: an edge that is stuck is not marked");
    let left: BTreeSet<_> = inverted.difference(&dirty).copied().collect();
    assert_eq!(left, after.inverted().difference(&dirty).copied().collect(), "{name}");
    assert_eq!(rounds.is_some(), dirty.is_empty(), "{name}");
    eprintln!(
        "{name}, {pixels_per_site} pixels a site: {} sites, {} missing, {} triangles inverted, {} after {} rounds with {} stuck edges, \
         {} triangles not done",
        mesh.sites.len() - 1,
        mesh.missing,
        before.inverted().len(),
        inverted.len(),
        rounds.map_or("all".into(), |rounds| rounds.to_string()),
        stuck.len(),
        dirty.len()
    );
    rounds
}

#[test]
fn every_round_is_the_same_bit_for_bit_and_at_most_twelve_are_needed() {
    let Some(mut rig) = Rig::new() else { return };
    let mut most = 0;
    for cloud in clouds() {
        for pixels_per_site in [5.0, 16.0] {
            let rounds = check(&mut rig, &cloud, pixels_per_site);
            most = most.max(rounds.unwrap_or_else(|| panic!("{}: too many rounds", cloud.name)));
        }
    }
    assert!(most > 6, "the clouds are too easy");
}

#[test]
fn real_terrain_needs_at_most_twelve_rounds() {
    let (Some(mut rig), Some(cloud)) = (Rig::new(), real_cloud()) else { return };
    for pixels_per_site in [5.0, 8.0, 16.0] {
        assert!(check(&mut rig, &cloud, pixels_per_site).is_some());
    }
}

#[test]
fn what_the_rounds_leave_of_hard_clouds_is_marked() {
    let Some(mut rig) = Rig::new() else { return };
    let left = hard_clouds().iter().filter(|cloud| check(&mut rig, cloud, 8.0).is_none()).count();
    assert!(left > 0, "the clouds are too easy");
}

/// Returns the mesh with its records in another order, and free ones in between.
fn scattered(mesh: &LinkedMesh, random: &mut Random) -> LinkedMesh {
    let triangles = mesh.records.len() / 8;
    let mut places: Vec<usize> = (0..triangles + triangles / 5).collect();
    for i in (1..places.len()).rev() {
        places.swap(i, random.below(i as u32 + 1) as usize);
    }
    let mut records = [FREE, FREE, FREE, 0, FREE, FREE, FREE, 0].repeat(places.len());
    for (t, record) in mesh.records.chunks_exact(8).enumerate() {
        let moved = &mut records[8 * places[t]..][..8];
        moved.copy_from_slice(record);
        for twin in &mut moved[4..7] {
            *twin = 8 * places[*twin as usize / 8] as u32 + *twin % 8;
        }
    }
    LinkedMesh { records, sites: mesh.sites.clone(), missing: mesh.missing }
}

/// Where no triangle is inverted, the rounds end in the one canonical triangulation, whatever the order of the records.
#[test]
fn all_orders_of_the_records_end_in_one_triangulation() {
    let Some(mut rig) = Rig::new() else { return };
    let cloud = clouds().into_iter().find(|cloud| cloud.name == "coarse").expect("there is such a cloud");
    let mesh = LinkedMesh::new(&cloud.sites, 5.0);
    let other = scattered(&mesh, &mut Random(3));
    let mut results = Vec::new();
    for mesh in [&mesh, &other] {
        let (twin, rounds) = compare_rounds(&mut rig, cloud.name, mesh);
        assert!(rounds.is_some());
        let flipped = Flipped { records: &twin.records, sites: &mesh.sites };
        assert!(flipped.inverted().is_empty());
        // All rounds in one submission give the same as one by one.
        let mut recording = Recording::default();
        recording.upload_mesh(&mesh.records, &mesh.sites);
        recording.flip(mesh.records.len() as u32 / 8);
        rig.run(&recording);
        assert!(rig.numbers(BufferId::Records, twin.records.len() as u64) == twin.records);
        results.push(flipped.corners());
    }
    assert!(results[0] == results[1]);
    assert!(results[0] != Flipped { records: &mesh.records, sites: &mesh.sites }.corners(), "nothing was flipped");
}

/// As many triangles as a buffer can hold that a shader can bind: 2 GiB.
#[test]
fn the_rounds_are_fixed_grids_that_every_adapter_accepts() {
    let mut recording = Recording::default();
    recording.flip(1 << 26);
    let grids = recording.commands.iter().filter_map(|command| match command {
        GpuCommand::Run(_, _, workgroups, _) => Some(workgroups),
        _ => None,
    });
    let grids: Vec<_> = grids.collect();
    assert_eq!(grids.len(), 36);
    let fits = |n: &u32| (1..=65_535).contains(n);
    assert!(grids.iter().all(|grid| grid.iter().all(fits)));
}
