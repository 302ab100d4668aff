//! The border of a simplified terrain. It has fewer vertices than the outline of the terrain, which neighbours may show in full or
//! simplify in another way. So that no gap is seen between the two, it covers all of the terrain (`covering.rs`), is raised by what the outline
//! is above the surface beside it, and has a skirt that reaches below: who looks across the outline sees one of the two surfaces or the skirt.

use crate::lod::filling::{Border, CoarseMesh, Filling};
use crate::lod::fit::{Sample, distance_above, improve, samples, volume};
use crate::lod::outline::Outline;
use crate::lod::vertex_cells::plane;
use delaunay::geometry::predicates::orient2d;
use std::collections::{HashMap, HashSet};
use sys::Result;

/// A simplified terrain for viewers.
#[derive(Debug, Default)]
pub struct ShownMesh {
    /// Its triangles.
    pub mesh: CoarseMesh,
    /// The vertices below its border: the vertex of `mesh` above, and the height on the lattice.
    pub bottoms: Vec<(u32, i32)>,
    /// The edges between two of them, which lead around the mesh: it is on their left.
    pub skirts: Vec<[u32; 2]>,
    /// How many steps of z its inner vertices went down to make up for its border.
    pub(crate) sunk: i32,
}

impl ShownMesh {
    /// Returns a mesh that ends at the outline of the terrain.
    pub(crate) fn without_skirts(mesh: CoarseMesh) -> ShownMesh {
        ShownMesh { mesh, ..ShownMesh::default() }
    }
}

/// Returns the triangles of `filling` that `covers` tells of, with a border that is raised by what the `outline` of the terrain at `positions` is
/// above them. Other vertices of the outline have their own height at least. Skirts reach below the outline by [`SPARE`] times the `mean_error` in
/// steps of z, or as far as the ground may fall to the border. `areas` are those of [`samples`]. `may_move` tells which vertices of the terrain are no parts of lines.
pub(crate) fn shown(
    (positions, areas): (&[[i32; 3]], &[f64]),
    outline: &Outline,
    filling: &Filling,
    covers: &[bool],
    places: &[u32],
    may_move: impl Fn(u32) -> bool,
    mean_error: f64,
) -> Result<ShownMesh> {
    let border = filling.border(covers);
    let reaches = reaches(positions, outline, filling, &border.edges, places);
    let (mut mesh, number) = filling.coarse(covers);
    let spare = SPARE * mean_error;
    let deepest = positions.iter().map(|p| p[2]).min().map_or(0.0, f64::from) - spare;
    let heights: Vec<[i32; 2]> =
        filling.positions.iter().zip(&reaches).map(|(p, reach)| reach.around(p[2], spare, deepest)).collect();
    let before: Vec<f64> = filling.positions.iter().map(|p| f64::from(p[2])).collect();
    let mut fitted = before.clone();
    let mut is_raised = vec![false; fitted.len()];
    for &[site, _] in &border.edges {
        fitted[site as usize] = f64::from(heights[site as usize][1]);
        is_raised[site as usize] = true;
    }
    // Vertices of the outline may lie just inside the border, and no neighbour's ground may be above those either.
    for (site, &v) in filling.vertices.iter().enumerate() {
        if outline.on[v as usize] && !std::mem::replace(&mut is_raised[site], true) {
            fitted[site] = fitted[site].max(f64::from(positions[v as usize][2]));
        }
    }
    let moves = beside(filling, &is_raised, |site| may_move(filling.vertices[site as usize]));
    let may_change: Vec<bool> = moves.iter().zip(&is_raised).map(|(moves, is_raised)| moves | is_raised).collect();
    let samples = samples((positions, areas), &may_change, filling, places);
    for _ in 0..ROUNDS {
        improve(&samples, &moves, &mut fitted)?;
    }
    let most = DEEPEST * mean_error;
    for ((height, before), _) in fitted.iter_mut().zip(&before).zip(&moves).filter(|(_, moves)| **moves) {
        *height = height.clamp(before - most, before + most);
    }
    let is_inner = |site: usize| !is_raised[site] && may_move(filling.vertices[site]);
    let changes: Vec<f64> = fitted.iter().zip(&before).map(|(after, before)| after - before).collect();
    let sunk = sinking(&samples, areas, &changes, &is_raised).clamp(-most, most).round() as i32;
    for (site, height) in fitted.into_iter().enumerate() {
        if let Some(position) = mesh.positions.get_mut(number[site] as usize) {
            position[2] = height.round() as i32 - if is_inner(site) { sunk } else { 0 };
        }
    }
    let mut bottoms = Vec::with_capacity(border.edges.len());
    for of_site in border.edges.chunk_by(|a, b| a[0] == b[0]) {
        for (&[site, _], lower) in of_site.iter().zip(0..) {
            // No two of a site are the same vertex.
            bottoms.push((number[site as usize], heights[site as usize][0].saturating_sub(lower)));
        }
    }
    Ok(ShownMesh { mesh, bottoms, skirts: chained(&border), sunk })
}

