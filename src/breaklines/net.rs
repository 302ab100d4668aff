//! From segments to subsegments: snaps, nodes, cuts and refines.

use crate::breaklines::clean::Segment;
use crate::breaklines::cut::cuts;
use crate::breaklines::edge_table::{Edge, EdgeTable};
use crate::breaklines::error::BreaklineError;
use crate::breaklines::exact::{grown, holds, in_disc};
use crate::breaklines::feature::FeatureKind;
use crate::breaklines::findings::Findings;
use crate::breaklines::lakes::{Fraction, Lakes};
use crate::breaklines::node::{Noding, inner_box};
use crate::breaklines::options::BreaklineOptions;
use crate::breaklines::owners::Owners;
use crate::breaklines::refine::refine;
use crate::breaklines::site_table::SiteTable;
use crate::geometry::Site;

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
/// [`BreaklineError::TooMany`].
pub(crate) fn net_of(
    segments: &[Segment],
    lakes: u32,
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> Result<Net, BreaklineError> {
    let mut sites = snapped_vertices(segments, options, findings);
    let whole = joined_segments(segments, &mut sites);
    let paths = Noding { sites: &mut sites, edges: &whole, options, findings }.paths()?;
    let pieces = pieces_of(&whole, &paths, &sites);
    let (kept, left_out) = choose(segments, lakes, pieces, &sites, options, findings);
    let mut edges = cut(kept, &mut sites, options)?;
    refine(&mut sites, &mut edges, options.most_sites)?;
    let shores = shores_of(segments, &edges, &sites).chain(left_out);
    let lakes = Lakes::new(lakes, shores.collect::<Vec<_>>());
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
fn joined_segments(segments: &[Segment], sites: &mut SiteTable) -> EdgeTable {
    let mut edges = EdgeTable::new(Owners::new(segments.len()));
    for (segment, owner) in segments.iter().zip(0..) {
        let [a, b] = segment.ends.map(|end| sites.nearest_or_new(end));
        if a != b {
            edges.add(sites, [a, b], owner);
        }
    }
    edges
}

/// Returns the pieces between the sites on the ways of edges.
fn pieces_of(whole: &EdgeTable, paths: &[Vec<u32>], sites: &SiteTable) -> EdgeTable {
    let mut pieces = EdgeTable::new(whole.owners.clone());
    for (edge, path) in whole.edges.iter().zip(paths) {
        for pair in path.windows(2).filter(|pair| pair[0] != pair[1]) {
            pieces.add(sites, [pair[0], pair[1]], edge.owners);
        }
    }
    pieces
}

/// Leaves out pieces outside the box of the options, and pieces inside lakes. Returns the others, and the shores among those left out.
/// These are not moved any more. So where the shores of two lakes cross, a point less than a step outside both may count as inside.
fn choose(
    segments: &[Segment],
    lakes: u32,
    pieces: EdgeTable,
    sites: &SiteTable,
    options: &BreaklineOptions,
    findings: &mut Findings,
) -> (EdgeTable, Vec<(u32, [Site; 2])>) {
    let within = options.within.map(|within| grown(inner_box(within, options.floor), options.floor));
    let insides = Lakes::new(lakes, shores_of(segments, &pieces, sites).collect::<Vec<_>>());
    let mut kept = EdgeTable::new(pieces.owners.clone());
    let mut left_out = Vec::new();
    for Edge { ends, owners, .. } in &pieces.edges {
        let places = ends.map(|end| sites.place(end));
        let outside = within.is_some_and(|within| !places.iter().all(|&place| holds(&within, place)));
        let inside = || {
            let is_own = |lake: u32| pieces.owners.of(*owners).any(|(owner, _)| segments[owner as usize].lake == lake);
            insides.hold(Fraction::middle_of(&places), |lake| !is_own(lake))
        };
        if outside {
            findings.pieces_outside += 1;
        } else if inside() {
            findings.pieces_in_lakes += 1;
        } else {
            kept.add(sites, *ends, *owners);
            continue;
        }
        left_out.extend(lakes_of(segments, &pieces, *owners).into_iter().map(|lake| (lake, places)));
    }
    (kept, left_out)
}

/// Returns the shores of lakes among edges.
fn shores_of<'a>(
    segments: &'a [Segment],
    edges: &'a EdgeTable,
    sites: &'a SiteTable,
) -> impl Iterator<Item = (u32, [Site; 2])> + 'a {
    edges.alive().flat_map(move |edge| {
        let lakes = lakes_of(segments, edges, edges.edges[edge as usize].owners);
        lakes.into_iter().map(move |lake| (lake, edges.places(sites, edge)))
    })
}

/// Returns the lakes whose shore goes over an edge with these owners an odd number of times.
fn lakes_of(segments: &[Segment], edges: &EdgeTable, owners: u32) -> Vec<u32> {
    let owners = edges.owners.of(owners).filter(|(_, is_odd)| *is_odd);
    let mut lakes: Vec<u32> = owners.map(|(owner, _)| segments[owner as usize].lake).collect();
    lakes.retain(|&lake| lake != u32::MAX);
    lakes.sort_unstable();
    lakes.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1).map(|same| same[0]).collect()
}

/// Cuts pieces to the spacing.
fn cut(pieces: EdgeTable, sites: &mut SiteTable, options: &BreaklineOptions) -> Result<EdgeTable, BreaklineError> {
    let mut edges = EdgeTable::new(pieces.owners.clone());
    for Edge { ends, owners, .. } in &pieces.edges {
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
