//! Made-up scenes whose ground is known.

use crate::{CellNumbers, CoveredArea, Ground, GroundSizes, LowestHeights, MetricLattice, PointCollector};

/// Centimetres.
const SCALE: MetricLattice = MetricLattice { horizontal: 0.01, vertical: 0.01, offset: [0; 2] };

/// A generator of numbers that look random (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators").
struct Random(u64);

impl Random {
    /// Returns a number from `low` to `high`.
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// What stands on the ground.
enum Object {
    /// A roof: its middle, its half sides and its height.
    House([f64; 2], [f64; 2], f64),
    /// A cone of leaves with some gaps: its middle, its radius and its height.
    Tree([f64; 2], f64, f64),
}

impl Object {
    /// Returns how high it stands above the ground at a place; `None` beside it.
    fn height(&self, [x, y]: [f64; 2], gap: f64) -> Option<f64> {
        match *self {
            Object::House([at, up], [width, depth], height) => {
                ((x - at).abs() < width && (y - up).abs() < depth).then_some(height)
            }
            Object::Tree([at, up], radius, height) => {
                let from_middle = ((x - at).powi(2) + (y - up).powi(2)).sqrt();
                (from_middle < radius && gap < 0.7).then(|| 1.5 + height * (1.0 - from_middle / radius))
            }
        }
    }
}

/// A point, and whether it is on the ground.
type Labelled = ([i32; 3], bool);

/// Returns a scene of 100 by 100 m: waves on a slope, houses, trees, low noise and gaps without points.
fn scene(seed: u64) -> Vec<Labelled> {
    let mut random = Random(seed);
    let slope = [random.within(-0.2, 0.2), random.within(-0.2, 0.2)];
    let (length, rise) = (random.within(25.0, 60.0), random.within(0.0, 2.5));
    let ground =
        |[x, y]: [f64; 2]| 100.0 + slope[0] * x + slope[1] * y + rise * ((x / length).sin() + (y / length).cos());
    let mut objects = Vec::new();
    for _ in 0..4 {
        let middle = [random.within(10.0, 90.0), random.within(10.0, 90.0)];
        let sides = [random.within(3.0, 9.0), random.within(3.0, 9.0)];
        objects.push(Object::House(middle, sides, random.within(4.0, 12.0)));
    }
    for _ in 0..15 {
        let middle = [random.within(0.0, 100.0), random.within(0.0, 100.0)];
        objects.push(Object::Tree(middle, random.within(1.5, 4.0), random.within(4.0, 15.0)));
    }
    let gap = [random.within(0.0, 100.0), random.within(0.0, 100.0)];
    let spacing = random.within(0.5, 1.2);
    let side = (100.0 / spacing) as i32;
    let mut points = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let place = [column, row].map(|n| spacing * (f64::from(n) + random.within(0.0, 1.0)));
            if (place[0] - gap[0]).abs() < 8.0 && (place[1] - gap[1]).abs() < 8.0 {
                continue;
            }
            let chance = random.within(0.0, 1.0);
            let above = objects.iter().filter_map(|object| object.height(place, chance)).reduce(f64::max);
            let noise = (random.within(0.0, 1.0) < 3e-4).then(|| random.within(-30.0, -4.0));
            let z = ground(place) + noise.or(above).unwrap_or(random.within(-0.04, 0.04));
            points.push((
                [place[0], place[1], z].map(|metres| (100.0 * metres).round() as i32),
                noise.or(above).is_none(),
            ));
        }
    }
    points
}

fn found(points: &[Labelled]) -> Ground {
    found_on(SCALE, points)
}

fn found_on(lattice: MetricLattice, points: &[Labelled]) -> Ground {
    let points = points.iter().map(|(point, _)| *point);
    Ground::of_points(lattice, points, GroundSizes::default(), u64::MAX, || Ok::<_, ()>(())).unwrap().unwrap()
}

#[test]
fn the_ground_of_scenes_is_found() {
    let mut worst = [0.0f64; 2];
    for seed in 0..200 {
        let points = scene(seed);
        let ground = found(&points);
        let share = |of: bool| {
            let all = points.iter().filter(|(_, is_ground)| *is_ground == of);
            let wrong = all.clone().filter(|(point, _)| ground.has(*point) != of).count();
            wrong as f64 / all.count() as f64
        };
        let wrong = [share(true), share(false)];
        assert!(wrong[0] < 0.05 && wrong[1] < 0.05, "{seed}: {wrong:?}");
        worst = [worst[0].max(wrong[0]), worst[1].max(wrong[1])];
    }
    println!("at worst {:.4} of the ground missed, {:.4} of the objects taken for it", worst[0], worst[1]);
}

/// On a slope, shrubs are told from the ground by less than the slope falls by in a cell or two.
#[test]
fn shrubs_on_a_slope_are_no_ground() {
    let mut random = Random(600);
    let points: Vec<Labelled> = (0..100 * 100)
        .map(|number| {
            let place = [number % 100, number / 100].map(|n| f64::from(n) + random.within(0.0, 1.0));
            let is_shrub = random.within(0.0, 1.0) < 0.05;
            let above = if is_shrub { random.within(0.9, 1.5) } else { random.within(-0.04, 0.04) };
            let z = 100.0 + 0.6 * place[0] - 0.2 * place[1] + above;
            ([place[0], place[1], z].map(|metres| (100.0 * metres).round() as i32), !is_shrub)
        })
        .collect();
    let ground = found(&points);
    let wrong = points.iter().filter(|(point, is_ground)| ground.has(*point) != *is_ground).count();
    assert!(wrong < 25, "{wrong} of {}", points.len());
}