/// How many times the mean error skirts reach below the outline: the border lies over the neighbour's ground, which may fall away there.
const SPARE: f64 = 2.0;

/// How many times as steep as the simplified terrain the neighbour's ground may fall from the outline to the border.
const STEEPER: f64 = 2.0;

/// How many times the mean error the heights beside the border may move. In woods, what makes up for a border as high as the crowns would
/// be a ditch.
const DEEPEST: f64 = 3.0;

/// How often the heights beside the border move after it was raised.
const ROUNDS: usize = 2;

/// Returns by how much sites that are not raised must go down, so that the mean height over the ground is what it was before the
/// heights of the sites had these `changes`. `samples` are those in triangles where a site has one, `areas` those of the whole terrain.
fn sinking(samples: &[Sample], areas: &[f64], changes: &[f64], is_raised: &[bool]) -> f64 {
    let of_raised: Vec<f64> = is_raised.iter().map(|&is_raised| f64::from(u8::from(is_raised))).collect();
    let inner = areas.iter().sum::<f64>() - volume(samples, &of_raised);
    if inner > 0.0 { volume(samples, changes) / inner } else { 0.0 }
}

/// Tells for each site of `filling` whether it may move and is not raised, but shares a triangle with one that is.
fn beside(filling: &Filling, is_raised: &[bool], may_move: impl Fn(u32) -> bool) -> Vec<bool> {
    let mut beside = vec![false; is_raised.len()];
    for corners in (0..filling.triangles()).map(|triangle| filling.corners(triangle)) {
        if corners.iter().any(|&site| is_raised[site as usize]) {
            let inner = corners.into_iter().filter(|&site| !is_raised[site as usize] && may_move(site));
            inner.for_each(|site| beside[site as usize] = true);
        }
    }
    beside
}

/// Returns for each edge of a border the number of the vertex below its start and that of the one below its end. The first is the number
/// of the edge. Where parts of the border meet at a site, each part ends at the vertex from which the next one goes on: so all triangles
/// around the site make one ring.
fn chained(border: &Border) -> Vec<[u32; 2]> {
    let Border { edges, arriving } = border;
    let mut skirts = vec![[0; 2]; edges.len()];
    let mut first = 0;
    for leaving in edges.chunk_by(|a, b| a[0] == b[0]) {
        for k in 0..leaving.len() {
            let next = first + (k + 1) % leaving.len();
            let before = arriving[first + k] as usize;
            skirts[before] = [before as u32, next as u32];
        }
        first += leaving.len();
    }
    skirts
}

