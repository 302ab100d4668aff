//! Volumes that are known, and volumes against exact fractions.

mod brute_force;
mod rational;

use crate::{Comparison, Point, TriangleMesh, Zones, compare};
use brute_force::as_numbers;
use delaunay::Delaunay;

/// A sequence that looks random.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((u128::from(self.0 >> 16) * u128::from(bound)) >> 48) as u64
    }

    fn within(&mut self, reach: i64) -> i64 {
        self.below(2 * reach as u64 + 1) as i64 - reach
    }

    fn points(&mut self, count: usize, reach: i64, height: i64) -> Vec<Point> {
        (0..count).map(|_| [self.within(reach), self.within(reach), self.within(height)]).collect()
    }
}

/// The Delaunay triangulation of some points; of those at one place, the first counts.
fn tin(points: &[Point]) -> TriangleMesh {
    let sites: Vec<[i32; 2]> = points.iter().map(|p| [p[0] as i32, p[1] as i32]).collect();
    let mesh = Delaunay::of_integers(&sites).unwrap();
    TriangleMesh::new(points.to_vec(), mesh.triangles().to_vec()).unwrap()
}

/// A terrain over a grid of places.
fn over_grid(reach: i64, step: i64, height: impl Fn(i64, i64) -> i64) -> TriangleMesh {
    let along = || (-reach..=reach).step_by(step as usize);
    let points: Vec<Point> =
        along().flat_map(|x| along().map(move |y| [x, y])).map(|[x, y]| [x, y, height(x, y)]).collect();
    tin(&points)
}

fn compared(before: &TriangleMesh, after: &TriangleMesh, threshold: f64) -> Comparison {
    let mut found = Comparison::new(0);
    compare(before, after, threshold, None, &mut found);
    found
}

fn numbers(before: &TriangleMesh, after: &TriangleMesh, threshold: f64) -> [f64; 5] {
    as_numbers(&compared(before, after, threshold).all)
}

#[track_caller]
fn assert_near(found: [f64; 5], wanted: [f64; 5]) {
    let scale = wanted.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
    for (found, wanted) in found.into_iter().zip(wanted) {
        assert!((found - wanted).abs() <= 1e-9 * wanted.abs() + 1e-14 * scale, "{found} is not {wanted}");
    }
}

#[test]
fn a_box_of_fill_has_its_volume() {
    let before = over_grid(1000, 100, |_, _| 5);
    let higher = over_grid(700, 70, |_, _| 12);
    assert_near(numbers(&before, &higher, 0.0), [1400.0 * 1400.0, 0.0, 7.0 * 1400.0 * 1400.0, 7.0, 0.0]);
    assert_near(numbers(&higher, &before, 0.0), [1400.0 * 1400.0, 7.0 * 1400.0 * 1400.0, 0.0, 0.0, 7.0]);
    // At the threshold it counts, and above it does not.
    assert_near(numbers(&before, &higher, 7.0), [1400.0 * 1400.0, 0.0, 7.0 * 1400.0 * 1400.0, 7.0, 0.0]);
    assert_near(numbers(&before, &higher, 7.0001), [1400.0 * 1400.0, 0.0, 0.0, 7.0, 0.0]);
}

#[test]
fn tilted_planes_cut_and_fill_wedges() {
    let flat = over_grid(300, 60, |_, _| 0);
    let tilted = over_grid(300, 75, |x, _| 2 * x);
    // Two wedges: half of the base times half of the greatest height.
    let wedge = 300.0 * 600.0 * 300.0;
    assert_near(numbers(&flat, &tilted, 0.0), [360_000.0, wedge, wedge, 600.0, 600.0]);
    // From x = 50 on the height is 100 or more: a prism of mean height 350 over 250 by 600.
    let beyond = 250.0 * 600.0 * 350.0;
    assert_near(numbers(&flat, &tilted, 100.0), [360_000.0, beyond, beyond, 600.0, 600.0]);
}

#[test]
fn a_pyramid_is_a_third_of_its_box() {
    let cone = |x: i64, y: i64| 400 - x.abs().max(y.abs());
    let flat = over_grid(400, 400, |_, _| 0);
    let apex = tin(&[[-400, -400, 0], [400, -400, 0], [400, 400, 0], [-400, 400, 0], [0, 0, 400]]);
    let wanted = [640_000.0, 0.0, 640_000.0 * 400.0 / 3.0, 400.0, 0.0];
    assert_near(numbers(&flat, &apex, 0.0), wanted);
    let many = over_grid(400, 25, cone);
    let corners: Vec<f64> = numbers(&flat, &many, 0.0).into();
    assert!((corners[2] / wanted[2] - 1.0).abs() < 0.01, "the diagonals of some cells cross the ridges");
}

