//! Selections compared with the plainest way to them.

use crate::error_bound::RoundBound;
use crate::memory::BlockMemory;
use crate::regions::RegionSizes;
use crate::rounds::{BlockState, Rounds};
use crate::sample::{Sample, Samples, very_far_above};
use crate::selected_sites::SelectedSites;
use crate::*;
use delaunay::geometry::predicates::orient2d;
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::canonical;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

/// Memory that stands for a file. What is free is filled with ones.
#[derive(Debug, Default)]
pub(crate) struct Waiting(Mutex<Vec<u8>>);

impl SelectionStore for Waiting {
    fn reserve(&self, bytes: u64) -> u64 {
        let mut all = self.0.lock().unwrap();
        let at = all.len() as u64;
        all.resize((at + bytes) as usize, 255);
        at
    }

    fn write(&self, at: u64, bytes: &[u8]) -> sys::Result<()> {
        self.0.lock().unwrap()[at as usize..][..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }

    fn read(&self, at: u64, bytes: &mut [u8]) -> sys::Result<()> {
        bytes.copy_from_slice(&self.0.lock().unwrap()[at as usize..][..bytes.len()]);
        Ok(())
    }

    fn free(&self, at: u64, bytes: u64) -> sys::Result<()> {
        self.0.lock().unwrap()[at as usize..][..bytes as usize].fill(255);
        Ok(())
    }
}

/// A cloud cut into blocks of equal columns and rows.
struct Cloud {
    blocks: Vec<BlockPoints>,
    memory: u64,
    waiting: Waiting,
    offset: [i64; 2],
    /// How often each block was read.
    loads: Vec<AtomicU32>,
}

/// So much memory holds all of a cloud of these tests.
const AMPLE: u64 = 1 << 40;
/// So much holds some of its blocks.
const SCARCE: u64 = 1 << 20;

impl Cloud {
    fn new(points: &[[i32; 3]], fixed: &[[i32; 3]], side: i32, memory: u64) -> Cloud {
        let mut blocks = std::collections::BTreeMap::<[i32; 2], BlockPoints>::new();
        let cell = |p: &[i32; 3]| [p[0].div_euclid(side), p[1].div_euclid(side)];
        points.iter().for_each(|p| blocks.entry(cell(p)).or_default().points.push(*p));
        fixed.iter().for_each(|p| blocks.entry(cell(p)).or_default().fixed.push(*p));
        let loads = blocks.iter().map(|_| AtomicU32::new(0)).collect();
        Cloud { blocks: blocks.into_values().collect(), memory, waiting: Waiting::default(), offset: [0; 2], loads }
    }
}

impl PointSource for Cloud {
    type Error = sys::Error;

    fn blocks(&self) -> usize {
        self.blocks.len()
    }

    fn offset(&self) -> [i64; 2] {
        self.offset
    }

    fn load(&self, block: usize) -> sys::Result<BlockPoints> {
        self.loads[block].fetch_add(1, Ordering::Relaxed);
        Ok(self.blocks[block].clone())
    }

    fn triangulate(&self, sites: &[Site]) -> sys::Result<HalfEdgeMesh> {
        triangulated_sites(sites)
    }

    fn memory(&self) -> u64 {
        self.memory
    }

    fn store(&self) -> Option<&dyn SelectionStore> {
        Some(&self.waiting)
    }

    fn asks_about(&self, _: [Site; 3]) -> bool {
        true
    }

