//! From features to segments: vertices are checked, repeated ones left out, heights that are missing here and there filled in, and what lies
//! outside the box of the job is cut off.

use crate::clip::{clipped, clipped_shore};
use crate::error::BreaklineError;
use crate::exact::{distance2, holds, round};
use crate::feature::{Feature, FeatureId, FeatureKind, Vertex};
use crate::findings::{Findings, Rise, Uneven, worst};
use crate::options::BreaklineOptions;
use delaunay::geometry::REACH;
use delaunay::geometry::Site;
use std::cmp::Reverse;
use sys::interrupt;

/// A segment of a feature, between two different places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Segment {
    /// The ends, the lesser one first.
    pub(crate) ends: [Site; 2],
    /// The kind of its feature.
    pub(crate) kind: FeatureKind,
    /// The ends before it was cut off at the box.
    pub(crate) whole: [Site; 2],
    /// The heights of those, if the file has them.
    pub(crate) z: [Option<i32>; 2],
    /// Its feature.
    pub(crate) id: FeatureId,
    /// The number of its lake, which is `u32::MAX` for lines.
    pub(crate) lake: u32,
}

/// Returns the segments of all features, sorted, and the number of lakes.
///
/// # Errors
/// [`BreaklineError::Wall`] and [`BreaklineError::OutOfReach`].
pub(crate) fn segments_of(
    features: &[Feature],
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> Result<(Vec<Segment>, u32), BreaklineError> {
    let mut ordered: Vec<&Feature> = features.iter().collect();
    // The parts of a feature share its id.
    ordered.sort_unstable_by(|a, b| (a.id, a.kind, &a.paths).cmp(&(b.id, b.kind, &b.paths)));
    let mut cleaner = Cleaner { options, findings, segments: Vec::new(), lakes: 0 };
    for feature in ordered {
        interrupt::check()?;
        check_reach(feature)?;
        match feature.kind {
            FeatureKind::Lake => cleaner.lake(feature),
            FeatureKind::River | FeatureKind::Line => cleaner.lines(feature)?,
        }
    }
    let Cleaner { mut segments, lakes, .. } = cleaner;
    segments.sort_unstable();
    // Of lines that are the same, the first says all. Of lakes, it counts how often a shore goes over a segment.
    segments.dedup_by(|next, first| next.lake == u32::MAX && Segment { id: first.id, ..*next } == *first);
    findings.features = features.len() as u64;
    findings.segments = segments.len() as u64;
    worst(&mut findings.worst_rises, |rise| Reverse(rise.steps));
    worst(&mut findings.worst_uneven, |lake| Reverse(lake.highest.abs_diff(lake.lowest)));
    Ok((segments, lakes))
}

fn check_reach(feature: &Feature) -> Result<(), BreaklineError> {
    let is_out = |v: &&Vertex| v.place.iter().any(|value| !(-REACH..=REACH).contains(value));
    let out = feature.paths.iter().flatten().filter(is_out).map(|v| v.place).min();
    out.map_or(Ok(()), |place| Err(BreaklineError::OutOfReach { id: feature.id, place }))
}

struct Cleaner<'a> {
    options: &'a BreaklineOptions,
    findings: &'a mut Findings,
    segments: Vec<Segment>,
    lakes: u32,
}