/// Returns a scene of 200 by 150 m with a point in each square metre, where something rises above a gentle slope.
fn raised(seed: u64, above: impl Fn([f64; 2]) -> f64) -> Vec<Labelled> {
    let mut random = Random(seed);
    let point = |number: i32| {
        let place = [number % 200, number / 200].map(|n| f64::from(n) + random.within(0.0, 1.0));
        let rise = above(place);
        let z = 100.0 + 0.03 * place[0] + rise + random.within(-0.04, 0.04);
        ([place[0], place[1], z].map(|metres| (100.0 * metres).round() as i32), rise == 0.0)
    };
    (0..200 * 150).map(point).collect()
}

/// A hall wider than the largest building has edges all around; of its corners, which smaller discs cut off, some comes back. A mound of its size has
/// slopes, and a terrace an edge on two sides alone.
#[test]
fn halls_go_and_mounds_and_terraces_stay() {
    let from_border = |[x, y]: [f64; 2], [west, south, east, north]: [f64; 4]| {
        (x - west).min(east - x).min(y - south).min(north - y).max(0.0)
    };
    let taken = |above: &dyn Fn([f64; 2]) -> f64| {
        let points = raised(800, above);
        let ground = found(&points);
        assert!(points.iter().filter(|(point, is_low)| *is_low && !ground.has(*point)).count() < 300, "ground is lost");
        let raised = points.iter().filter(|(_, is_low)| !is_low);
        raised.clone().filter(|(point, _)| ground.has(*point)).count() as f64 / raised.count() as f64
    };
    let hall = |place| if from_border(place, [50.0, 40.0, 130.0, 105.0]) > 0.0 { 9.0 } else { 0.0 };
    let mound = |place| (0.4 * from_border(place, [40.0, 30.0, 155.0, 120.0])).min(9.0);
    let terrace = |[x, y]: [f64; 2]| if x > 60.0 && y > 50.0 { 9.0 } else { 0.0 };
    assert!(taken(&hall) < 0.3, "{}", taken(&hall));
    assert!(taken(&mound) > 0.95, "{}", taken(&mound));
    assert!(taken(&terrace) > 0.95, "{}", taken(&terrace));
}

/// Adds the points to `all` in another order, piece by piece.
fn in_pieces<C: PointCollector>(points: &[Labelled], all: &mut C) {
    let mut pieces: Vec<C> = (0..7).map(|_| all.emptied()).collect();
    for (number, (point, _)) in points.iter().rev().enumerate() {
        pieces[number * number % 7].add([*point].into_iter());
    }
    pieces.iter().rev().for_each(|piece| all.join(piece));
}

/// Points in any order, and in any pieces, give the same ground.
#[test]
fn the_ground_depends_on_the_points_alone() {
    for seed in 300..306 {
        let points = scene(seed);
        let known = found(&points);
        let expected = known.columns();
        let mut area = CoveredArea::new(SCALE);
        in_pieces(&points, &mut area);
        let mut all = LowestHeights::new(&area);
        in_pieces(&points, &mut all);
        let ground = Ground::find(all, GroundSizes::default(), || Ok::<_, ()>(())).unwrap();
        let columns = ground.columns();
        assert_eq!((&columns.numbers, &columns.places), (&expected.numbers, &expected.places));
        let bits = |cells: &[&[CellNumbers]]| {
            cells.iter().flat_map(|cells| cells.as_flattened()).map(|number| number.to_bits()).collect::<Vec<u32>>()
        };
        assert!(bits(&columns.cells) == bits(&expected.cells));
    }
}

/// Lattices that begin elsewhere give the same ground.
#[test]
fn the_ground_is_the_same_on_every_lattice() {
    for (seed, offset) in
        [(500, [1_234_567, -89_123, 4_321]), (501, [-7, 400_000_001, -60_000]), (502, [1 << 27, 33, 1])]
    {
        let points = scene(seed);
        let moved = |[x, y, z]: [i32; 3]| [x - offset[0], y - offset[1], z - offset[2]];
        let there: Vec<Labelled> = points.iter().map(|(point, is_ground)| (moved(*point), *is_ground)).collect();
        let other = MetricLattice { offset: [offset[0].into(), offset[1].into()], ..SCALE };
        let (here, there) = (found(&points), found_on(other, &there));
        assert!(points.iter().all(|(point, _)| here.has(*point) == there.has(moved(*point))), "{seed}");
    }
}

/// What is stored and read again is the same ground.
#[test]
fn the_ground_can_be_stored() {
    let points = scene(400);
    let ground = found(&points);
    let columns = ground.columns();
    let cells = columns.cells.concat();
    let read = |cells: &[CellNumbers]| {
        let part = |range: std::ops::Range<usize>| Ok::<_, ()>(cells[range.start..range.end.min(cells.len())].to_vec());
        Ground::of_columns(columns.numbers.clone(), columns.places.to_vec(), part).unwrap()
    };
    let again = read(&cells).unwrap();
    assert!(points.iter().all(|(point, _)| ground.has(*point) == again.has(*point)));
    assert!(read(&cells[1..]).is_none());
}

/// Clouds that are hardly any.
#[test]
fn few_points_and_far_ones_are_no_problem() {
    for points in [
        vec![],
        vec![[0, 0, 0]],
        vec![[i32::MIN / 2, i32::MIN / 2, i32::MIN], [i32::MAX / 2, i32::MAX / 2, i32::MAX]],
        (0..50).map(|n| [n * 1_000_000, -n * 7_000_000, n * 100_000]).collect(),
    ] {
        let labelled: Vec<Labelled> = points.iter().map(|point| (*point, true)).collect();
        let ground = found(&labelled);
        let on_it = points.iter().filter(|point| ground.has(**point)).count();
        assert!(on_it * 2 >= points.len(), "{on_it} of {points:?}");
    }
}