    fn after_round(&self) -> sys::Result<()> {
        Ok(())
    }
}

/// Returns the canonical triangulation of `sites`.
fn triangulated_sites(sites: &[Site]) -> sys::Result<HalfEdgeMesh> {
    canonical(sites).map_err(|error| sys::Error::Broken(error.to_string()))
}

fn bounds_of(points: &[[i32; 3]]) -> Bounds<2> {
    Bounds::of_points(points.iter().map(|p| [p[0], p[1]])).unwrap()
}

fn selected(
    points: &[[i32; 3]],
    fixed: &[[i32; 3]],
    side: i32,
    bound: ErrorBound,
    memory: u64,
) -> (Vec<[i32; 3]>, Figures) {
    selected_with(RegionSizes::USUAL, points, fixed, side, bound, memory)
}

fn selected_with(
    sizes: RegionSizes,
    points: &[[i32; 3]],
    fixed: &[[i32; 3]],
    side: i32,
    bound: ErrorBound,
    memory: u64,
) -> (Vec<[i32; 3]>, Figures) {
    let bounds = bounds_of(points);
    let cloud = Cloud::new(points, fixed, side, memory);
    let Selection { sites, figures, holding } =
        crate::select::select_by_regions(&cloud, bound, sizes, None).unwrap().into_selection();
    let mut all: Vec<_> = sites.within(bounds).unwrap();
    holds_the_others(&all.iter().copied().collect::<BTreeSet<_>>(), points, &holding);
    all.sort_unstable();
    (all, figures)
}

/// Asserts that the listed triangles are those with points inside that are not selected, with their numbers.
fn holds_the_others(selected: &BTreeSet<[i32; 3]>, points: &[[i32; 3]], holding: &[HeldPoints]) {
    let all: Vec<Site> = selected.iter().map(|p| [p[0], p[1]]).collect();
    let others: Vec<Site> = points.iter().filter(|p| !selected.contains(*p)).map(|p| [p[0], p[1]]).collect();
    assert!(holding.iter().map(|held| held.count).sum::<u64>() <= others.len() as u64);
    let (Ok(mesh), true) = (canonical(&all), others.len() < 3_000) else { return };
    let of_triangle = |t: &[u32; 3]| {
        let mut corners = t.map(|v| all[v as usize]);
        corners.sort_unstable();
        HeldPoints::of(corners, others.iter().copied())
    };
    let mut expected: Vec<HeldPoints> = mesh.corners().iter().map(of_triangle).filter(|held| held.count > 0).collect();
    expected.sort_unstable();
    assert_eq!(holding, expected);
}

/// Does rounds on all points of one sample after the other at once, each from nothing, from these seeds on.
fn plain_rounds(samples: Samples, points: &[[i32; 3]], seeds: Vec<[i32; 3]>, bound: ErrorBound) -> Vec<[i32; 3]> {
    let mut selected: BTreeSet<[i32; 3]> = seeds.into_iter().collect();
    let (count, area) = (points.len() as u64, crate::area::area_of(bounds_of(points)));
    for (number, sample) in samples.ladder([0; 2]).enumerate() {
        let points: Vec<[i32; 3]> = points.iter().copied().filter(|&p| sample.has(p)).collect();
        if number > 0 {
            let beyond = beyond(&points, &selected, very_far_above(bound));
            selected.extend(beyond);
        }
        rounds_over(&points, &mut selected, &samples.bound(sample.bound(bound, count, area)));
    }
    selected.into_iter().collect()
}

/// Returns the points that exceed the bound.
fn beyond(points: &[[i32; 3]], selected: &BTreeSet<[i32; 3]>, bound: ErrorBound) -> Vec<[i32; 3]> {
    let triangles = triangles_of(selected);
    let exceeds = |p: [i32; 3]| move |t: &[[i32; 3]; 3]| owns(*t, p) && bound.is_exceeded_by(VerticalError::of(*t, p));
    points.iter().copied().filter(|&p| !selected.contains(&p) && triangles.iter().any(exceeds(p))).collect()
}

fn triangles_of(selected: &BTreeSet<[i32; 3]>) -> Vec<[[i32; 3]; 3]> {
    let all: Vec<[i32; 3]> = selected.iter().copied().collect();
    let sites: Vec<Site> = all.iter().map(|p| [p[0], p[1]]).collect();
    canonical(&sites).unwrap().corners().iter().map(|t| t.map(|v| all[v as usize])).collect()
}

fn rounds_over(points: &[[i32; 3]], selected: &mut BTreeSet<[i32; 3]>, bound: &RoundBound) {
    loop {
        let worst = worst_points(points, selected, bound);
        let beside = |a: &[[i32; 3]; 3], b: &[[i32; 3]; 3]| a.iter().filter(|corner| b.contains(corner)).count() == 2;
        let rank = |(error, p): (u64, [i32; 3])| (error, std::cmp::Reverse(p));
        let accepted = worst.iter().filter(|(triangle, own)| {
            let is_outdone_by =
                |(other, candidate): &WorstPoint| beside(triangle, other) && rank(*candidate) > rank(*own);
            own.0 > bound.far || !worst.iter().any(is_outdone_by)
        });
        let accepted: Vec<[i32; 3]> = accepted.map(|(_, (_, p))| *p).collect();
        if accepted.is_empty() {
            return;
        }
        selected.extend(accepted);
    }
}

/// A triangle, the distance of its worst point, and that point.
type WorstPoint = ([[i32; 3]; 3], (u64, [i32; 3]));

/// Returns the worst point of each triangle where it exceeds the bound.
fn worst_points(points: &[[i32; 3]], selected: &BTreeSet<[i32; 3]>, bound: &RoundBound) -> Vec<WorstPoint> {
    let worst = triangles_of(selected).into_iter().filter_map(|triangle| {
        let candidates = points.iter().filter(|p| !selected.contains(*p) && owns(triangle, **p));
        let worst = candidates.map(|&p| (VerticalError::of(triangle, p), p));
        let worst = worst.max_by_key(|(error, p)| (error.numerator, std::cmp::Reverse(*p)));
        worst.map(|(error, p)| (triangle, (bound.excess(error), p))).filter(|(_, (excess, _))| *excess > 0)
    });
    worst.collect()
}

/// A point on an edge belongs to the triangle on the left of it, as seen from the lesser end. Those on the hull are left out here.
fn owns(triangle: [[i32; 3]; 3], p: [i32; 3]) -> bool {
    let site = |p: [i32; 3]| [p[0], p[1]];
    (0..3).all(|k| {
        let (from, to) = (site(triangle[k]), site(triangle[(k + 1) % 3]));
        let side = orient2d(from, to, site(p));
        side > 0 || side == 0 && from < to
    })
}

/// Points of distinct places within `reach`, without any on the outline but corners, whose heights come from `height`.
fn cloud(reach: i32, places: Vec<(i32, i32)>, height: impl Fn(i32, i32) -> i32) -> Vec<[i32; 3]> {
    let mut all: BTreeSet<[i32; 2]> =
        places.into_iter().map(|(x, y)| [1 + x % (reach - 1), 1 + y % (reach - 1)]).collect();
    all.extend([[0, 0], [reach, 0], [0, reach], [reach, reach]]);
    all.into_iter().map(|[x, y]| [x, y, height(x, y)]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// Few places: many points on edges and circles, and many ties of distances.
    #[test]
    fn a_selection_is_that_of_plain_rounds_whatever_the_blocks(
        reach in prop::sample::select(vec![6, 13, 40, 5000]),
        places in prop::collection::vec((0..5000i32, 0..5000i32), 1..220),
        shape in 0..6,
        bound in prop::sample::select(vec![(0u64, 1u32), (1, 3), (1, 1), (5, 2), (40, 1)]),
        side in prop::sample::select(vec![3, 7, 17, 701, 2500, 100_000]),
        samples in prop::sample::select(vec![Samples::Unneeded, Samples::Growing]),
    ) {
        let side = side.max(reach / 12);
        let points = cloud(reach, places, |x, y| match shape {
            0 => x * 31 % 17,
            1 => if x > reach / 2 { 50 } else { 0 },
            2 => (x - reach / 2).abs().min(20) + y % 2,
            3 => x + 2 * y,
            4 => (x * x + y * y) / (reach * reach / 90).max(1),
            _ => (x / 3 * 7 + y / 2 * 3) % 11,
        });
        let bound = ErrorBound::new(bound.0, bound.1);
        let sizes = RegionSizes { unsampled: if samples == Samples::Unneeded { u64::MAX } else { 0 }, ..RegionSizes::USUAL };
        let (found, figures) = selected_with(sizes, &points, &[], side, bound, AMPLE);
        let (again, _) = selected_with(sizes, &points, &[], 100_000, bound, 0);
        prop_assert_eq!(&found, &again);
        prop_assert_eq!(found.len() as u64, figures.selected);
        // Every point is within the bound.
        let chosen: BTreeSet<_> = found.iter().copied().collect();
        prop_assert_eq!(worst_points(&points, &chosen, &RoundBound::everywhere(bound)), Vec::new());
        // Round by round the plain way.
        let cells = crate::outline::MarkedCells::none(bounds_of(&points), points.len() as u64, [0; 2]);
        let mut seeds = crate::seeds::Seeds::none(samples, bounds_of(&points), points.len() as u64, [0; 2], &cells);
        seeds.add(&points, &[]);
        let bays = seeds.bays(cells);
        prop_assert_eq!(found, plain_rounds(samples, &points, seeds.into_points(&bays), bound));
    }
}

#[test]
fn a_plane_takes_its_corners_and_a_line_all_points() {
    let plane: Vec<[i32; 3]> = (0..10_000).map(|i| [i % 100, i / 100, 3 * (i % 100) - 2 * (i / 100)]).collect();
    let (found, figures) = selected(&plane, &[], 30, ErrorBound::new(0, 1), AMPLE);
    assert!(found.len() <= 4 + 16, "{}", found.len());
    assert_eq!((figures.greatest, figures.rounds, figures.points), (0, 0, 10_000));
    let line: Vec<[i32; 3]> = (0..100).map(|i| [i, 2 * i, i % 7]).collect();
    assert_eq!(selected(&line, &[], 30, ErrorBound::new(1, 1), AMPLE).0, line);
}

#[test]
fn fixed_points_are_selected() {
    let plane: Vec<[i32; 3]> = (0..400).map(|i| [i % 20, i / 20, 0]).collect();
    let fixed = [[7, 8, 0], [9, 13, 0]];
    let (found, _) = selected(&plane, &fixed, 6, ErrorBound::new(1, 1), AMPLE);
    assert!(fixed.iter().all(|p| found.contains(p)));
}

/// Two clusters far apart, and a void between them that one long triangle covers.
#[test]
fn blocks_far_apart_agree() {
    let hill = |x: i32, y: i32| (x % 97 - 48).pow(2) / 9 + (y % 89 - 44).pow(2) / 7;
    let mut points = BTreeSet::new();
    for i in 0..4000 {
        let (x, y) = (i * 7919 % 1009, i * 104_729 % 997);
        points.insert([x, y]);
        points.insert([x + 5_000_000, y / 9 + 3_000_000]);
    }
    let points: Vec<[i32; 3]> = points.into_iter().map(|[x, y]| [x, y, hill(x, y)]).collect();
    let bound = ErrorBound::new(9, 2);
    for unsampled in [0, u64::MAX] {
        let sizes = RegionSizes { unsampled, ..RegionSizes::USUAL };
        let whole = selected_with(sizes, &points, &[], 100_000_000, bound, AMPLE);
        for (side, memory) in [(100, AMPLE), (333, 0), (400, SCARCE), (1000, AMPLE)] {
            assert_eq!(selected_with(sizes, &points, &[], side, bound, memory), whole);
        }
        assert!(whole.1.greatest <= 9 << 19 && whole.0.len() > 1000 && whole.0.len() < points.len());
    }
}

/// Hills of several sizes, and roughness of a step or two.
fn hills(count: i32) -> Vec<[i32; 3]> {
    let wave = |x: i32, y: i32, a: i32, b: i32, length: f64| (f64::from(a * x + b * y) / length).sin();
    let height = |x: i32, y: i32| {
        let shape =
            900.0 * wave(x, y, 1, 2, 9000.0) + 200.0 * wave(x, y, 3, -1, 2100.0) + 25.0 * wave(x, y, -2, 5, 400.0);
        shape as i32 + (x * 31 + y * 17) % 3
    };
    let mut places: Vec<[i32; 2]> = (0..count).map(|i| [i * 7919 % 20_011, (i * 104_729) % 19_997]).collect();
    places.sort_unstable();
    places.dedup();
    places.into_iter().map(|[x, y]| [x, y, height(x, y)]).collect()
}

/// In rounds it takes no more points than one at a time, but for some percent.
#[test]
fn rounds_select_about_as_many_points_as_greedy_insertion() {
    let points = hills(20_000);
    let (bounds, hull) = (bounds_of(&points), crate::hull::hull_corners(points.clone()));
    for steps in [4, 12, 40, 120, 400] {
        let bound = ErrorBound::new(steps, 1);
        let mut known = SelectedSites::none(bounds, points.len() as u64, None, 0);
        known.add(hull.iter().copied()).unwrap();
        let whole = Sample::all([0; 2]);
        let all = crate::near_points::PointsByPlace::of(&points, bounds, whole);
        let block = crate::block::Block::new(all, bounds, whole, &known, &hull, triangulated_sites).unwrap();
        let greedy = crate::block::greedy_insertion(block, &mut known, bound);
        // Without samples, and with them.
        for (unsampled, most) in [(u64::MAX, 105), (0, 111)] {
            let sizes = RegionSizes { unsampled, ..RegionSizes::USUAL };
            let (found, figures) = selected_with(sizes, &points, &[], 4_000, bound, AMPLE);
            assert!(greedy > 40 && found.len() as u64 * 100 <= greedy * most, "{steps}: {} and {greedy}", found.len());
            assert!(figures.rounds > 2);
        }
    }
}

#[test]
fn a_block_beside_a_crowd_takes_little_of_it() {
    let crowd: Vec<[i32; 3]> = (0..40_000).map(|i| [50_500 + i % 200, 50_000 + i / 200, i % 31]).collect();
    let sparse: Vec<[i32; 3]> = (0..400).map(|i| [i % 20 * 2_500, i / 20 * 5_000, i % 7]).collect();
    let corners = [[0, 0, 0], [100_000, 0, 0], [0, 100_000, 0], [100_000, 100_000, 0]];
    let all: Vec<[i32; 3]> = crowd.iter().chain(&sparse).chain(&corners[1..]).copied().collect();
    let mut known = SelectedSites::none(bounds_of(&all), all.len() as u64, None, 0);
    known.add(all).unwrap();
    let bounds = bounds_of(&sparse);
    let whole = Sample::all([0; 2]);
    let points = crate::near_points::PointsByPlace::of(&sparse, bounds, whole);
    let mut triangulated = 0;
    let triangulate = |sites: &[Site]| {
        triangulated = sites.len();
        triangulated_sites(sites)
    };
    crate::block::Block::new(points, bounds, whole, &known, &corners, triangulate).unwrap();
    assert!((400..2_500).contains(&triangulated), "{triangulated}");
}

/// Blocks beside a crowd take less and less of it, and still know the corners of the hull.
#[test]
fn a_crowd_does_not_depend_on_blocks() {
    let rough = |i: i32| i * 7_919 % 101;
    let spread = (0..1_000).map(|i| [i * 7_919 % 10_007 * 1_000, i * 104_729 % 10_009 * 1_000, rough(i)]);
    let strip = (0..20_000).map(|i| [i * 499 + i % 7, 4_999_000 + i * 31 % 1_999, rough(i)]);
    let points: Vec<[i32; 3]> = spread.chain(strip).collect();
    let bound = ErrorBound::new(12, 1);
    for unsampled in [0, u64::MAX] {
        let sizes = RegionSizes { unsampled, ..RegionSizes::USUAL };
        let one = selected_with(sizes, &points, &[], 100_000_000, bound, AMPLE);
        assert!((5_000..21_000).contains(&one.0.len()), "{}", one.0.len());
        for (side, memory) in [(625_000, AMPLE), (1_250_000, SCARCE), (5_000_000, AMPLE)] {
            assert!(selected_with(sizes, &points, &[], side, bound, memory) == one, "blocks of {side}");
        }
    }
}

/// With small regions: every point is within the bound, and nothing depends on the blocks, or on where the lattice begins.
#[test]
fn regions_depend_on_the_points_alone() {
    let sizes = RegionSizes { unsampled: 0, undivided: 1_600, points: 100, rows_of_strip: 2 };
    let mut clouds = vec![hills(3_000)];
    // A dense cluster about a corner of regions, which are divided again, and a line far away.
    clouds.push((0..8_000).map(|i| [i % 90 - 45, i / 90 - 44, (i % 90) * (i / 90) % 29]).collect());
    clouds[1].extend((0..50).map(|i| [40_000 + 100 * i, 90_000, i % 7]));
    for points in clouds {
        let bound = ErrorBound::new(12, 1);
        let run = |side: i32, memory: u64, offset: [i32; 2]| {
            let moved = |[x, y, z]: [i32; 3]| [x - offset[0], y - offset[1], z];
            let back = |[x, y, z]: [i32; 3]| [x + offset[0], y + offset[1], z];
            let points: Vec<[i32; 3]> = points.iter().copied().map(moved).collect();
            let mut cloud = Cloud::new(&points, &points[700..702], side, memory);
            cloud.offset = offset.map(i64::from);
            let bounds = bounds_of(&points);
            let found = crate::select::select_by_regions(&cloud, bound, sizes, None).unwrap().into_selection();
            let all: BTreeSet<_> = found.sites.within(bounds).unwrap().into_iter().collect();
            assert_eq!(all.len() as u64, found.figures.selected, "some are selected twice");
            holds_the_others(&all, &points, &found.holding);
            let mut all: Vec<_> = all.into_iter().map(back).collect();
            all.sort_unstable();
            let worst = found.figures.worst.map(back);
            (all, Figures { worst, ..found.figures })
        };
        let (found, figures) = run(1_000_000, AMPLE, [0; 2]);
        let others =
            [(17, SCARCE, [0; 2]), (900, 0, [0; 2]), (3_000, AMPLE, [12_345, -999]), (700, 0, [-1_000_003, 1])];
        for (side, memory, offset) in others {
            assert_eq!(run(side, memory, offset), (found.clone(), figures), "blocks of {side}, {offset:?}");
        }
        let chosen: BTreeSet<_> = found.iter().copied().collect();
        assert_eq!(worst_points(&points, &chosen, &RoundBound::everywhere(bound)), Vec::new());
        assert!(points[700..702].iter().all(|point| chosen.contains(point)));
        assert!(figures.greatest <= 12 << 20 && found.len() < points.len() * 9 / 10, "{}", found.len());
    }
}

#[test]
fn of_points_on_a_line_in_regions_all_are_selected() {
    let points: Vec<[i32; 3]> = (0..2_000).map(|i| [3 * i, 7 * i, i % 5]).collect();
    let sizes = RegionSizes { unsampled: 0, undivided: 1_600, points: 100, ..RegionSizes::USUAL };
    let cloud = Cloud::new(&points, &[], 700, AMPLE);
    let found = crate::select::select_by_regions(&cloud, ErrorBound::new(12, 1), sizes, None).unwrap();
    assert_eq!(found.sites.count(), 2_000);
}

/// The rounds over the whole cloud have little left to do after those along the borders of its regions.
#[test]
fn strips_leave_little_to_the_whole_cloud() {
    let (points, bound) = (hills(20_000), ErrorBound::new(12, 1));
    let (bounds, hull) = (bounds_of(&points), crate::hull::hull_corners(points.clone()));
    let sizes = RegionSizes { unsampled: 0, undivided: 10_000, points: 1_000, ..RegionSizes::USUAL };
    let cloud = Cloud::new(&points, &[], 2_000, AMPLE);
    let states = || cloud.blocks.iter().map(|block| BlockState::of(&block.points)).collect();
    let memory = || BlockMemory::new(AMPLE);
    let division = crate::regions::divide(&cloud, states(), &memory(), bounds, 20_000, sizes, None).unwrap();
    let mut selected = SelectedSites::none(bounds, 20_000, None, u64::MAX);
    let mut of_cells = BTreeMap::new();
    for (cell, region) in &division.regions {
        let of_region = crate::select::select_by_regions(region, bound, sizes, None).unwrap();
        of_cells.insert(*cell, of_region.sites.count());
        selected.add(of_region.sites.within(region.bounds).unwrap()).unwrap();
    }
    let left = |selected: &SelectedSites| {
        let mut rounds = Rounds::new(&cloud, states(), bounds, memory());
        rounds.add(selected.within(bounds).unwrap()).unwrap();
        rounds.select_more(hull.clone(), bound).unwrap().0.len()
    };
    let without = left(&selected);
    for strips in division.borders.strips(&of_cells) {
        selected.add(crate::select::select_beside(&strips, &selected, &hull, bound).unwrap().0).unwrap();
    }
    let with = left(&selected);
    assert!(with <= without / 10 && without > 20, "{with} instead of {without}");
}

/// Far from the borders of regions, the rounds over the whole cloud do not read a block again, and come to the same.
#[test]
fn what_is_known_of_regions_is_taken_over() {
    let sizes = RegionSizes { unsampled: 0, undivided: 10_000, points: 1_000, rows_of_strip: 8 };
    let points = hills(20_000);
    let run = |side: i32| {
        let cloud = Cloud::new(&points, &[], side, AMPLE);
        let found = crate::select::select_by_regions(&cloud, ErrorBound::new(12, 1), sizes, None).unwrap();
        let Selection { sites, figures, holding } = found.into_selection();
        let mut all = sites.within(bounds_of(&points)).unwrap();
        all.sort_unstable();
        let loads: Vec<u32> = cloud.loads.iter().map(|loads| loads.load(Ordering::Relaxed)).collect();
        ((all, figures, holding), loads)
    };
    let (found, loads) = run(700);
    // All are read for the division and for the region.
    let [twice, more] = [2..3, 3..u32::MAX].map(|range| loads.iter().filter(|loads| range.contains(loads)).count());
    assert!(twice > loads.len() / 8 && twice + more == loads.len(), "{twice} and {more} of {}", loads.len());
    // A single block lies in no region.
    let (as_one, loads) = run(1_000_000);
    assert!(loads[0] > 3 && found == as_one);
}

/// Strips along the borders of regions have all points near these, once, and no others.
#[test]
fn strips_lie_along_the_borders_of_regions() {
    let points: Vec<[i32; 3]> = (0..40_000).map(|i| [i % 200 - 90, i / 200 - 77, 0]).collect();
    for offset in [[0; 2], [12_345, -999]] {
        let mut cloud = Cloud::new(&points, &[], 23, AMPLE);
        cloud.offset = offset;
        let sizes = RegionSizes { unsampled: 0, undivided: 20_000, points: 1_000, ..RegionSizes::USUAL };
        let blocks = cloud.blocks.iter().map(|block| BlockState::of(&block.points)).collect();
        let (memory, bounds) = (BlockMemory::new(AMPLE), bounds_of(&points));
        let division = crate::regions::divide(&cloud, blocks, &memory, bounds, 40_000, sizes, None).unwrap();
        let of = |region: &crate::regions::Region<_>| -> Vec<[i32; 3]> {
            (0..region.blocks()).flat_map(|block| region.load(block).unwrap().points).collect()
        };
        let mut of_regions: Vec<_> = division.regions.iter().flat_map(|(_, region)| of(region)).collect();
        of_regions.sort_unstable();
        let mut sorted = points.clone();
        sorted.sort_unstable();
        assert!(of_regions == sorted && division.regions.len() > 25);
        // Regions are 32 steps wide. With few selected points in each, a strip reaches four steps from a border; with many, so far that 32 rows are in it.
        for (selected, reach) in [(1, 4), (512 * 512, 2)] {
            let of_cells = division.regions.iter().map(|(cell, _)| (*cell, selected)).collect();
            let is_near =
                |p: &&[i32; 3]| (0..2).any(|k| (i64::from(p[k]) + offset[k] + reach).rem_euclid(32) < 2 * reach);
            let expected: Vec<_> = sorted.iter().filter(is_near).copied().collect();
            let strips = division.borders.strips(&of_cells);
            let mut of_strips: Vec<_> = strips.iter().flat_map(|strips| of(&strips.points)).collect();
            of_strips.sort_unstable();
            assert_eq!(of_strips, expected, "{offset:?}");
        }
    }
}

/// The shores of a bay that is none of a single region have points too.
#[test]
fn bays_are_those_of_the_whole_cloud() {
    // An L, with dents in the shores of the bay between its arms that are narrower than a cell.
    let shore = |along: i32| if along % 128 < 64 { 200 } else { 180 };
    let all = (0..600).flat_map(|y| (0..600).map(move |x| [x, y, 7]));
    let points: Vec<[i32; 3]> = all.filter(|[x, y, _]| *x < shore(*y) || *y < shore(*x)).collect();
    let sizes = RegionSizes { unsampled: 0, undivided: 160_000, points: 10_000, ..RegionSizes::USUAL };
    let cloud = Cloud::new(&points, &[], 90, AMPLE);
    let found = crate::select::select_by_regions(&cloud, ErrorBound::new(1, 1), sizes, None).unwrap();
    let found = found.sites.within(bounds_of(&points)).unwrap();
    // A cell is 32 steps wide, a region 256. These are no corners of any hull.
    assert!(found.contains(&[179, 320, 7]) && found.contains(&[352, 179, 7]), "{found:?}");
    assert!(found.len() < 100, "{}", found.len());
}
