//! Cuts segments and shores to the box of the job, before anything else is done with them.
//!
//! # Why all sites lie in the box
//! The ends of what is left lie in the box, because its corners are whole numbers: rounding does not leave it. Every later site lies between
//! the ends of an edge on both axes, so it lies in the box too.
//!
//! # Why a shore stays closed
//! Think of every place outside the box as moved to the nearest one in it. That moves a ring to a ring, and no part of it ever goes
//! through the inside of the box on the way. So whether a place inside the box is inside the ring does not change. What was outside lies
//! on the border of the box then, and what lies there an even number of times encloses nothing.

use crate::exact::{between, holds};
use delaunay::geometry::{Bounds, Site};

/// A part of the way from the first end of a segment to the last: a numerator and a positive denominator.
type Part = [i64; 2];

fn is_before([a, b]: Part, [c, d]: Part) -> bool {
    i128::from(a) * i128::from(d) < i128::from(c) * i128::from(b)
}

/// Returns the piece of the segment ab in the box, which may be a single place.
pub(crate) fn clipped([a, b]: [Site; 2], within: Bounds<2>) -> Option<[Site; 2]> {
    if holds(&within, a) && holds(&within, b) {
        return Some([a, b]);
    }
    let (mut enters, mut leaves): (Part, Part) = ([0, 1], [1, 1]);
    for axis in 0..2 {
        let [from, to, min, max] = [a[axis], b[axis], within.min[axis], within.max[axis]].map(i64::from);
        let (near, far) = if from <= to { (min, max) } else { (max, min) };
        let (length, ahead, to_far) = ((to - from).abs(), (near - from) * (to - from).signum(), (far - from).abs());
        if from == to {
            if from < min || from > max {
                return None;
            }
            continue;
        }
        let is_beyond = (far - from) * (to - from).signum() < 0;
        if ahead > length || is_beyond {
            return None;
        }
        if ahead > 0 && is_before(enters, [ahead, length]) {
            enters = [ahead, length];
        }
        if to_far < length && is_before([to_far, length], leaves) {
            leaves = [to_far, length];
        }
    }
    (!is_before(leaves, enters)).then(|| [enters, leaves].map(|[part, whole]| between(a, b, part, whole)))
}

/// Returns the shore of a lake with these segments, which make rings, as far as it lies in the box, and then the pieces of the box's
/// border that it needs to be closed.
pub(crate) fn clipped_shore(rings: &[[Site; 2]], within: Bounds<2>) -> (Vec<[Site; 2]>, Vec<[Site; 2]>) {
    let is_inside =
        |&[a, b]: &[Site; 2]| SIDES.iter().all(|side| side.beyond(a, within) < 0 || side.beyond(b, within) < 0);
    let shore = rings.iter().copied().filter(is_inside).filter_map(|segment| clipped(segment, within));
    let border = SIDES.iter().flat_map(|side| side.covered(rings, within));
    (shore.filter(|[a, b]| a != b).collect(), border.collect())
}

/// A side of the box.
struct Side {
    /// The axis that it crosses.
    axis: usize,
    is_max: bool,
}

const SIDES: [Side; 4] = [
    Side { axis: 0, is_max: false },
    Side { axis: 0, is_max: true },
    Side { axis: 1, is_max: false },
    Side { axis: 1, is_max: true },
];

impl Side {
    fn value(&self, within: Bounds<2>) -> i32 {
        if self.is_max { within.max[self.axis] } else { within.min[self.axis] }
    }

    /// Returns how far `place` lies beyond the line of this side.
    fn beyond(&self, place: Site, within: Bounds<2>) -> i64 {
        let off = i64::from(place[self.axis]) - i64::from(self.value(within));
        if self.is_max { off } else { -off }
    }

    /// Returns the pieces of the side that the rings cover an odd number of times, with all beyond the side moved onto it.
    fn covered(&self, rings: &[[Site; 2]], within: Bounds<2>) -> Vec<[Site; 2]> {
        let along = 1 - self.axis;
        let mut ends: Vec<i32> = rings.iter().filter_map(|segment| self.moved(*segment, within)).flatten().collect();
        ends.sort_unstable();
        let pieces = ends.chunks_exact(2).filter(|ends| ends[0] < ends[1]);
        let place = |value: i32| {
            let mut place = [self.value(within); 2];
            place[along] = value;
            place
        };
        pieces.map(|ends| [place(ends[0]), place(ends[1])]).collect()
    }

