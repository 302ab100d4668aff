//! Cuts pieces of lines into subsegments about as long as the spacing.

use crate::exact::{at_radius, distance2};
use delaunay::geometry::Site;

/// Returns where the piece ab is cut, from `a` to `b`. Cuts lie at multiples of the spacing from the nearer end: pieces that share an end
/// are cut at the same distances from it. Then no cut of one lies in the disc of another, whatever the angle, since the disc over a ring
/// around the shared end touches the circles of the ring only where it starts and ends.
pub(crate) fn cuts(a: Site, b: Site, spacing: u32) -> impl Iterator<Item = Site> {
    let (length, spacing) = ((distance2(a, b) as u64).isqrt() as i64, i64::from(spacing));
    // What is left in the middle is half the spacing at least, and less than five halves.
    let each = (2 * length - spacing).max(0) / (4 * spacing);
    let middle = length - 2 * each * spacing;
    let parts = ((2 * middle + spacing) / (2 * spacing)).max(1);
    let square = |radius: i64| radius * radius;
    let before = (1..=each).map(move |i| at_radius(a, b, square(i * spacing)));
    let between = (1..parts).map(move |i| at_radius(a, b, square(each * spacing + middle * i / parts)));
    let after = (1..=each).rev().map(move |i| at_radius(b, a, square(i * spacing)));
    before.chain(between).chain(after)
}
