//! The overlay pair by pair, in exact fractions.

use super::rational::Fraction;
use crate::{Point, Totals, TriangleMesh};

/// x, y, and the difference of the heights.
type Place = [Fraction; 3];

/// Area, cut, fill, the greatest rise and the greatest fall.
pub(crate) fn totals(before: &TriangleMesh, after: &TriangleMesh, threshold: i64) -> [f64; 5] {
    let mut sums = [0.0; 5];
    for b in 0..before.len() as u32 {
        for a in 0..after.len() as u32 {
            add_pair(&before.corners(b), &after.corners(a), threshold, &mut sums);
        }
    }
    sums
}

pub(crate) fn as_numbers(totals: &Totals) -> [f64; 5] {
    let [area, cut, fill] = [totals.area, totals.cut, totals.fill].map(|sum| sum.value().unwrap());
    [area, cut, fill, totals.max_rise, totals.max_fall]
}

fn add_pair(before: &[Point; 3], after: &[Point; 3], threshold: i64, sums: &mut [f64; 5]) {
    let mut polygon: Vec<Place> = after.iter().map(|p| [p[0], p[1], p[2]].map(Fraction::of)).collect();
    for k in 0..3 {
        let [from, to] = [before[k], before[(k + 1) % 3]];
        polygon = clipped(&polygon, |place| side(from, to, place));
    }
    if area_and_volume(&polygon)[0].sign() <= 0 {
        return;
    }
    for place in &mut polygon {
        place[2] = place[2].minus(&height(before, place));
    }
    let [area, _] = area_and_volume(&polygon);
    sums[0] += area.value();
    let limit = Fraction::of(threshold);
    let above = clipped(&polygon, |place| place[2].minus(&limit));
    let below = clipped(&polygon, |place| Fraction::of(-threshold).minus(&place[2]));
    sums[2] += area_and_volume(&above)[1].value();
    sums[1] -= area_and_volume(&below)[1].value();
    for place in &polygon {
        sums[3] = f64::max(sums[3], place[2].value());
        sums[4] = f64::max(sums[4], -place[2].value());
    }
}

fn side(from: Point, to: Point, place: &Place) -> Fraction {
    let along = |axis: usize| Fraction::of(to[axis] - from[axis]);
    let off = |axis: usize| place[axis].minus(&Fraction::of(from[axis]));
    along(0).times(&off(1)).minus(&along(1).times(&off(0)))
}

/// The height of a triangle's plane.
fn height(triangle: &[Point; 3], place: &Place) -> Fraction {
    let mut sum = Fraction::of(0);
    let mut area = Fraction::of(0);
    for k in 0..3 {
        let weight = side(triangle[k], triangle[(k + 1) % 3], place);
        sum = sum.plus(&weight.times(&Fraction::of(triangle[(k + 2) % 3][2])));
        area = area.plus(&weight);
    }
    sum.over(&area)
}

fn clipped(polygon: &[Place], value: impl Fn(&Place) -> Fraction) -> Vec<Place> {
    let mut kept = Vec::new();
    for (k, place) in polygon.iter().enumerate() {
        let next = &polygon[(k + 1) % polygon.len()];
        let [here, there] = [value(place), value(next)];
        if here.sign() >= 0 {
            kept.push(place.clone());
        }
        if here.sign() * there.sign() < 0 {
            let t = here.over(&here.minus(&there));
            kept.push([0, 1, 2].map(|axis| place[axis].plus(&t.times(&next[axis].minus(&place[axis])))));
        }
    }
    kept
}

fn area_and_volume(polygon: &[Place]) -> [Fraction; 2] {
    let (mut double, mut sixfold) = (Fraction::of(0), Fraction::of(0));
    for pair in polygon.windows(2).skip(1) {
        let off = |place: &Place, axis: usize| place[axis].minus(&polygon[0][axis]);
        let [a, b] = [&pair[0], &pair[1]];
        let area = off(a, 0).times(&off(b, 1)).minus(&off(a, 1).times(&off(b, 0)));
        double = double.plus(&area);
        sixfold = sixfold.plus(&area.times(&polygon[0][2].plus(&a[2]).plus(&b[2])));
    }
    [double.over(&Fraction::of(2)), sixfold.over(&Fraction::of(6))]
}
