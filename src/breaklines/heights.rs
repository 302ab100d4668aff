//! Heights of sites, from the segments that go over them.

use crate::breaklines::clean::Segment;
use crate::breaklines::exact::{distance2, dot, round};
use crate::breaklines::feature::{FeatureId, FeatureKind};
use crate::breaklines::findings::{Disagreement, Findings, worst};
use crate::breaklines::net::Net;
use crate::breaklines::options::BreaklineOptions;
use crate::breaklines::site::BreaklineSite;
use crate::geometry::Site;
use std::cmp::Reverse;

/// The height that a segment gives a site. Of several the least holds: the lake before the river before the line, a height before none,
/// and the lowest one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    site: u32,
    kind: FeatureKind,
    has_none: bool,
    z: i32,
    id: FeatureId,
    /// How much the height may be wrong because the site does not lie on the segment, by the segment's slope.
    slack: u32,
}

/// Returns the sites of the subsegments with their heights, sorted by y, then x, and notes where heights disagree.
pub(crate) fn sites_with_heights(
    net: &Net,
    segments: &[Segment],
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> Vec<BreaklineSite> {
    let mut candidates = candidates(net, segments, options.floor);
    candidates.sort_unstable();
    candidates.dedup();
    let mut sites = Vec::new();
    for group in candidates.chunk_by(|one, other| one.site == other.site) {
        let Some(first) = group.first() else { continue };
        let place = net.sites.place(first.site);
        sites.push(BreaklineSite { place, z: (!first.has_none).then_some(first.z), kind: first.kind, id: first.id });
        if let Some(other) = disagreeing(group, options.height_tolerance) {
            findings.disagreements += 1;
            findings.worst_disagreements.push(Disagreement { place, kept: (first.id, first.z), other });
            if findings.worst_disagreements.len() > 100 * Findings::MOST {
                worst(&mut findings.worst_disagreements, by_difference);
            }
        }
    }
    worst(&mut findings.worst_disagreements, by_difference);
    sites.sort_unstable_by_key(|site| (site.place[1], site.place[0]));
    sites
}

fn by_difference(found: &Disagreement) -> Reverse<u32> {
    Reverse(found.kept.1.abs_diff(found.other.1))
}

/// Returns what every segment says about the sites of its subsegments.
fn candidates(net: &Net, segments: &[Segment], floor: u32) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    for edge in net.edges.alive() {
        let edge = net.edges.edges[edge as usize];
        for (owner, _) in net.edges.owners.of(edge.owners) {
            let segment = &segments[owner as usize];
            candidates.extend(edge.ends.map(|site| candidate(site, net.sites.place(site), segment, floor)));
        }
    }
    candidates
}

fn candidate(site: u32, place: Site, segment: &Segment, floor: u32) -> Candidate {
    let Segment { kind, id, ends, z, .. } = *segment;
    let height = |[from, to]: [i32; 2]| {
        let rise = i128::from(to) - i128::from(from);
        let length2 = distance2(ends[0], ends[1]);
        let along = dot(ends[0], ends[1], place).clamp(0, length2);
        let z = i128::from(from) + round(rise * i128::from(along), i128::from(length2));
        let length = i128::from((length2 as u64).isqrt().max(1));
        let slack = rise.abs() * (i128::from(floor) + 1) / length;
        (z as i32, slack.min(u32::MAX.into()) as u32)
    };
    match z {
        [Some(from), Some(to)] => {
            let (z, slack) = height([from, to]);
            Candidate { site, kind, has_none: false, z, id, slack }
        }
        _ => Candidate { site, kind, has_none: true, z: 0, id, slack: 0 },
    }
}

/// Returns the feature whose height differs most from the one that holds, if it differs by more than the tolerance and what the
/// slopes explain.
fn disagreeing(group: &[Candidate], tolerance: u32) -> Option<(FeatureId, i32)> {
    let first = group.first().filter(|first| !first.has_none)?;
    let allowed = |other: &Candidate| u64::from(tolerance) + u64::from(first.slack) + u64::from(other.slack);
    let others = group.iter().filter(|other| !other.has_none && u64::from(other.z.abs_diff(first.z)) > allowed(other));
    let most = others.max_by_key(|other| (other.z.abs_diff(first.z), Reverse(other.id)))?;
    Some((most.id, most.z))
}