/// Returns for each site of `filling` how far the outline is above and below the edges of the `border` that end there.
fn reaches(
    positions: &[[i32; 3]],
    outline: &Outline,
    filling: &Filling,
    border: &[[u32; 2]],
    places: &[u32],
) -> Vec<Reach> {
    let mut reaches = vec![Reach::default(); filling.positions.len()];
    let heights = || positions.iter().map(|p| p[2]);
    let [lowest, highest] = [heights().min(), heights().max()].map(|z| f64::from(z.unwrap_or(0)));
    let above = |v: u32| distance_above(filling, places[v as usize] as usize, positions[v as usize]);
    for (sites, part) in parts_beside(positions, outline, &filling.numbers(), border) {
        let edge = BorderEdge { ends: sites.map(|site| filling.positions[site as usize]) };
        let offset = |v: u32| {
            let (position, triangle) = (positions[v as usize], places[v as usize] as usize);
            let drop = STEEPER * edge.distance(position) * slope(filling, triangle);
            let share = edge.share(position);
            Offset { share, above: above(v), below_edge: edge.height(share) - f64::from(position[2]), drop }
        };
        let along: Vec<Offset> = part.vertices().map(offset).collect();
        let ends = sites.map(|site| reaches[site as usize]);
        let [above, lowered] = [
            raised(ends.map(|end| end.above), edge.ends.map(|end| highest - f64::from(end[2])), &along, |at| at.above),
            raised(ends.map(|end| end.lowered), edge.ends.map(|end| f64::from(end[2]) - lowest), &along, |at| {
                at.below_edge
            }),
        ];
        let below = along.iter().map(|offset| offset.above).fold(0.0, f64::min);
        let drop = along.iter().map(|offset| offset.drop).fold(0.0, f64::max);
        let ends = [0, 1].map(|k| Reach {
            above: above[k],
            below: ends[k].below.min(below),
            lowered: lowered[k],
            drop: ends[k].drop.max(drop),
        });
        for (site, reach) in sites.into_iter().zip(ends) {
            reaches[site as usize] = reach;
        }
    }
    reaches
}

/// A part of a ring of the outline.
#[derive(Clone, Copy)]
struct RingPart<'a> {
    ring: &'a [u32],
    first: usize,
    last: usize,
}

impl<'a> RingPart<'a> {
    fn len(&self) -> usize {
        (self.last + self.ring.len() - self.first) % self.ring.len() + 1
    }

    fn vertices(self) -> impl Iterator<Item = u32> + 'a {
        (self.first..self.first + self.len()).map(move |at| self.ring[at % self.ring.len()])
    }

    /// Tells whether the terrain is between the part and the straight line from one of its ends to the other.
    fn encloses_terrain(&self, positions: &[[i32; 3]]) -> bool {
        let place = |v: u32| plane(positions[v as usize]);
        let start = place(self.ring[self.first]);
        let doubled = self.vertices().zip(self.vertices().skip(1));
        doubled.map(|(a, b)| i128::from(orient2d(start, place(a), place(b)))).sum::<i128>() > 0
    }
}

/// Returns the parts of the outline from each site of the `border` to the next along a ring, with these two sites, and those beside the other edges
/// of the border. `site_of` has the site of each vertex.
fn parts_beside<'a>(
    positions: &[[i32; 3]],
    outline: &'a Outline,
    site_of: &[u32],
    border: &[[u32; 2]],
) -> Vec<([u32; 2], RingPart<'a>)> {
    let is_on_border = |site: u32| border.binary_search_by_key(&site, |edge| edge[0]).is_ok();
    let (mut parts, mut places) = (Vec::new(), HashMap::<u32, Vec<(usize, usize)>>::new());
    for (number, ring) in outline.rings.iter().enumerate() {
        let sites = ring.iter().map(|&v| site_of[v as usize]).enumerate();
        let ends: Vec<(usize, u32)> = sites.filter(|(_, site)| is_on_border(*site)).collect();
        ends.iter().for_each(|&(at, site)| places.entry(site).or_default().push((number, at)));
        let following = ends.iter().zip(ends.iter().cycle().skip(1));
        // A single vertex has no edge beside it.
        let following = following.filter(|((_, from), (_, to))| from != to);
        parts.extend(following.map(|(&(first, from), &(last, to))| ([from, to], RingPart { ring, first, last })));
    }
    // Where the border passes by a bay whose bank has sites of the border too, an edge leads past these.
    let known: HashSet<[u32; 2]> = parts.iter().map(|(sites, _)| *sites).collect();
    for &sites in border.iter().filter(|sites| !known.contains(*sites)) {
        let [from, to] = sites.map(|site| places.get(&site).map_or(&[][..], Vec::as_slice));
        let pairs = from.iter().flat_map(|from| to.iter().map(move |to| (from, to)));
        let both_ways = pairs.filter(|((ring, _), (other, _))| ring == other).flat_map(|(&(number, a), &(_, b))| {
            let ring = &outline.rings[number];
            [[a, b], [b, a]].map(|[first, last]| RingPart { ring, first, last })
        });
        // What lies between the edge and the outline beside it is no part of the terrain, which is on the left of a ring.
        let beside = both_ways.min_by_key(|part| (part.encloses_terrain(positions), part.len()));
        parts.extend(beside.map(|part| (sites, part)));
    }
    parts
}