    /// Returns the ends on this side of what is beyond it of a segment.
    fn moved(&self, [a, b]: [Site; 2], within: Bounds<2>) -> Option<[i32; 2]> {
        let along = 1 - self.axis;
        let off = [a, b].map(|place| self.beyond(place, within));
        let border = || between(a, b, off[0].abs(), off[0].abs() + off[1].abs());
        let ends = match off.map(|off| off >= 0) {
            [false, false] => return None,
            [true, true] => [a, b],
            [true, false] => [a, border()],
            [false, true] => [border(), b],
        };
        Some(ends.map(|place| place[along].clamp(within.min[along], within.max[along])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lakes::{Fraction, Lakes};
    use delaunay::voronoi::test_cases::Random;

    const WITHIN: Bounds<2> = Bounds { min: [0, 0], max: [100, 100] };

    #[test]
    fn segments_through_corners_are_cut_there() {
        for (segment, piece) in [
            ([[0, 0], [100, 100]], Some([[0, 0], [100, 100]])),
            ([[-50, -50], [150, 150]], Some([[0, 0], [100, 100]])),
            ([[-50, 150], [150, -50]], Some([[0, 100], [100, 0]])),
            ([[150, -50], [50, 50]], Some([[100, 0], [50, 50]])),
            ([[-1, 0], [200, 0]], Some([[0, 0], [100, 0]])),
            ([[-1, 1], [1, -1]], Some([[0, 0], [0, 0]])),
            ([[-1, 0], [1, -2]], None),
            ([[-5, -1], [105, -1]], None),
            ([[-5, 7], [-1, 7]], None),
            ([[101, 7], [105, 7]], None),
            ([[-10, 20], [0, 25]], Some([[0, 25], [0, 25]])),
            ([[7, -1_000], [7, 9]], Some([[7, 0], [7, 9]])),
        ] {
            assert_eq!(clipped(segment, WITHIN), piece, "{segment:?}");
            let turned = |[a, b]: [Site; 2]| [b, a];
            assert_eq!(clipped(turned(segment), WITHIN), piece.map(turned), "{segment:?} the other way round");
        }
    }

    #[test]
    fn shores_stay_closed_and_hold_the_same_places() {
        for seed in 0..3000 {
            let mut random = Random(seed * 977 + 5);
            let count = 3 + random.below(6);
            // Many vertices on the border and in its corners.
            let mut at =
                || [(); 2].map(|()| if random.below(3) == 0 { 100 * random.below(2) } else { random.below(400) - 150 });
            let ring: Vec<Site> = (0..count).map(|_| at()).collect();
            let segments: Vec<[Site; 2]> = (0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()]]).collect();
            let (shore, border) = clipped_shore(&segments, WITHIN);
            let all: Vec<[Site; 2]> = shore.into_iter().chain(border).collect();
            let mut ends: Vec<Site> = all.iter().flatten().copied().collect();
            ends.sort_unstable();
            assert!(ends.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0), "{ring:?}: {all:?} is open");
            assert!(ends.iter().all(|end| holds(&WITHIN, *end)));
            let lake = |segments: &[[Site; 2]]| Lakes::new(1, segments.iter().map(|segment| (0, *segment)));
            let (before, after) = (lake(&segments), lake(&all));
            for _ in 0..20 {
                let place = [(); 2].map(|()| 1 + random.below(99));
                let near = |[a, b]: &[Site; 2]| {
                    crate::exact::in_disc(*a, *b, place) && crate::exact::is_near(*a, *b, place, 1)
                };
                let point = Fraction::middle_of(&[place]);
                let same = before.hold(point, |_| true) == after.hold(point, |_| true);
                assert!(same || segments.iter().any(near), "{ring:?}: {place:?}");
            }
        }
    }

    #[test]
    fn a_lake_around_the_box_becomes_the_box() {
        let corners = [[-9, -9], [500, -9], [500, 700], [-9, 700]];
        let ring: Vec<[Site; 2]> = (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect();
        let (shore, border) = clipped_shore(&ring, WITHIN);
        assert_eq!((shore.len(), border.len()), (0, 4));
        // Beside the box there is nothing.
        let beside: Vec<[Site; 2]> = ring.iter().map(|segment| segment.map(|[x, y]| [x + 109, y])).collect();
        assert_eq!(clipped_shore(&beside, WITHIN), (Vec::new(), Vec::new()));
    }
}