impl Cleaner<'_> {
    /// Adds the rings of a lake. All have the lowest height: water does not stand above its shore.
    fn lake(&mut self, feature: &Feature) {
        let by_height = |v: &&Vertex| (v.z, v.place);
        let vertices = || feature.paths.iter().flatten().filter(|v| v.z.is_some());
        let height = vertices().min_by_key(by_height).and_then(|v| v.z);
        let highest = vertices().max_by_key(by_height).and_then(known_height);
        let range =
            height.zip(highest).map(|(lowest, (place, highest))| Uneven { id: feature.id, lowest, highest, place });
        let is_uneven = |range: &Uneven| range.highest.abs_diff(range.lowest) > self.options.height_tolerance;
        let uneven = range.filter(is_uneven);
        self.findings.uneven_lakes += u64::from(uneven.is_some());
        self.findings.worst_uneven.extend(uneven);
        let mut rings: Vec<[Site; 2]> = Vec::new();
        for path in &feature.paths {
            let mut ring: Vec<Site> = path.iter().map(|v| v.place).collect();
            ring.dedup();
            self.findings.repeated_vertices += (path.len() - ring.len()) as u64;
            ring.extend(ring.first().copied().filter(|first| Some(first) != ring.last()));
            // A closed ring repeats its first vertex, so three different ones make four.
            if ring.len() < 4 { self.findings.empty_paths += 1 } else { rings.extend(ring.windows(2).map(in_order)) }
        }
        self.findings.empty_paths += u64::from(!rings.is_empty() && cancel_out(&rings));
        self.shore(feature, height, rings);
        self.lakes += 1;
    }

    /// Adds the shore that a lake with these rings has in the box.
    fn shore(&mut self, feature: &Feature, height: Option<i32>, rings: Vec<[Site; 2]>) {
        let (shore, border) = match self.options.within {
            Some(within) => clipped_shore(&rings, within),
            None => (rings, Vec::new()),
        };
        self.findings.lakes_at_border += u64::from(!border.is_empty());
        let Feature { kind, id, .. } = *feature;
        let segment = |ends| Segment { ends, kind, whole: ends, z: [height; 2], id, lake: self.lakes };
        self.segments.extend(shore.into_iter().chain(border).map(segment));
    }

    fn lines(&mut self, feature: &Feature) -> Result<(), BreaklineError> {
        let mut rise: Option<Rise> = None;
        for path in &feature.paths {
            let mut line = path.clone();
            line.dedup_by(|next, kept| {
                let repeats = next.place == kept.place;
                kept.z = if repeats { kept.z.into_iter().chain(next.z).min() } else { kept.z };
                repeats
            });
            self.check_walls(feature.id, path)?;
            self.findings.repeated_vertices += (path.len() - line.len()) as u64;
            if line.len() < 2 {
                self.findings.empty_paths += 1;
                continue;
            }
            fill_heights(&mut line);
            rise = rise.into_iter().chain(rise_of(feature.id, &line)).max_by_key(|r| (r.steps, Reverse(r.place)));
            self.add(feature, &line);
        }
        let is_river = feature.kind == FeatureKind::River;
        let has_no_height = feature.paths.iter().flatten().all(|v| v.z.is_none());
        self.findings.rivers_without_heights += u64::from(is_river && has_no_height);
        if let Some(rise) = rise.filter(|rise| is_river && rise.steps > self.options.height_tolerance) {
            self.findings.rising_rivers += 1;
            self.findings.worst_rises.push(rise);
        }
        Ok(())
    }

    /// Refuses a line that goes straight up at a vertex in the box. One that comes back to a place at another height is found where heights
    /// disagree.
    fn check_walls(&self, id: FeatureId, path: &[Vertex]) -> Result<(), BreaklineError> {
        let is_in_box = |place: Site| self.options.within.is_none_or(|within| holds(&within, place));
        let together = path.chunk_by(|one, other| one.place == other.place).filter(|same| is_in_box(same[0].place));
        let heights = |same: &[Vertex]| {
            let known = || same.iter().filter_map(|vertex| vertex.z);
            Some((same[0].place, [known().min()?, known().max()?]))
        };
        let is_wall = |(_, [low, high]): &(Site, [i32; 2])| high.abs_diff(*low) > self.options.height_tolerance;
        let wall = together.filter_map(heights).filter(is_wall).min();
        wall.map_or(Ok(()), |(place, heights)| Err(BreaklineError::Wall { id, place, heights }))
    }

    /// Adds what lies in the box of the segments of a path whose neighbouring vertices differ.
    fn add(&mut self, feature: &Feature, path: &[Vertex]) {
        for pair in path.windows(2) {
            let [a, b] = if pair[0].place < pair[1].place { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
            let whole = [a.place, b.place];
            let in_box = self.options.within.map_or(Some(whole), |within| clipped(whole, within));
            let ends = in_box.filter(|[a, b]| a != b);
            let cut_off = ends.map_or(1, |ends| u64::from(ends[0] != whole[0]) + u64::from(ends[1] != whole[1]));
            self.findings.pieces_outside += cut_off;
            let Feature { kind, id, .. } = *feature;
            let segment = |ends| Segment { ends, kind, whole, z: [a.z, b.z], id, lake: u32::MAX };
            self.segments.extend(ends.map(segment));
        }
    }
}