/// Raises the ends of an edge, which are raised by `ends` already, until the edge is raised as far as is `wanted` of the vertices `along` it. Neither
/// of them rises much more than that takes, nor by more than `most`. How far the ends must go down is found in the same way.
fn raised(mut ends: [f64; 2], most: [f64; 2], along: &[Offset], wanted: impl Fn(&Offset) -> f64) -> [f64; 2] {
    // Other edges may need what they have already.
    let most = [0, 1].map(|k| ends[k].max(most[k]));
    let missing = |ends: [f64; 2], offset: &Offset| {
        let [first, second] = offset.weights();
        wanted(offset) - first * ends[0] - second * ends[1]
    };
    for _ in 0..RAISES {
        for offset in along {
            let more = missing(ends, offset);
            if more > 0.0 {
                let weights = offset.weights();
                let square: f64 = weights.iter().map(|weight| weight * weight).sum();
                ends.iter_mut().zip(weights).for_each(|(end, weight)| *end += more * weight / square);
            }
        }
    }
    ends = [0, 1].map(|k| ends[k].min(most[k]));
    // What one end cannot do, the other one does.
    for offset in along {
        for k in 0..2 {
            let (more, weight) = (missing(ends, offset), offset.weights()[k]);
            if more > 0.0 && weight > 0.0 {
                ends[k] = (ends[k] + more / weight).min(most[k]);
            }
        }
    }
    ends
}

/// How often the ends of an edge are raised vertex by vertex, by as little as it takes.
const RAISES: usize = 3;

/// Where a vertex of the outline is along an edge of the border.
struct Offset {
    /// The part of the edge that is before the place on it nearest to the vertex in the plane.
    share: f64,
    /// How far the vertex is above the simplified terrain, in steps of z.
    above: f64,
    /// How far it is below the edge there, before that is raised.
    below_edge: f64,
    /// How far the ground may fall from the vertex to the edge, in steps of z.
    drop: f64,
}

impl Offset {
    /// Returns how much of each end's height the place on the edge has.
    fn weights(&self) -> [f64; 2] {
        [1.0 - self.share, self.share]
    }
}

/// An edge of the border, from one lattice point to another.
struct BorderEdge {
    ends: [[i32; 3]; 2],
}

impl BorderEdge {
    /// Returns the part of the edge that is before the place on it nearest to `point`.
    fn share(&self, point: [i32; 3]) -> f64 {
        let [from, to] = self.ends;
        let along = |p: [i32; 3], axis: usize| f64::from(p[axis]) - f64::from(from[axis]);
        let product = |p: [i32; 3]| along(p, 0) * along(to, 0) + along(p, 1) * along(to, 1);
        (product(point) / product(to)).clamp(0.0, 1.0)
    }

    /// Returns the height of the edge at a part of it.
    fn height(&self, share: f64) -> f64 {
        let [from, to] = self.ends.map(|end| f64::from(end[2]));
        (1.0 - share) * from + share * to
    }

    /// Returns the distance of `point` from the line of the edge in the plane, in lattice steps.
    fn distance(&self, point: [i32; 3]) -> f64 {
        let [from, to] = self.ends.map(plane);
        let [x, y] = [0, 1].map(|axis| f64::from(to[axis]) - f64::from(from[axis]));
        (orient2d(from, to, plane(point)) as f64).abs() / (x * x + y * y).sqrt()
    }
}

/// Returns how steep a triangle of `filling` is, in steps of z for each lattice step.
fn slope(filling: &Filling, triangle: usize) -> f64 {
    let corners = filling.corners(triangle).map(|site| filling.positions[site as usize]);
    let [[ux, uy, uz], [vx, vy, vz]] =
        [1, 2].map(|k| [0, 1, 2].map(|axis| f64::from(corners[k][axis]) - f64::from(corners[0][axis])));
    let [x, y, area] = [uz * vy - vz * uy, ux * vz - vx * uz, ux * vy - uy * vx];
    (x * x + y * y).sqrt() / area.abs()
}

