//! Where a straight line crosses the triangles of a mesh.
//!
//! That a line meets a corner or an edge is decided in whole numbers, and so is the order along it. Places and heights on an edge come from
//! its two ends in the order of their coordinates, so both triangles at an edge give the same bits.

use crate::mesh::Point;
use crate::rectangle::Rectangle;
use std::cmp::Ordering;

/// A straight way from one place to another.
pub type Segment = [[i64; 2]; 2];

/// What a line meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Met {
    /// The beginning of the segment, inside or at the border of a triangle.
    Start,
    /// A corner.
    Corner([i64; 2]),
    /// The inside of an edge, by its ends in the order of their coordinates.
    Edge([i64; 2], [i64; 2]),
    /// The end of the segment.
    End,
}

/// A fraction from 0 to 1: how much of the segment lies before.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    top: i128,
    /// Above 0.
    bottom: i128,
}

/// A place on a segment that has a height.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// What is met there.
    pub met: Met,
    /// How much of the segment lies before.
    pub part: Part,
    /// x, y and z in lattice steps.
    pub place: [f64; 3],
    /// Whether a triangle covers the way from here on.
    pub is_covered_after: bool,
}

impl Part {
    const START: Part = Part { top: 0, bottom: 1 };
    const END: Part = Part { top: 1, bottom: 1 };

    fn of(top: i128, bottom: i128) -> Part {
        if bottom < 0 { Part { top: -top, bottom: -bottom } } else { Part { top, bottom } }
    }

    /// Returns the nearest number, within an ulp.
    pub fn value(self) -> f64 {
        self.top as f64 / self.bottom as f64
    }

    /// Tells whether it is above 0 and below 1, exactly.
    pub fn is_inside(self) -> bool {
        self.top > 0 && self.top < self.bottom
    }

    /// Tells whether it is 0, or below.
    pub fn is_start(self) -> bool {
        self.top <= 0
    }

    fn is_within(self) -> bool {
        self.top >= 0 && self.top <= self.bottom
    }

    /// Compares two parts, exactly.
    pub fn order(self, other: Part) -> Ordering {
        // Beyond the rounding of both, the nearest numbers tell.
        const APART: f64 = 4e-15;
        let [own, others] = [self.value(), other.value()];
        if (own - others).abs() > APART * own.abs().max(others.abs()).max(1.0) {
            own.total_cmp(&others)
        } else {
            exact_order([self, other])
        }
    }
}

/// Compares two fractions by their whole parts, and then by the fractions that are left, upside down: no product overflows.
fn exact_order([mut a, mut b]: [Part; 2]) -> Ordering {
    let mut is_turned = false;
    loop {
        let [whole_a, whole_b] = [a, b].map(|part| part.top.div_euclid(part.bottom));
        let [rest_a, rest_b] = [a, b].map(|part| part.top.rem_euclid(part.bottom));
        let order = match (whole_a.cmp(&whole_b), rest_a, rest_b) {
            (Ordering::Equal, 0, 0) => Ordering::Equal,
            (Ordering::Equal, 0, _) => Ordering::Less,
            (Ordering::Equal, _, 0) => Ordering::Greater,
            (Ordering::Equal, ..) => {
                (a, b) = (Part { top: a.bottom, bottom: rest_a }, Part { top: b.bottom, bottom: rest_b });
                is_turned = !is_turned;
                continue;
            }
            (order, ..) => order,
        };
        return if is_turned { order.reverse() } else { order };
    }
}

