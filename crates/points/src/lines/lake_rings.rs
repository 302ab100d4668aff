//! The outlines of lakes. What encloses nothing is taken out of them, and what no area has is found.

use std::collections::HashMap;

use robust::{Coord, orient2d};

use crate::lines::polygons::holds;
use sys::{Result, interrupt};

type Ring = Vec<[f64; 3]>;

/// So many pairs of edges of a lake are compared, and no more: otherwise a lake of a million long edges would take hours.
const MOST_PAIRS: u64 = 20_000_000;

/// The same of vertices of holes and edges of the outline around them, which take less time.
const MOST_IN_HOLES: u64 = 1_000_000_000;

/// The heights of the map at which it is looked for an inside, as parts of that of the outlines. They are no round numbers, so that they meet
/// no regular shape where its edges happen to cross.
const CUTS: [f64; 5] = [0.145_898_034, 0.291_796_068, 0.527_864_045, 0.673_762_079, 0.854_101_966];

/// An inside that is less, as part of the width, is no lake, but what rounding leaves between an outline and a hole that covers it.
const NOTHING: f64 = 2e-3;

/// Between so many pairs it is checked whether the process should stop.
const SOME: u64 = 1 << 20;

/// What is wrong with the outlines of a lake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Flaw {
    /// Two edges cross here.
    Crossing([f64; 2]),
    /// A hole with a vertex here lies outside of the outline.
    HoleOutside([f64; 2]),
    /// The outlines, which begin here, enclose nothing: they go over all of their way an even number of times.
    EnclosesNothing([f64; 2]),
    /// There are too many edges side by side, or too many holes, to look for faults.
    TooMany,
}

/// Returns a ring without the ways out and back along the same vertices, and once if it is run through several times, with the lowest and the
/// highest height of each place. A ring that encloses nothing has fewer than three vertices then.
/// The last vertex is joined with the first, and does not repeat it.
pub(super) fn simplified(ring: Ring) -> Ring {
    if is_on_one_line(&ring) {
        return Vec::new();
    }
    let mut places = ring.clone();
    places.dedup_by(|next, before| is_same(next, before));
    let mut once = without_spikes(places.clone());
    once.truncate(period(&once));
    if once.len() == places.len() { ring } else { with_heights_of(&once, &ring) }
}

/// Removes rings that repeat another one among `holes`, which keeps their heights, and tells whether one is the same as the `outline`.
pub(super) fn remove_repeated(outline: &Ring, holes: &mut Vec<Ring>) -> bool {
    let all: Ring = holes.iter().flatten().copied().collect();
    let count = holes.len();
    let mut known = std::collections::HashSet::new();
    holes.retain(|hole| known.insert(canonical(hole)));
    if holes.len() < count {
        holes.iter_mut().for_each(|hole| *hole = with_heights_of(hole, &all));
    }
    known.contains(&canonical(outline))
}

/// Returns the vertices of a ring with the lowest height that `all` vertices have there, each followed by one with the highest if that differs:
/// a lake takes its lowest height, and is not flat if it has another.
fn with_heights_of(ring: &Ring, all: &Ring) -> Ring {
    let mut ranges: HashMap<[u64; 2], [f64; 2]> = HashMap::new();
    for vertex in all {
        let [low, high] = ranges.entry(place_bits(vertex)).or_insert([vertex[2]; 2]);
        (*low, *high) = (low.min(vertex[2]), high.max(vertex[2]));
    }
    let heights = |vertex: &[f64; 3]| ranges.get(&place_bits(vertex)).copied().unwrap_or([vertex[2]; 2]);
    let vertices = ring.iter().flat_map(|vertex| heights(vertex).map(|z| [vertex[0], vertex[1], z]));
    let mut vertices: Ring = vertices.collect();
    vertices.dedup_by(|next, before| next.map(f64::to_bits) == before.map(f64::to_bits));
    vertices
}