#[test]
fn random_terrains_are_those_of_exact_fractions() {
    let mut random = Random(1);
    for round in 0..200 {
        // Small coordinates have many ties, vertices and edges in common.
        let (reach, height) = [(3, 2), (6, 5), (20, 9), (1000, 300)][round % 4];
        let count = 4 + random.below(14) as usize;
        let [before, after] = [0, 1].map(|_| {
            let mut points = random.points(count, reach, height);
            points.extend([[-reach, -reach, 0], [reach, -reach, 1], [0, reach, 2]]);
            points
        });
        let mut later = after;
        if round % 3 == 0 {
            let common = before.len() / 2;
            later[..common].copy_from_slice(&before[..common]);
        }
        let (before, after, threshold) = (tin(&before), tin(&later), (round % 2) as i64 * height / 3);
        let exact = brute_force::totals(&before, &after, threshold);
        assert_near(numbers(&before, &after, threshold as f64), exact);
    }
}

#[test]
fn slivers_have_their_exact_volumes() {
    let mut random = Random(5);
    for _ in 0..60 {
        let sliver = |random: &mut Random| loop {
            let [a, b] = [random.points(1, 1 << 20, 90)[0], random.points(1, 1 << 20, 90)[0]];
            let middle =
                [(a[0] + b[0]) / 2 + random.within(1), (a[1] + b[1]) / 2 + random.within(1), random.within(90)];
            if let Ok(mesh) = TriangleMesh::new(vec![a, b, middle], vec![[0, 1, 2]]) {
                return (mesh, [a, b]);
            }
        };
        let (thin, [a, b]) = sliver(&mut random);
        let near = [a, b, [a[0] + 1 + random.within(1), a[1] - 5, 7], [b[0] - 3, b[1] + 40, -9]];
        let around = tin(&near);
        let exact = brute_force::totals(&around, &thin, 0);
        let found = numbers(&around, &thin, 0.0);
        // Rounding moves what a thin polygon contributes by 1e-16 of the square of its length.
        for k in 0..3 {
            assert!((found[k] - exact[k]).abs() <= 1e-9 * exact[k] + 1e-2, "{found:?} {exact:?}");
        }
    }
}

#[test]
fn a_terrain_against_itself_is_exactly_nothing() {
    let points = Random(7).points(3000, 5000, 4000);
    let whole = tin(&points);
    let found = compared(&whole, &whole, 0.0).all;
    assert_eq!(as_numbers(&found)[1..], [0.0; 4]);
    let mut area = crate::FixedSum::default();
    area.add_half(whole.double_area());
    assert_eq!(found.area, area);
    // In any pieces too.
    let mut sum = Comparison::new(0);
    for part in in_parts(&points, &whole, 3) {
        for other in in_parts(&points, &whole, 5) {
            compare(&part, &other, 0.0, None, &mut sum);
        }
    }
    assert_eq!(sum.all, found);
}

#[test]
fn another_triangulation_of_one_plane_is_no_difference() {
    let plane = |points: Vec<Point>| tin(&points.iter().map(|p| [p[0], p[1], 3 * p[0] - 7 * p[1]]).collect::<Vec<_>>());
    let mut random = Random(8);
    let [before, after] = [0, 1].map(|_| plane(random.points(400, 900, 0)));
    assert_eq!(numbers(&before, &after, 0.0)[1..], [0.0; 4]);
}

/// Deals the triangles out to meshes, with their corners in another order.
fn in_parts(points: &[Point], mesh: &TriangleMesh, count: usize) -> Vec<TriangleMesh> {
    let sites: Vec<[i32; 2]> = points.iter().map(|p| [p[0] as i32, p[1] as i32]).collect();
    let triangles = Delaunay::of_integers(&sites).unwrap().triangles().to_vec();
    assert_eq!(triangles.len(), mesh.len());
    let part = |number: usize| {
        let all = triangles.iter().enumerate().filter(|(t, _)| t % count == number).rev();
        let turned = all.map(|(t, corners)| [0, 1, 2].map(|k| corners[(k + t) % 3])).collect();
        TriangleMesh::new(points.to_vec(), turned).unwrap()
    };
    (0..count).map(part).collect()
}

#[test]
fn order_and_parts_do_not_change_a_bit() {
    let mut random = Random(9);
    // Dense in the middle, so that cells are cut again, and slivers between far points.
    let mut points = [0, 1].map(|_| {
        let mut points = random.points(2000, 40_000, 3000);
        points.extend(random.points(2500, 120, 50));
        points.extend((0..200).map(|k| [-60_000 + 600 * k, 41_000 + k % 2, 5 * k]));
        points
    });
    points[1][5][2] = 900_000;
    let meshes = points.each_ref().map(|points| tin(points));
    let whole = compared(&meshes[0], &meshes[1], 0.0);
    let [area, cut, fill, rise, fall] = as_numbers(&whole.all);
    assert!(area > 0.0 && cut > 0.0 && fill > 0.0 && rise > 0.0 && fall > 0.0);
    for count in [2, 7] {
        let mut sum = Comparison::new(0);
        for before in in_parts(&points[0], &meshes[0], count) {
            for after in in_parts(&points[1], &meshes[1], count + 1) {
                let mut found = Comparison::new(0);
                compare(&before, &after, 0.0, None, &mut found);
                sum.merge(&found);
            }
        }
        assert_eq!(sum, whole);
    }
    // What one way is cut is fill the other way.
    let back = as_numbers(&compared(&meshes[1], &meshes[0], 0.0).all);
    assert_near(back, [area, fill, cut, fall, rise]);
}