/// Tells whether outlines go over each of their segments an even number of times, so that there is no water between them: a hole may cover
/// its lake on the lattice, though not in the file.
fn cancel_out(rings: &[[Site; 2]]) -> bool {
    let mut segments = rings.to_vec();
    segments.sort_unstable();
    segments.chunk_by(|one, other| one == other).all(|same| same.len().is_multiple_of(2))
}

/// Returns the segment between neighbouring vertices, the lesser first.
fn in_order(pair: &[Site]) -> [Site; 2] {
    [pair[0].min(pair[1]), pair[0].max(pair[1])]
}

fn known_height(vertex: &Vertex) -> Option<(Site, i32)> {
    Some((vertex.place, vertex.z?))
}

/// Gives vertices without a height one that lies on the line between the nearest vertices before and after that have one, or that of the
/// nearest one at an end. A line without any height stays without.
fn fill_heights(line: &mut [Vertex]) {
    let known: Vec<(usize, i32)> = line.iter().enumerate().filter_map(|(i, v)| Some((i, v.z?))).collect();
    if let (Some(&(first, low)), Some(&(last, high))) = (known.first(), known.last()) {
        line[..first].iter_mut().for_each(|v| v.z = Some(low));
        line[last..].iter_mut().for_each(|v| v.z = Some(high));
    }
    for pair in known.windows(2) {
        fill_between(line, pair[0], pair[1]);
    }
}

fn fill_between(line: &mut [Vertex], (from, low): (usize, i32), (to, high): (usize, i32)) {
    let length = |pair: &[Vertex]| i128::from((distance2(pair[0].place, pair[1].place) as u64).isqrt().max(1));
    let whole: i128 = line[from..=to].windows(2).map(length).sum();
    let mut way = 0;
    for i in from + 1..to {
        way += length(&line[i - 1..=i]);
        let step = round((i128::from(high) - i128::from(low)) * way, whole);
        line[i].z = Some((i128::from(low) + step) as i32);
    }
}

/// Returns where the line rises most above a place that comes before, on the way from its higher end to its lower one.
fn rise_of(id: FeatureId, line: &[Vertex]) -> Option<Rise> {
    let known: Vec<(Site, i32)> = line.iter().filter_map(known_height).collect();
    let falls = known.first()?.1 >= known.last()?.1;
    let way: Box<dyn Iterator<Item = &(Site, i32)>> =
        if falls { Box::new(known.iter()) } else { Box::new(known.iter().rev()) };
    let mut lowest = i32::MAX;
    let rises = way.map(|&(place, z)| {
        lowest = lowest.min(z);
        Rise { id, place, steps: z.abs_diff(lowest) }
    });
    rises.filter(|rise| rise.steps > 0).max_by_key(|rise| (rise.steps, Reverse(rise.place)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the file, the hole may be smaller by less than half a step.
    #[test]
    fn lakes_that_a_hole_covers_on_the_lattice_are_counted() {
        let square = |low: i32, high: i32| {
            [[low, low], [high, low], [high, high], [low, high]].map(|place| Vertex { place, z: Some(5) }).to_vec()
        };
        let covered = |hole: Vec<Vertex>| {
            let id = FeatureId { file: 0, feature: 1 };
            let lake = Feature { kind: FeatureKind::Lake, id, paths: vec![square(0, 100), hole] };
            let mut findings = Findings::default();
            segments_of(&[lake], &BreaklineOptions::new(10, None), &mut findings).unwrap();
            findings.empty_paths
        };
        let mut turned = square(0, 100);
        turned.reverse();
        assert_eq!([square(0, 100), turned, square(1, 99), square(0, 50)].map(covered), [1, 1, 0, 0]);
    }
}