/// Returns what is wrong with the outlines of a lake: the first is its own, and the others are those of holes.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(super) fn flaw_of(rings: &[Ring]) -> Result<Option<Flaw>> {
    if let Some(&[x, y, _]) = rings.first().and_then(|ring| ring.first())
        && encloses_nothing(rings)
    {
        return Ok(Some(Flaw::EnclosesNothing([x, y])));
    }
    if let Some(flaw) = crossing(rings)? {
        return Ok(Some(flaw));
    }
    let Some((outline, holes)) = rings.split_first() else { return Ok(None) };
    if (holes.len() as u64).saturating_mul(outline.len() as u64) > MOST_IN_HOLES {
        return Ok(Some(Flaw::TooMany));
    }
    let closed: Ring = outline.iter().chain(outline.first()).copied().collect();
    let outside = holes.iter().find(|hole| !holds(&closed, hole)).and_then(|hole| hole.first());
    Ok(outside.map(|&[x, y, _]| Flaw::HoleOutside([x, y])))
}

fn is_same(one: &[f64; 3], other: &[f64; 3]) -> bool {
    one[..2] == other[..2]
}

fn is_on_one_line(ring: &Ring) -> bool {
    let Some(first) = ring.first() else { return true };
    let Some(other) = ring.iter().find(|vertex| !is_same(vertex, first)) else { return true };
    ring.iter().all(|vertex| turn(first, other, vertex) == 0.0)
}

/// Returns a ring without its spikes: parts of the way that go back over the vertices that they have come from.
fn without_spikes(ring: Ring) -> Ring {
    let mut way: std::collections::VecDeque<[f64; 3]> = std::collections::VecDeque::with_capacity(ring.len());
    for vertex in ring {
        let before = way.len().checked_sub(2).and_then(|at| way.get(at));
        if before.is_some_and(|before| is_same(before, &vertex)) {
            way.pop_back();
        } else if !way.back().is_some_and(|last| is_same(last, &vertex)) {
            way.push_back(vertex);
        }
    }
    // The same where the ring closes.
    while way.len() > 1 {
        let last = way.len().saturating_sub(1);
        if is_same(&way[0], &way[last]) {
            way.pop_back();
        } else if is_same(&way[1], &way[last]) {
            way.pop_front();
        } else if last > 1 && is_same(&way[0], &way[last.saturating_sub(1)]) {
            way.pop_back();
        } else {
            break;
        }
    }
    way.into()
}

/// Returns after how many vertices a ring begins again, by the failure function of Knuth, Morris and Pratt.
fn period(ring: &Ring) -> usize {
    let mut matched = vec![0usize; ring.len()];
    for at in 1..ring.len() {
        let mut length = matched[at.saturating_sub(1)];
        while length > 0 && !is_same(&ring[at], &ring[length]) {
            length = matched[length.saturating_sub(1)];
        }
        matched[at] = length.saturating_add(usize::from(is_same(&ring[at], &ring[length])));
    }
    let period = ring.len().saturating_sub(matched.last().copied().unwrap_or(0));
    if period > 0 && ring.len().is_multiple_of(period) { period } else { ring.len() }
}

/// Returns the places of a ring from the least one on, in the direction in which the lesser of its neighbours comes next.
fn canonical(ring: &Ring) -> Vec<[u64; 2]> {
    let mut places: Vec<[u64; 2]> = ring.iter().map(place_bits).collect();
    places.dedup();
    let least = (0..places.len()).min_by_key(|&at| places[at]).unwrap_or(0);
    places.rotate_left(least);
    if places.get(1) > places.last() {
        places.reverse();
        places.rotate_right(1);
    }
    places
}

/// Returns what is the same for vertices at the same place: 0 has two signs.
fn place_bits(vertex: &[f64; 3]) -> [u64; 2] {
    [(vertex[0] + 0.0).to_bits(), (vertex[1] + 0.0).to_bits()]
}

/// Returns a number above 0 if c lies to the left of ab, below 0 if it lies to the right, and 0 if it lies on the line. It is exact.
fn turn(a: &[f64; 3], b: &[f64; 3], c: &[f64; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|&[x, y, _]| Coord { x, y });
    orient2d(a, b, c)
}

