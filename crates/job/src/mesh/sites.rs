//! The sites of a tile: its points from the point file, one for every x and y, in an order that depends on the points alone.

use crate::partition::point_file::{PointBlock, PointFiles};
use delaunay::geometry::Bounds;
use multiversion::multiversion;
use points::Point;
use points::options::Duplicates;
use std::cmp::Reverse;
use sys::Result;

/// Reads the points in `blocks` that `is_wanted`, and keeps one of those with equal x and y. Returns the sites in order, and the number of wanted
/// points that were dropped. However often points repeat, about twice as many as stay are read before they are thinned, or 2^20; thinning copies
/// those that stay.
///
/// # Errors
/// [`sys::Error::Io`] if the point file cannot be read.
pub fn load_sites(
    files: &PointFiles,
    blocks: &[PointBlock],
    rule: Duplicates,
    is_wanted: Option<&dyn Fn(&Point) -> bool>,
) -> Result<(Vec<Point>, u64)> {
    let mut points = Vec::with_capacity(blocks.iter().map(|b| b.points as usize).sum::<usize>().min(1 << 20));
    let (mut kept, mut duplicates) = (0, 0);
    for &block in blocks {
        let first = points.len();
        files.read(block, &mut points)?;
        if let Some(is_wanted) = is_wanted {
            retain_from(&mut points, first, is_wanted);
        }
        if points.len() > (2 * kept).max(1 << 20) {
            duplicates += keep_one(&mut points, rule);
            kept = points.len();
        }
    }
    duplicates += keep_one(&mut points, rule);
    Ok((points, duplicates))
}

/// Removes those of `points` from the number `first` on that are not wanted.
fn retain_from(points: &mut Vec<Point>, first: usize, is_wanted: &dyn Fn(&Point) -> bool) {
    let mut kept = first;
    for number in first..points.len() {
        if is_wanted(&points[number]) {
            points[kept] = points[number];
            kept += 1;
        }
    }
    points.truncate(kept);
}

/// Sorts `points` by y, then x, keeps one of every x and y, and returns how many were dropped. Neighbours in the plane become neighbours
/// in memory, and the pipeline works row by row.
fn keep_one(points: &mut Vec<Point>, rule: Duplicates) -> u64 {
    let before = points.len();
    *points = match packed_keys(points) {
        Some(keys) => one_of_each_place(keys.sorted().map(|index| points[index]), before, rule),
        None => {
            points.sort_unstable_by_key(|p| (p.position[1], p.position[0]));
            one_of_each_place(points.iter().copied(), before, rule)
        }
    };
    (before - points.len()) as u64
}

/// Returns one point of every x and y. There are `count` points, and those of one place come one after the other.
fn one_of_each_place(points: impl Iterator<Item = Point>, count: usize, rule: Duplicates) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::with_capacity(count);
    for point in points {
        match kept.last_mut() {
            Some(last) if last.position == point.position => {
                if preferred(&point, last, rule) {
                    *last = point;
                }
            }
            _ => kept.push(point),
        }
    }
    kept
}

/// Tells whether `a` stays rather than `b`, which has the same x and y. Where the rule leaves it open, the other values decide, so that
/// the order of the files does not matter.
fn preferred(a: &Point, b: &Point, rule: Duplicates) -> bool {
    match rule {
        Duplicates::Lowest => (a.z, look(a)) < (b.z, look(b)),
        Duplicates::Highest => (Reverse(a.z), look(a)) < (Reverse(b.z), look(b)),
        Duplicates::First => a.order() < b.order(),
    }
}

/// Returns what tiles may show of a point besides its place. The intensity comes last: whether it is read does not change the others.
fn look(point: &Point) -> (u8, [u16; 3], u16) {
    (point.class, point.rgb, point.intensity)
}

/// For every point its y, its x and its index in one number, from the highest bits on.
struct PackedKeys {
    keys: Vec<u64>,
    /// The bits of y and x together.
    place_bits: u32,
    /// The bits of the index.
    index_bits: u32,
}

