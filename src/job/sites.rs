//! The sites of a tile: its points from the spill, one for every x and y, in an order that depends on them alone.

use super::spill::{Block, Spill};
use crate::Result;
use crate::config::Duplicates;
use crate::input::Point;
use std::cmp::Reverse;

/// Reads the points in `blocks` and keeps one of those with equal x and y; the sites in order, and how many points were
/// duplicates. Memory stays within twice the sites, however often they repeat.
///
/// # Errors
/// [`crate::Error::Io`] if the spill cannot be read.
pub fn load(spill: &Spill, blocks: &[Block], rule: Duplicates) -> Result<(Vec<Point>, u64)> {
    let mut points = Vec::with_capacity(blocks.iter().map(|b| b.points as usize).sum::<usize>().min(1 << 20));
    let (mut kept, mut duplicates) = (0, 0);
    for &block in blocks {
        spill.read(block, &mut points)?;
        if points.len() > (2 * kept).max(1 << 20) {
            duplicates += keep_one(&mut points, rule);
            kept = points.len();
        }
    }
    duplicates += keep_one(&mut points, rule);
    Ok((points, duplicates))
}

/// Sorts `points` and drops all but one of every x and y; returns how many were dropped.
fn keep_one(points: &mut Vec<Point>, rule: Duplicates) -> u64 {
    let before = points.len();
    sort(points);
    points.dedup_by(|next, kept| {
        let same = next.position == kept.position;
        if same && preferred(next, kept, rule) {
            *kept = *next;
        }
        same
    });
    (before - points.len()) as u64
}

/// Whether `a` rather than `b`, at the same place, is to stay. Where the rule leaves it open their other values decide,
/// so that the order of the files does not matter.
fn preferred(a: &Point, b: &Point, rule: Duplicates) -> bool {
    match rule {
        Duplicates::Lowest => (a.z, a.class, a.rgb) < (b.z, b.class, b.rgb),
        Duplicates::Highest => (Reverse(a.z), a.class, a.rgb) < (Reverse(b.z), b.class, b.rgb),
        Duplicates::First => a.order() < b.order(),
    }
}

/// Strips of a tile in the order of its sites, so that neighbours in the plane are neighbours in memory.
const STRIPS: i64 = 4;

/// Sorts by strip of x, then y, then x.
fn sort(points: &mut [Point]) {
    let xs = || points.iter().map(|p| p.position[0] as i64);
    let (Some(min), Some(max)) = (xs().min(), xs().max()) else { return };
    let width = (max - min) / STRIPS + 1;
    points.sort_unstable_by_key(|p| ((p.position[0] as i64 - min) / width, p.position[1], p.position[0]));
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
    fn one_of_every_place_stays() {
        let points = [(5, 5, 30), (1, 1, 9), (5, 5, 10), (5, 5, 20)];
        assert_eq!(keep(&points, Duplicates::Lowest), [(1, 1, 9), (5, 5, 10)]);
        assert_eq!(keep(&points, Duplicates::Highest), [(1, 1, 9), (5, 5, 30)]);
        assert_eq!(keep(&points, Duplicates::First), [(1, 1, 9), (5, 5, 30)]);
        assert_eq!(keep(&[(5, 5, 1), (5, 5, 0)], Duplicates::First), [(5, 5, 1)]);
    }
}