/// Tells whether the lines from west to east at some heights of the map meet no inside.
fn encloses_nothing(rings: &[Ring]) -> bool {
    let all = |axis: usize| rings.iter().flatten().map(move |vertex| vertex[axis]);
    let range = |axis: usize| {
        let fold = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        all(axis).fold([f64::INFINITY, f64::NEG_INFINITY], fold)
    };
    let ([left, right], [low, high]) = (range(0), range(1));
    CUTS.iter().all(|cut| length_inside(rings, low + cut * (high - low)) <= NOTHING * (right - left))
}

/// Returns how much of the line from west to east through `at` lies inside: an odd number of edges are to the west of it.
fn length_inside(rings: &[Ring], at: f64) -> f64 {
    let edges = rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    let meets = edges.filter(|(a, b)| (a[1] > at) != (b[1] > at));
    let mut places: Vec<f64> = meets.map(|(a, b)| a[0] + (at - a[1]) / (b[1] - a[1]) * (b[0] - a[0])).collect();
    places.sort_unstable_by(f64::total_cmp);
    places.chunks_exact(2).map(|pair| pair[1] - pair[0]).sum()
}

/// Returns the first place found where two edges cross, each in its middle. Edges that touch or lie on one another do not.
fn crossing(rings: &[Ring]) -> Result<Option<Flaw>> {
    let edges = rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    let mut edges: Vec<[[f64; 3]; 2]> = edges.map(|(a, b)| if a[0] <= b[0] { [*a, *b] } else { [*b, *a] }).collect();
    edges.sort_by(|one, other| one[0][0].total_cmp(&other[0][0]));
    let mut active: Vec<&[[f64; 3]; 2]> = Vec::new();
    let mut pairs = 0u64;
    for edge in &edges {
        active.retain(|other| other[1][0] >= edge[0][0]);
        let before = pairs;
        pairs = pairs.saturating_add(active.len() as u64);
        if before / SOME != pairs / SOME {
            interrupt::check()?;
        }
        if pairs > MOST_PAIRS {
            return Ok(Some(Flaw::TooMany));
        }
        if let Some(place) = active.iter().find_map(|other| place_of_crossing(edge, other)) {
            return Ok(Some(Flaw::Crossing(place)));
        }
        active.push(edge);
    }
    Ok(None)
}

