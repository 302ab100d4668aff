//! From features to segments: vertices are checked, repeated ones left out, heights that are missing here and there filled in.

use crate::breaklines::error::BreaklineError;
use crate::breaklines::exact::{distance2, round};
use crate::breaklines::feature::{Feature, FeatureId, FeatureKind, Vertex};
use crate::breaklines::findings::{Findings, Rise, Uneven, worst};
use crate::breaklines::options::BreaklineOptions;
use crate::geometry::Site;
use crate::geometry::lattice::REACH;
use std::cmp::Reverse;

/// A segment of a feature, between two different places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Segment {
    /// The ends, the lesser one first.
    pub(crate) ends: [Site; 2],
    /// The kind of its feature.
    pub(crate) kind: FeatureKind,
    /// The heights of the ends, if the file has them.
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
    ordered.sort_unstable_by_key(|feature| (feature.id, feature.kind));
    let mut cleaner = Cleaner { options, findings, segments: Vec::new(), lakes: 0 };
    for feature in ordered {
        check_reach(feature)?;
        match feature.kind {
            FeatureKind::Lake => cleaner.lake(feature),
            FeatureKind::River | FeatureKind::Line => cleaner.lines(feature)?,
        }
    }
    let Cleaner { mut segments, lakes, .. } = cleaner;
    segments.sort_unstable();
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
        for path in &feature.paths {
            let mut ring: Vec<Vertex> = path.iter().map(|v| Vertex { place: v.place, z: height }).collect();
            ring.dedup();
            self.findings.repeated_vertices += (path.len() - ring.len()) as u64;
            ring.extend(ring.first().copied().filter(|first| Some(first) != ring.last()));
            // A closed ring repeats its first vertex, so three different ones make four.
            if ring.len() < 4 { self.findings.empty_paths += 1 } else { self.add(feature, &ring) }
        }
        self.lakes += 1;
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
            self.check_walls(feature.id, path, &line)?;
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
        if let Some(rise) = rise.filter(|rise| is_river && rise.steps > self.options.height_tolerance) {
            self.findings.rising_rivers += 1;
            self.findings.worst_rises.push(rise);
        }
        Ok(())
    }

    /// Refuses a line that has two heights at one place. `line` is the path without repeated vertices. A closed line may end at another
    /// height than it starts: that is found where heights disagree.
    fn check_walls(&self, id: FeatureId, path: &[Vertex], line: &[Vertex]) -> Result<(), BreaklineError> {
        let closed = line.len() > 2 && line.first().map(|v| v.place) == line.last().map(|v| v.place);
        let mut known: Vec<(Site, i32)> = line[usize::from(closed)..].iter().filter_map(known_height).collect();
        known.sort_unstable();
        let apart = known.chunk_by(|one, other| one.0 == other.0).map(<[_]>::to_vec);
        let together = path.chunk_by(|one, other| one.place == other.place);
        let together =
            together.filter(|same| same.len() > 1).map(|same| same.iter().filter_map(known_height).collect());
        let heights =
            |same: Vec<(Site, i32)>| Some((same.iter().min()?.0, [same.iter().min()?.1, same.iter().max()?.1]));
        let is_wall = |(_, [low, high]): &(Site, [i32; 2])| high.abs_diff(*low) > self.options.height_tolerance;
        let wall = apart.chain(together).filter_map(heights).filter(is_wall).min();
        wall.map_or(Ok(()), |(place, heights)| Err(BreaklineError::Wall { id, place, heights }))
    }

    /// Adds the segments of a path whose neighbouring vertices differ.
    fn add(&mut self, feature: &Feature, path: &[Vertex]) {
        let lake = if feature.kind == FeatureKind::Lake { self.lakes } else { u32::MAX };
        for pair in path.windows(2) {
            let [a, b] = if pair[0].place < pair[1].place { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
            let (kind, id) = (feature.kind, feature.id);
            self.segments.push(Segment { ends: [a.place, b.place], z: [a.z, b.z], kind, id, lake });
        }
    }
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