/// Calls `visit` with every crossing of a triangle and a segment that is longer than 0, in no order.
pub fn crossings(corners: &[Point; 3], segment: &Segment, mut visit: impl FnMut(Crossing)) {
    let boxes = [Rectangle::around(corners.map(site)), Rectangle::around(*segment)];
    if !boxes[0].meets(&boxes[1]) {
        return;
    }
    let sides = corners.map(|corner| cross(segment[0], segment[1], site(corner)));
    if sides.iter().all(|side| *side > 0) || sides.iter().all(|side| *side < 0) {
        return;
    }
    let mut met = [None; 4];
    let mut count = 0;
    let mut add = |crossing: Crossing| {
        if let Some(place) = met.get_mut(count) {
            *place = Some(crossing);
            count += 1;
        }
    };
    for k in 0..3 {
        let next = (k + 1) % 3;
        if sides[k] == 0 {
            add(at_corner(corners[k], segment));
        } else if (sides[k] < 0) != (sides[next] < 0) && sides[next] != 0 {
            let ends = if site(corners[k]) < site(corners[next]) { [k, next] } else { [next, k] };
            add(on_edge(ends.map(|end| corners[end]), ends.map(|end| sides[end]), segment));
        }
    }
    // The line is within the triangle from the first of these to the last.
    let met = || met.iter().flatten();
    let first = met().min_by(|a, b| exact_order([a.part, b.part])).copied();
    let last = met().max_by(|a, b| exact_order([a.part, b.part])).copied();
    let (Some(first), Some(last)) = (first, last) else { return };
    let goes_on = first.part.order(last.part).is_lt();
    for crossing in met().filter(|crossing| crossing.part.is_within()) {
        let is_covered_after =
            goes_on && crossing.part.order(last.part).is_lt() && crossing.part.order(Part::END).is_lt();
        visit(Crossing { is_covered_after, ..*crossing });
    }
    let holds = |part: Part| exact_order([first.part, part]).is_le() && exact_order([last.part, part]).is_ge();
    if holds(Part::START) {
        let is_covered_after = exact_order([last.part, Part::START]).is_gt();
        visit(Crossing { met: Met::Start, part: Part::START, place: place_in(corners, segment[0]), is_covered_after });
    }
    if holds(Part::END) {
        let place = place_in(corners, segment[1]);
        visit(Crossing { met: Met::End, part: Part::END, place, is_covered_after: false });
    }
}

fn site(point: Point) -> [i64; 2] {
    [point[0], point[1]]
}

/// Returns twice the area of a triangle, above 0 if it is counterclockwise.
fn cross(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let along = |p: [i64; 2], axis: usize| i128::from(p[axis] - a[axis]);
    along(b, 0) * along(c, 1) - along(b, 1) * along(c, 0)
}

fn at_corner(corner: Point, segment: &Segment) -> Crossing {
    let along = |p: [i64; 2], axis: usize| i128::from(p[axis] - segment[0][axis]);
    let product = |p: [i64; 2]| along(p, 0) * along(segment[1], 0) + along(p, 1) * along(segment[1], 1);
    Crossing {
        met: Met::Corner(site(corner)),
        part: Part::of(product(site(corner)), product(segment[1])),
        place: corner.map(|value| value as f64),
        is_covered_after: false,
    }
}

/// The `sides` of the ends have different signs.
fn on_edge(ends: [Point; 2], sides: [i128; 2], segment: &Segment) -> Crossing {
    let [low, high] = ends;
    let share = sides[0] as f64 / (sides[0] - sides[1]) as f64;
    let before = cross(site(low), site(high), segment[0]);
    let after = cross(site(low), site(high), segment[1]);
    Crossing {
        met: Met::Edge(site(low), site(high)),
        part: Part::of(before, before - after),
        place: between(low, high, share),
        is_covered_after: false,
    }
}

fn between(low: Point, high: Point, share: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| low[k] as f64 + share * (high[k] - low[k]) as f64)
}

/// Returns the place with its height in a triangle that holds it. The height at a corner or on an edge does not depend on the triangle.
fn place_in(corners: &[Point; 3], place: [i64; 2]) -> [f64; 3] {
    let mut corners = *corners;
    corners.sort_unstable();
    let weight = |k: usize| cross(site(corners[(k + 1) % 3]), site(corners[(k + 2) % 3]), place);
    let weights = [weight(0), weight(1), weight(2)];
    let area = weights[0] + weights[1] + weights[2];
    let z = |k: usize| corners[k][2] as f64;
    let rise = |k: usize, from: usize| (corners[k][2] - corners[from][2]) as f64;
    let share = |k: usize| weights[k] as f64 / area as f64;
    let height = match weights.map(|weight| weight == 0) {
        [false, false, false] => z(0) + (share(1) * rise(1, 0) + share(2) * rise(2, 0)),
        [true, false, false] => z(1) + share_of_edge(corners[1], corners[2], place) * rise(2, 1),
        [false, true, false] => z(0) + share_of_edge(corners[0], corners[2], place) * rise(2, 0),
        [false, false, true] => z(0) + share_of_edge(corners[0], corners[1], place) * rise(1, 0),
        [false, ..] => z(0),
        [_, false, _] => z(1),
        _ => z(2),
    };
    [place[0] as f64, place[1] as f64, height]
}