#[test]
fn wide_and_narrow_numbers_give_the_same_bits() {
    let mut random = Random(10);
    let points = [0, 1].map(|_| random.points(300, 2000, 500));
    let meshes = points.each_ref().map(|points| tin(points));
    let narrow = compared(&meshes[0], &meshes[1], 0.0);
    // A vertex of no triangle makes the range of heights wide.
    let mut more = points[1].clone();
    more.push([0, 0, 1 << 39]);
    let sites: Vec<[i32; 2]> = points[1].iter().map(|p| [p[0] as i32, p[1] as i32]).collect();
    let wide = TriangleMesh::new(more, Delaunay::of_integers(&sites).unwrap().triangles().to_vec()).unwrap();
    assert_eq!(compared(&meshes[0], &wide, 0.0), narrow);
}

#[test]
fn far_and_high_corners_do_not_overflow() {
    let far = crate::REACH;
    let square = |z: i64| {
        let points = vec![[-far, -far, z], [far, -far, -z], [far, far, z], [-far, far, -z]];
        TriangleMesh::new(points, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    };
    let found = compared(&square(0), &square(far), 0.0).all;
    assert_eq!(found.area.value(), Some((4.0 * far as f64) * far as f64));
    assert_eq!((found.max_rise, found.max_fall), (far as f64, far as f64));
    // The volume is beyond what a sum can hold, and says so.
    assert_eq!(compared(&square(-far), &square(far), 0.0).all.fill.value(), None);
    assert!(TriangleMesh::new(vec![[far + 1, 0, 0]], Vec::new()).is_err());
}

#[test]
fn zones_add_up_to_the_whole() {
    let mut random = Random(11);
    let meshes = [0, 1].map(|_| tin(&random.points(500, 3000, 200)));
    let zone = |corners: [[i64; 2]; 4]| {
        let points = corners.map(|[x, y]| [x, y, 0]).to_vec();
        TriangleMesh::new(points, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    };
    // Together they cover the whole; the last one lies outside.
    let zones = Zones::new(vec![
        zone([[-4000, -4000], [137, -4000], [-511, 4000], [-4000, 4000]]),
        zone([[137, -4000], [4000, -4000], [4000, 4000], [-511, 4000]]),
        zone([[9000, 0], [9100, 0], [9100, 9], [9000, 9]]),
    ]);
    let mut found = Comparison::new(zones.count());
    compare(&meshes[0], &meshes[1], 20.0, Some(&zones.of(&meshes[1])), &mut found);
    let [whole, west, east, outside] = [&found.all, &found.zones[0], &found.zones[1], &found.zones[2]].map(as_numbers);
    assert_eq!(outside, [0.0; 5]);
    assert!(west[0] > 1e6 && east[0] > 1e6);
    let sum = [west[0] + east[0], west[1] + east[1], west[2] + east[2], west[3].max(east[3]), west[4].max(east[4])];
    assert_near(sum, whole);
}

#[test]
fn meshes_that_are_none_are_refused() {
    let points = vec![[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]];
    for triangle in [[0, 2, 1], [0, 1, 3], [0, 1, 4], [1, 1, 2]] {
        assert!(TriangleMesh::new(points.clone(), vec![triangle]).is_err(), "{triangle:?}");
    }
}

#[test]
fn every_pair_is_found_once() {
    let mut random = Random(9);
    let mut points = [0, 1].map(|_| {
        let mut points = random.points(300, 40_000, 3000);
        points.extend(random.points(500, 120, 50));
        points.extend((0..100).map(|k| [-60_000 + 1200 * k, 41_000 + k % 2, 5 * k]));
        points
    });
    points[1].truncate(800);
    let [first, second] = points.each_ref().map(|points| tin(points));
    let mut found = Vec::new();
    crate::join::for_each_pair(&first, &second, |a, b| {
        if crate::pair::have_common_area(&first.corners(a), &second.corners(b)) {
            found.push((a, b));
        }
    });
    found.sort_unstable();
    let all = (0..first.len() as u32).flat_map(|a| (0..second.len() as u32).map(move |b| (a, b)));
    let wanted: Vec<(u32, u32)> =
        all.filter(|(a, b)| crate::pair::have_common_area(&first.corners(*a), &second.corners(*b))).collect();
    assert_eq!(found.len(), wanted.len());
    assert!(found == wanted);
}