impl PackedKeys {
    /// Returns the indices of the points by y, then x.
    fn sorted(mut self) -> impl Iterator<Item = usize> {
        let index_bits = self.index_bits;
        // Indices ascend, and the sort keeps the order of equal keys.
        match self.place_bits {
            // Half as many digits are counted.
            ..=u32::BITS => radsort::sort_by_key(&mut self.keys, |key| (key >> index_bits) as u32),
            _ => radsort::sort_by_key(&mut self.keys, |key| key >> index_bits),
        }
        self.keys.into_iter().map(move |key| (key & ((1 << index_bits) - 1)) as usize)
    }
}

/// Returns the keys of `points`: numbers sort several times faster than points. Returns `None` if 64 bits do not hold them.
fn packed_keys(points: &[Point]) -> Option<PackedKeys> {
    let Bounds { min, max } = bounds(points)?;
    let bits = |value: u64| u64::BITS - value.leading_zeros();
    let along = |p: [i32; 2], axis: usize| (p[axis] as i64 - min[axis] as i64) as u64;
    let (x_bits, index_bits) = (bits(along(max, 0)), bits(points.len() as u64));
    let place_bits = bits(along(max, 1)) + x_bits;
    if place_bits + index_bits > u64::BITS {
        return None;
    }
    let key =
        |(i, p): (usize, &Point)| (along(p.position, 1) << x_bits | along(p.position, 0)) << index_bits | i as u64;
    Some(PackedKeys { keys: points.iter().enumerate().map(key).collect(), place_bits, index_bits })
}

/// Returns the box of the points' x and y.
#[multiversion(targets("x86_64+avx2"))]
fn bounds(points: &[Point]) -> Option<Bounds<2>> {
    Bounds::of_points(points.iter().map(|point| point.position))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keep(points: &[(i32, i32, i32)], rule: Duplicates) -> Vec<(i32, i32, i32)> {
        let mut points: Vec<Point> =
            points.iter().enumerate().map(|(i, p)| Point::new([p.0, p.1], p.2, [0; 3], 2, i as u64)).collect();
        keep_one(&mut points, rule);
        points.iter().map(|p| (p.position[0], p.position[1], p.z)).collect()
    }

    #[test]
    fn a_tile_too_wide_for_packed_keys_is_sorted_too() {
        let points =
            [(1 << 29, 1 << 29, 1), (-(1 << 29), 1 << 29, 2), (0, -(1 << 29), 3), (0, 0, 4), (1 << 29, 1 << 29, 0)];
        let kept = keep(&points, Duplicates::Lowest);
        assert_eq!(kept, [(0, -(1 << 29), 3), (0, 0, 4), (-(1 << 29), 1 << 29, 2), (1 << 29, 1 << 29, 0)]);
    }

    /// Places take 30 to 36 bits, and indices 7.
    #[test]
    fn tiles_of_any_width_are_sorted() {
        for reach in [[1 << 14, 1 << 14], [1 << 15, 1 << 15], [1 << 16, 1 << 15], [1 << 17, 1 << 17]] {
            let place = |i: i32| [i * 7919 % reach[0], i * 104_729 % reach[1]];
            let mut points: Vec<Point> = (0..100).map(|i| Point::new(place(i), i, [0; 3], 2, i as u64)).collect();
            points.push(Point::new(reach, 7, [0; 3], 2, 100));
            let mut expected = points.clone();
            expected.sort_by_key(|point| (point.position[1], point.position[0]));
            assert_eq!(keep_one(&mut points, Duplicates::First), 0);
            assert_eq!(points, expected, "{reach:?}");
        }
    }

    #[test]
    fn one_point_of_every_place_stays() {
        let points = [(5, 5, 30), (1, 1, 9), (5, 5, 10), (5, 5, 20)];
        assert_eq!(keep(&points, Duplicates::Lowest), [(1, 1, 9), (5, 5, 10)]);
        assert_eq!(keep(&points, Duplicates::Highest), [(1, 1, 9), (5, 5, 30)]);
        assert_eq!(keep(&points, Duplicates::First), [(1, 1, 9), (5, 5, 30)]);
        assert_eq!(keep(&[(5, 5, 1), (5, 5, 0)], Duplicates::First), [(5, 5, 1)]);
    }
}