/// How far an outline is above and below the border near a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Reach {
    /// The greatest distance in steps of z, at least 0.
    above: f64,
    /// The least one, at most 0.
    below: f64,
    /// How far the vertex must go down until no edge is above the outline beside it: there may be a steep triangle between the two.
    lowered: f64,
    /// How far the ground may fall from the outline to the border.
    drop: f64,
}

impl Reach {
    /// Returns the height of the lower end of the skirt and that of the border, at a vertex that has been at `height`. The skirt reaches `spare`
    /// below the outline, or further where the ground may fall, down to the `deepest` height.
    fn around(self, height: i32, spare: f64, deepest: f64) -> [i32; 2] {
        let fitted = f64::from(height);
        let top = (fitted + self.above).ceil() as i32;
        let outline = fitted + self.below;
        let lowest = outline.min(fitted - self.lowered);
        let bottom = (lowest - spare).min((outline - self.drop).max(deepest)).floor() as i32;
        // The two are different vertices.
        [bottom.min(top.saturating_sub(1)), top]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The sites 2 and 4 are on the bank of a bay that the edge from 0 to 6 passes by.
    #[test]
    fn every_edge_of_the_border_has_the_outline_beside_it() {
        let border = [[0, 6], [2, 4], [4, 6], [6, 2], [6, 8], [8, 0]];
        let bay = [[0, 0], [1, 5], [1, 9], [5, 9], [9, 9], [9, 5], [10, 0]];
        let around = |count: i32| {
            let others = (1..=count).map(|i| [30 + i % 2, i]).chain([[0, 20]]);
            let places: Vec<[i32; 3]> =
                bay.into_iter().chain([[20, 0]]).chain(others).map(|[x, y]| [x, y, 0]).collect();
            let count = places.len() as u32;
            let outline =
                Outline { edges: Vec::new(), on: vec![true; places.len()], rings: vec![(0..count).collect()] };
            let site_of: Vec<u32> =
                (0..count).map(|v| if [0, 2, 4, 6, 8].contains(&v) { v } else { u32::MAX }).collect();
            let parts = parts_beside(&places, &outline, &site_of, &border);
            let parts = parts.into_iter().map(|(sites, part)| (sites, part.vertices().collect()));
            parts.collect::<HashMap<[u32; 2], Vec<u32>>>()
        };
        // The rest of the ring may have more vertices than the bay, or fewer.
        for beside in [around(20), around(1)] {
            assert_eq!(beside[&[0, 6]], [0, 1, 2, 3, 4, 5, 6]);
            assert_eq!(beside[&[6, 2]], [2, 3, 4, 5, 6]);
            assert_eq!(beside[&[6, 8]], [6, 7, 8]);
            assert!(border.iter().all(|edge| beside.contains_key(edge)));
        }
    }

    proptest! {
        /// The ends of an edge are somewhat below the highest place, and vertices along it are as high as that at most.
        #[test]
        fn a_raised_edge_is_not_below_any_vertex(
            fitted in prop::array::uniform2(-50.0f64..0.0),
            before in prop::array::uniform2(0.0f64..60.0),
            heights in prop::collection::vec((0.0f64..=1.0, -80.0f64..=0.0), 1..12),
        ) {
            let [from, to] = fitted;
            let above = |(share, height): (f64, f64)| height - from - share * (to - from);
            let offset = |&(share, height): &(f64, f64)| {
                let above = above((share, height));
                Offset { share, above, below_edge: -above, drop: 0.0 }
            };
            let along: Vec<Offset> = heights.iter().map(offset).collect();
            let ends = raised(before, fitted.map(|height| -height), &along, |offset| offset.above);
            for ((offset, height), [first, second]) in along.iter().zip(&heights).map(|both| (both, ends)) {
                let missing = above(*height) - (1.0 - offset.share) * first - offset.share * second;
                prop_assert!(missing < 1e-9, "{missing} at {height:?}");
            }
            for ((end, before), height) in ends.iter().zip(before).zip(fitted) {
                prop_assert!((before..=before.max(-height)).contains(end), "{end} from {before}");
            }
        }
    }
}