fn place_of_crossing([a, b]: &[[f64; 3]; 2], [c, d]: &[[f64; 3]; 2]) -> Option<[f64; 2]> {
    if a[1].max(b[1]) < c[1].min(d[1]) || c[1].max(d[1]) < a[1].min(b[1]) {
        return None;
    }
    let are_apart = |one: f64, other: f64| one > 0.0 && other < 0.0 || one < 0.0 && other > 0.0;
    let (of_a, of_b) = (turn(c, d, a), turn(c, d, b));
    if !are_apart(of_a, of_b) || !are_apart(turn(a, b, c), turn(a, b, d)) {
        return None;
    }
    let part = of_a / (of_a - of_b);
    Some([0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(places: &[[i32; 2]]) -> Ring {
        places.iter().zip(0..).map(|([x, y], z)| [f64::from(*x), f64::from(*y), f64::from(z)]).collect()
    }

    fn places(ring: &Ring) -> Vec<[i32; 2]> {
        ring.iter().map(|vertex| [vertex[0] as i32, vertex[1] as i32]).collect()
    }

    const A: [i32; 2] = [0, 0];
    const B: [i32; 2] = [10, 0];
    const C: [i32; 2] = [10, 10];
    const D: [i32; 2] = [0, 10];
    const OUT: [i32; 2] = [20, 5];

    #[test]
    fn ways_out_and_back_and_repeated_runs_are_taken_out() {
        let square = [A, B, C, D];
        for (given, expected) in [
            (&[A, B, C, D][..], &square[..]),
            (&[A, B, C, D, A, B, C, D], &square),
            (&[A, B, C, D, A, A, B, C, D, A, B, C, D], &square),
            (&[A, B, C, OUT, C, D], &square),
            (&[A, B, C, OUT, [30, 5], OUT, C, C, D], &square),
            (&[OUT, C, D, A, B, C], &[C, D, A, B]),
            (&[C, D, A, B, C, OUT], &[C, D, A, B]),
            (&[A, B, C, D, C, B], &[]),
            (&[A, B, C, D, A, D, C, B], &[]),
            (&[A, B, [20, 0], [5, 0]], &[]),
            (&[A, A, A], &[]),
        ] {
            let mut found = places(&simplified(ring(given)));
            found.dedup();
            assert!(found == expected || found.len() < 3 && expected.is_empty(), "{given:?} {found:?}");
        }
        // Nothing is taken out, so heights of repeated vertices stay too.
        assert_eq!(simplified(ring(&[A, A, B, C, D])), ring(&[A, A, B, C, D]));
        let twice = simplified(vec![
            [0.0, 0.0, 5.0],
            [1.0, 0.0, 5.0],
            [1.0, 1.0, 5.0],
            [0.0, 0.0, 5.0],
            [1.0, 0.0, 2.0],
            [1.0, 1.0, 9.0],
        ]);
        assert_eq!(twice.iter().map(|vertex| vertex[2]).collect::<Vec<_>>(), [5.0, 2.0, 5.0, 5.0, 9.0]);
    }

    #[test]
    fn repeated_holes_are_found_wherever_they_begin() {
        let outline = ring(&[A, B, C, D]);
        let hole = [[2, 2], [4, 2], [4, 4], [2, 4]];
        let mut turned = hole;
        turned.reverse();
        turned.rotate_left(2);
        let mut holes = vec![ring(&hole), ring(&turned), ring(&[[5, 5], [6, 5], [5, 6]])];
        assert!(!remove_repeated(&outline, &mut holes));
        assert_eq!(holes.len(), 2);
        let heights: Vec<f64> = holes[0].iter().map(|vertex| vertex[2]).collect();
        assert_eq!(heights, [0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 2.0, 3.0]);
        assert!(remove_repeated(&outline, &mut vec![ring(&[C, B, A, D])]));
    }

    #[test]
    fn crossings_and_holes_outside_are_found() {
        let flaw =
            |rings: &[&[[i32; 2]]]| flaw_of(&rings.iter().map(|places| ring(places)).collect::<Vec<_>>()).unwrap();
        let inner: &[[i32; 2]] = &[[2, 2], [4, 2], [4, 4]];
        assert_eq!(flaw(&[&[A, B, C, D], inner]), None);
        assert_eq!(flaw(&[&[A, C, B, D]]), Some(Flaw::Crossing([5.0, 5.0])));
        assert_eq!(flaw(&[&[A, B, C, D], &[[2, 2], [14, 3], [2, 4]]]).map(|_| ()), Some(()));
        assert_eq!(flaw(&[&[A, B, C, D], &[[12, 2], [14, 2], [14, 4]]]), Some(Flaw::HoleOutside([12.0, 2.0])));
        let again: &[[i32; 2]] = &[A, B, C, D, A, [5, 0], B, C, D];
        assert_eq!(flaw(&[again]), Some(Flaw::EnclosesNothing([0.0, 0.0])));
        assert_eq!(flaw(&[&[A, B, C, D], &[A, D, C, [10, 7], B]]), Some(Flaw::EnclosesNothing([0.0, 0.0])));
        // A hole touches the outline, two holes touch, and a way leads to an island and back.
        assert_eq!(flaw(&[&[A, B, C, D], &[[10, 5], [8, 4], [8, 6]], &[[8, 6], [6, 6], [6, 8]]]), None);
        assert_eq!(flaw(&[&[A, B, C, [6, 6], [6, 4], [4, 4], [6, 6], C, D]]), None);
    }

    #[test]
    fn long_edges_side_by_side_end() {
        let comb: Ring = (0..40_000).map(|i| [if i % 2 == 0 { 0.0 } else { 1e6 }, f64::from(i), 0.0]).collect();
        assert_eq!(flaw_of(&[comb]).unwrap(), Some(Flaw::TooMany));
    }
}
