//! Heights of sites, from the segments that go over them.

use crate::clean::Segment;
use crate::edge_table::Edge;
use crate::error::BreaklineError;
use crate::exact::{distance2, dot, round};
use crate::fast_hash::FastMap;
use crate::feature::{FeatureId, FeatureKind};
use crate::findings::{Disagreement, Findings, worst};
use crate::net::Net;
use crate::options::BreaklineOptions;
use crate::site::BreaklineSite;
use delaunay::geometry::Site;
use std::cmp::Reverse;
use sys::interrupt;

/// The height that a segment gives a site. Of several the least holds: the lake before the river before the line, a height before none,
/// and the lowest one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    site: u32,
    kind: FeatureKind,
    has_none: bool,
    z: i32,
    id: FeatureId,
    lake: u32,
    /// How much the height may be wrong because the site does not lie on the segment, by the segment's slope.
    slack: u32,
}

/// Returns the sites of the subsegments with their heights, sorted by y, then x, and notes where heights disagree.
///
/// # Errors
/// [`BreaklineError::Interrupted`].
pub(crate) fn sites_with_heights(
    net: &Net,
    segments: &[Segment],
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> Result<Vec<BreaklineSite>, BreaklineError> {
    // Hundreds of segments may go over a site, so candidates are looked at twice, and not kept.
    let mut first: Vec<Option<Candidate>> = vec![None; net.sites.len()];
    for_each_candidate(net, segments, options.floor, |candidate| {
        let known = &mut first[candidate.site as usize];
        *known = known.iter().copied().chain([candidate]).min();
    })?;
    let mut others: FastMap<u32, Candidate> = FastMap::default();
    let mut not_compared: FastMap<u32, ()> = FastMap::default();
    for_each_candidate(net, segments, options.floor, |candidate| {
        let Some(first) = first[candidate.site as usize] else { return };
        if first.has_none != candidate.has_none {
            not_compared.insert(candidate.site, ());
        } else if disagrees(&first, &candidate, options.height_tolerance) {
            let worst = others.entry(candidate.site).or_insert(candidate);
            let by = |other: &Candidate| (other.z.abs_diff(first.z), Reverse(other.id), other.z);
            *worst = if by(worst) < by(&candidate) { candidate } else { *worst };
        }
    })?;
    findings.places_not_compared = not_compared.len() as u64;
    findings.disagreements = others.len() as u64;
    let found = others.into_iter().filter_map(|(site, other)| {
        let (place, kept) = (net.sites.place(site), first[site as usize]?);
        Some(Disagreement { place, kept: (kept.id, kept.z), other: (other.id, other.z) })
    });
    findings.worst_disagreements = found.collect();
    worst(&mut findings.worst_disagreements, by_difference);
    let site = |first: Candidate| BreaklineSite {
        place: net.sites.place(first.site),
        z: (!first.has_none).then_some(first.z),
        kind: first.kind,
        id: first.id,
        lake: Some(first.lake).filter(|_| first.kind == FeatureKind::Lake),
    };
    let mut sites: Vec<BreaklineSite> = first.iter().flatten().copied().map(site).collect();
    sites.sort_unstable_by_key(|site| (site.place[1], site.place[0]));
    Ok(sites)
}

fn by_difference(found: &Disagreement) -> Reverse<u32> {
    Reverse(found.kept.1.abs_diff(found.other.1))
}

/// Calls `found` with what every segment says about the sites of its subsegments.
fn for_each_candidate(
    net: &Net,
    segments: &[Segment],
    floor: u32,
    mut found: impl FnMut(Candidate),
) -> Result<(), BreaklineError> {
    // Taking a set apart takes longer than looking at its segments, so edges with the same one are looked at together.
    let mut edges: Vec<Edge> = net.edges.alive().map(|edge| net.edges.edges[edge as usize]).collect();
    edges.sort_unstable_by_key(|edge| (edge.owners, edge.ends));
    for same in edges.chunk_by(|one, other| one.owners == other.owners) {
        interrupt::check()?;
        let owners = net.edges.owners.of(same[0].owners);
        for site in same.iter().flat_map(|edge| edge.ends) {
            let place = net.sites.place(site);
            owners.iter().for_each(|(owner, _)| found(candidate(site, place, &segments[*owner as usize], floor)));
        }
    }
    Ok(())
}

fn candidate(site: u32, place: Site, segment: &Segment, floor: u32) -> Candidate {
    let Segment { kind, id, whole: ends, z, lake, .. } = *segment;
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
            Candidate { site, kind, has_none: false, z, id, lake, slack }
        }
        _ => Candidate { site, kind, has_none: true, z: 0, id, lake, slack: 0 },
    }
}

/// Returns whether the heights differ by more than the tolerance and what the slopes explain.
fn disagrees(first: &Candidate, other: &Candidate, tolerance: u32) -> bool {
    let allowed = u64::from(tolerance) + u64::from(first.slack) + u64::from(other.slack);
    !first.has_none && u64::from(other.z.abs_diff(first.z)) > allowed
}
