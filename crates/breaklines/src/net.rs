//! From segments to subsegments: snaps, nodes, cuts and refines.

use crate::clean::Segment;
use crate::cut::cuts;
use crate::edge_table::{Edge, EdgeTable};
use crate::error::BreaklineError;
use crate::exact::in_disc;
use crate::feature::FeatureKind;
use crate::findings::Findings;
use crate::lakes::{Fraction, Lakes, Shore};
use crate::lines_in_lakes::LinesInLakes;
use crate::node::Noding;
use crate::options::BreaklineOptions;
use crate::owners::{Owner, Owners};
use crate::refine::refine;
use crate::site_table::SiteTable;
use delaunay::geometry::Site;
use sys::interrupt;

/// Between so many steps it is checked whether the process should stop.
const SOME: usize = 1 << 12;

/// The subsegments of all lines.
#[derive(Debug)]
pub(crate) struct Net {
    pub(crate) sites: SiteTable,
    /// The subsegments, and the edges that they took the place of.
    pub(crate) edges: EdgeTable,
    pub(crate) lakes: Lakes,
}

/// Makes subsegments of `segments`, which are sorted, with `lakes` lakes.
///
/// # Errors
/// [`BreaklineError::TooMany`] and [`BreaklineError::Interrupted`].
pub(crate) fn net_of(
    segments: &[Segment],
    lakes: u32,
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> Result<Net, BreaklineError> {
    let mut sites = snapped_vertices(segments, options, findings);
    let whole = joined_segments(segments, &mut sites, options)?;
    let paths = Noding { sites: &mut sites, edges: &whole, options, findings }.paths()?;
    let pieces = pieces_of(whole, &paths, &sites, options)?;
    let (kept, left_out) = choose(segments, lakes, pieces, &sites, findings)?;
    let mut edges = cut(kept, &mut sites, options)?;
    refine(&mut sites, &mut edges, options.most_sites)?;
    let shores = shores_of(segments, &edges, &sites).into_iter().chain(left_out);
    let lakes = Lakes::new(lakes, shores);
    Ok(Net { sites, edges, lakes })
}

/// Returns a table with a site for every vertex. Vertices of lakes come first, then those of rivers: others go to them.
fn snapped_vertices(segments: &[Segment], options: &BreaklineOptions, findings: &mut Findings) -> SiteTable {
    let mut vertices: Vec<(FeatureKind, Site)> =
        segments.iter().flat_map(|segment| segment.ends.map(|end| (segment.kind, end))).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut sites = SiteTable::new(options.floor);
    for (_, place) in vertices {
        let site = sites.nearest_or_new(place);
        findings.snapped_vertices += u64::from(sites.place(site) != place);
    }
    sites
}

/// Returns one edge for all segments between the same sites.
fn joined_segments(
    segments: &[Segment],
    sites: &mut SiteTable,
    options: &BreaklineOptions,
) -> Result<EdgeTable, BreaklineError> {
    let mut edges = EdgeTable::new(Owners::new(segments.len()));
    for (segment, owner) in segments.iter().zip(0..) {
        let [a, b] = segment.ends.map(|end| sites.nearest_or_new(end));
        if a != b {
            edges.add(sites, [a, b], owner);
        }
    }
    check_count(&edges, options)?;
    Ok(edges)
}

/// Refuses more edges, or sets of segments that lie on one another, than sites are allowed.
fn check_count(edges: &EdgeTable, options: &BreaklineOptions) -> Result<(), BreaklineError> {
    interrupt::check()?;
    // Where all lines are drawn twice or more, each site has an edge or two, and each edge has a set.
    let most = options.most_sites.saturating_mul(3);
    let is_much = edges.edges.len() > most || edges.owners.len() > most;
    if is_much { Err(BreaklineError::TooMany { most: options.most_sites }) } else { Ok(()) }
}

/// Returns the pieces between the sites on the ways of edges.
fn pieces_of(
    whole: EdgeTable,
    paths: &[Vec<u32>],
    sites: &SiteTable,
    options: &BreaklineOptions,
) -> Result<EdgeTable, BreaklineError> {
    let mut pieces = EdgeTable::new(whole.owners);
    for (number, (edge, path)) in whole.edges.iter().zip(paths).enumerate() {
        for pair in path.windows(2).filter(|pair| pair[0] != pair[1]) {
            pieces.add(sites, [pair[0], pair[1]], edge.owners);
        }
        if number % SOME == 0 {
            check_count(&pieces, options)?;
        }
    }
    Ok(pieces)
}

/// Leaves out pieces inside lakes. Returns the others, and the shores among those left out. These are not moved any more. So where the
/// shores of two lakes cross, a point less than a step outside both may count as inside.
fn choose(
    segments: &[Segment],
    lakes: u32,
    pieces: EdgeTable,
    sites: &SiteTable,
    findings: &mut Findings,
) -> Result<(EdgeTable, Vec<Shore>), BreaklineError> {
    if lakes == 0 {
        return Ok((pieces, Vec::new()));
    }
    let insides = Lakes::new(lakes, shores_of(segments, &pieces, sites));
    let (mut is_kept, mut left_out, mut drowned) = (Vec::new(), Vec::new(), LinesInLakes::default());
    for (number, Edge { ends, owners, .. }) in pieces.edges.iter().enumerate() {
        if number % SOME == 0 {
            interrupt::check()?;
        }
        let places = ends.map(|end| sites.place(end));
        let middle = Fraction::middle_of(&places);
        // Most pieces are far from all lakes.
        let around = insides.hold(middle, |_| true).then(|| pieces.owners.of(*owners)).and_then(|owners| {
            let is_own = |lake: u32| owners.iter().any(|(owner, _)| segments[*owner as usize].lake == lake);
            Some((insides.first_around(middle, |lake| !is_own(lake))?, owners))
        });
        is_kept.push(around.is_none());
        if let Some((lake, owners)) = around {
            findings.pieces_in_lakes += 1;
            let owned = owners.iter().map(|(owner, _)| &segments[*owner as usize]);
            // Rivers are drawn through lakes as a matter of course.
            let lost = owned.filter(|segment| segment.kind != FeatureKind::River).map(|segment| segment.id);
            drowned.add(lost, lake, places);
            left_out.extend(lakes_among(segments, &owners).into_iter().map(|lake| (lake, places)));
        }
    }
    findings.worst_in_lakes = drowned.worst(segments);
    let mut kept = EdgeTable::new(pieces.owners);
    for (Edge { ends, owners, .. }, _) in pieces.edges.iter().zip(is_kept).filter(|(_, is_kept)| *is_kept) {
        kept.add(sites, *ends, *owners);
    }
    Ok((kept, left_out))
}

/// Returns the shores of lakes among edges.
fn shores_of(segments: &[Segment], edges: &EdgeTable, sites: &SiteTable) -> Vec<Shore> {
    let mut shores = Vec::new();
    // Pieces of the same segments follow one another.
    let mut last = (u32::MAX, Vec::new());
    for edge in edges.alive() {
        let owners = edges.edges[edge as usize].owners;
        if owners != last.0 {
            last = (owners, lakes_among(segments, &edges.owners.of(owners)));
        }
        let places = edges.places(sites, edge);
        shores.extend(last.1.iter().map(|lake| (*lake, places)));
    }
    shores
}

/// Returns the lakes whose shore goes over an edge with these owners an odd number of times.
fn lakes_among(segments: &[Segment], owners: &[Owner]) -> Vec<u32> {
    let odd = owners.iter().filter(|(_, is_odd)| *is_odd);
    let mut lakes: Vec<u32> = odd.map(|(owner, _)| segments[*owner as usize].lake).collect();
    lakes.retain(|&lake| lake != u32::MAX);
    lakes.sort_unstable();
    lakes.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).map(|same| same[0]).collect()
}

/// Cuts pieces to the spacing.
fn cut(pieces: EdgeTable, sites: &mut SiteTable, options: &BreaklineOptions) -> Result<EdgeTable, BreaklineError> {
    let mut edges = EdgeTable::new(pieces.owners);
    for (number, Edge { ends, owners, .. }) in pieces.edges.iter().enumerate() {
        if number % SOME == 0 {
            check_count(&edges, options)?;
        }
        let [a, b] = ends.map(|end| sites.place(end));
        let mut last = ends[0];
        for place in cuts(a, b, options.spacing) {
            let site = sites.nearest_or_new(place);
            let place = sites.place(site);
            if site != last && in_disc(a, b, place) && ![a, b].contains(&place) {
                edges.add(sites, [last, site], *owners);
                last = site;
            }
            if sites.len() > options.most_sites {
                return Err(BreaklineError::TooMany { most: options.most_sites });
            }
        }
        edges.add(sites, [last, ends[1]], *owners);
    }
    Ok(edges)
}