/// Returns how much of an edge lies before a place on it.
fn share_of_edge(low: Point, high: Point, place: [i64; 2]) -> f64 {
    let axis = usize::from(low[0] == high[0]);
    (place[axis] - low[axis]) as f64 / (high[axis] - low[axis]) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(triangles: &[[Point; 3]], segment: Segment) -> Vec<Crossing> {
        let mut found = Vec::new();
        triangles.iter().for_each(|corners| crossings(corners, &segment, |crossing| found.push(crossing)));
        found.sort_by(|a, b| a.part.order(b.part).then(a.met.cmp(&b.met)));
        found
    }

    const SQUARE: [[Point; 3]; 2] = [[[0, 0, 0], [10, 0, 10], [10, 10, 20]], [[0, 0, 0], [10, 10, 20], [0, 10, 10]]];

    #[test]
    fn an_edge_is_crossed_at_the_same_bits_from_both_sides() {
        let found = sorted(&SQUARE, [[-3, 7], [13, 4]]);
        let edges: Vec<&Crossing> = found.iter().filter(|crossing| matches!(crossing.met, Met::Edge(..))).collect();
        assert_eq!(edges.len(), 4);
        assert_eq!(edges[1].place.map(f64::to_bits), edges[2].place.map(f64::to_bits));
        assert_eq!(edges[1].met, Met::Edge([0, 0], [10, 10]));
        // z = x + y.
        edges.iter().for_each(|edge| assert!((edge.place[2] - edge.place[0] - edge.place[1]).abs() < 1e-12));
        let covered: Vec<bool> = edges.iter().map(|edge| edge.is_covered_after).collect();
        assert_eq!(covered.iter().filter(|covered| **covered).count(), 2);
        assert!(covered[0] && !covered[3]);
    }

    #[test]
    fn a_line_along_the_diagonal_meets_corners_alone() {
        let found = sorted(&SQUARE, [[-5, -5], [20, 20]]);
        let met: Vec<Met> = found.iter().map(|crossing| crossing.met).collect();
        assert_eq!(met, [Met::Corner([0, 0]), Met::Corner([0, 0]), Met::Corner([10, 10]), Met::Corner([10, 10])]);
        assert_eq!(
            found.iter().map(|crossing| crossing.is_covered_after).collect::<Vec<_>>(),
            [true, true, false, false]
        );
        assert!((found[2].part.value() - 0.6).abs() < 1e-15);
    }

    #[test]
    fn ends_within_triangles_have_heights() {
        let found = sorted(&SQUARE, [[2, 1], [5, 5]]);
        assert_eq!(
            found.first().map(|start| (start.met, start.place, start.is_covered_after)),
            Some((Met::Start, [2.0, 1.0, 3.0], true))
        );
        let ends: Vec<f64> = found.iter().filter(|c| c.met == Met::End).map(|end| end.place[2]).collect();
        assert_eq!(ends, [10.0, 10.0]);
        // A line that only touches a corner, and one that misses.
        assert!(sorted(&SQUARE, [[-1, 1], [1, -1]]).iter().all(|touch| !touch.is_covered_after));
        assert!(sorted(&SQUARE, [[-1, 0], [0, -1]]).is_empty());
    }

    #[test]
    fn parts_are_compared_exactly() {
        let long = (1i128 << 83) - 1;
        let part = |top: i128, bottom: i128| Part::of(top, bottom);
        assert_eq!(part(1, 3).order(part(2, 6)), Ordering::Equal);
        assert_eq!(part(long / 3, long).order(part(long / 3, long - 1)), Ordering::Less);
        assert_eq!(part(long - 1, long).order(part(long - 2, long - 1)), Ordering::Greater);
        assert_eq!(part(-5, -10).order(part(1, 2)), Ordering::Equal);
        assert_eq!(exact_order([part(-7, 2), part(-3, 1)]), Ordering::Less);
    }
}
