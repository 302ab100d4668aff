//! Tracing the lines of all levels in a tile.

use crate::chain::{Band, Chain};
use crate::crossing_edges::{CrossedEdge, CrossingEdges, NONE, TriangleEdges};
use crate::edge_key::EdgeKey;
use crate::levels::{Level, Levels};
use delaunay::geometry::z_order;
use std::ops::Range;
use sys::{Result, interrupt};

/// The most crossings that are held at one time, unless one level alone has more.
const CROSSINGS_AT_ONCE: u64 = 1 << 18;

/// How x and y of the lattice become those of the source.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// The source coordinates of the lattice point (0, 0).
    pub offset: [f64; 2],
    /// The step of the lattice.
    pub step: f64,
}

impl Plane {
    /// Returns the place in source units of a point between lattice points.
    fn source(self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.offset[axis] + self.step * place[axis])
    }
}

/// Traces the lines of all `levels` through the triangles between `vertices`, which turn counterclockwise. Gives them to `take` in bands of
/// neighbouring levels, the lowest first.
///
/// # Errors
/// Those of `take`, and [`sys::Error::Interrupted`].
pub fn trace(
    vertices: &[[i32; 3]],
    triangles: &[[u32; 3]],
    levels: &Levels,
    plane: Plane,
    take: &mut dyn FnMut(Band) -> Result<()>,
) -> Result<()> {
    let counts = levels.counts(vertices.iter().map(|vertex| vertex[2]));
    let CrossingEdges { edges, triangles } = CrossingEdges::of(triangles, &counts);
    let places: Vec<u64> = vertices.iter().map(|&[x, y, _]| z_order([x, y])).collect();
    let keys = edges.iter().map(|edge| EdgeKey([edge.low, edge.high].map(|v| places[v as usize])));
    let keys: Vec<EdgeKey> = keys.collect();
    let tile = CrossedTile { vertices, edges: &edges, keys: &keys, triangles: &triangles, levels, plane };
    for band in bands(&edges) {
        interrupt::check()?;
        take(tile.band(band))?;
    }
    Ok(())
}

/// Returns the numbers of neighbouring levels that are traced together, each as the first and the one after the last.
fn bands(edges: &[CrossedEdge]) -> Vec<[u32; 2]> {
    let first = edges.iter().map(|edge| edge.levels[0]).min();
    let past = edges.iter().map(|edge| edge.levels[1]).max();
    let Some((first, past)) = first.zip(past) else { return Vec::new() };
    // How many more edges a level crosses than the level below.
    let mut more = vec![0i64; (past - first) as usize + 1];
    for edge in edges {
        more[(edge.levels[0] - first) as usize] += 1;
        more[(edge.levels[1] - first) as usize] -= 1;
    }
    let (mut bands, mut begin, mut crossings, mut held) = (Vec::new(), first, 0i64, 0);
    for (level, more) in (first..past).zip(more) {
        crossings += more;
        let own = crossings.unsigned_abs();
        if level > begin && held + own > CROSSINGS_AT_ONCE {
            bands.push([begin, level]);
            (begin, held) = (level, 0);
        }
        held += own;
    }
    bands.push([begin, past]);
    bands
}

/// A tile, and the edges in it that levels cross.
struct CrossedTile<'a> {
    vertices: &'a [[i32; 3]],
    edges: &'a [CrossedEdge],
    keys: &'a [EdgeKey],
    triangles: &'a [TriangleEdges],
    levels: &'a Levels,
    plane: Plane,
}

/// Where a level crosses an edge.
#[derive(Clone, Copy)]
struct Crossing {
    point: [f64; 2],
    edge: u32,
    /// The number of the crossing to which the line goes on, or [`NONE`].
    next: u32,
}

/// The crossings of a band.
struct Crossings {
    /// The numbers of the levels: the first, and the one after the last.
    levels: [u32; 2],
    all: Vec<Crossing>,
    /// Whether a line comes to a crossing from another one.
    has_previous: Vec<bool>,
    /// For each edge, the number of its crossing with its first level of the band.
    first: Vec<u32>,
}

impl CrossedTile<'_> {
    fn band(&self, levels: [u32; 2]) -> Band {
        let mut crossings = self.crossings(levels);
        self.connect(&mut crossings);
        self.chains(crossings)
    }

    /// Computes where the levels cross edges. The crossings of an edge follow each other.
    fn crossings(&self, levels: [u32; 2]) -> Crossings {
        let (mut all, mut first) = (Vec::new(), Vec::with_capacity(self.edges.len()));
        for (number, edge) in (0..).zip(self.edges) {
            first.push(all.len() as u32);
            let [from, to] = edge.within(levels);
            if from < to {
                let on_edge = OnEdge::new([edge.low, edge.high].map(|v| self.vertices[v as usize]), self.plane);
                let points = self.levels.between(from, to).iter().map(|level| on_edge.crossing(level));
                all.extend(points.map(|point| Crossing { point, edge: number, next: NONE }));
            }
        }
        Crossings { levels, has_previous: vec![false; all.len()], all, first }
    }

    /// Connects the crossings along the segments in all triangles. Seen along a segment, the side of the triangle that goes down is behind,
    /// and the one that goes up ahead: then the higher ground is on the left.
    fn connect(&self, crossings: &mut Crossings) {
        for triangle in self.triangles {
            let sides = |goes_down: bool| {
                let sides = (0..3).filter(move |side| triangle.goes_down[*side] == goes_down);
                sides.map(|side| triangle.edges[side]).filter(|edge| *edge != NONE)
            };
            for (behind, ahead) in sides(true).flat_map(|behind| sides(false).map(move |ahead| (behind, ahead))) {
                let [own, others] = [behind, ahead].map(|edge| self.edges[edge as usize].within(crossings.levels));
                for level in own[0].max(others[0])..own[1].min(others[1]) {
                    let from = crossings.first[behind as usize] + (level - own[0]);
                    let to = crossings.first[ahead as usize] + (level - others[0]);
                    crossings.all[from as usize].next = to;
                    crossings.has_previous[to as usize] = true;
                }
            }
        }
    }

    /// Follows all lines: first those that come from the border of the tile, then rings.
    fn chains(&self, mut crossings: Crossings) -> Band {
        let mut points = Vec::with_capacity(crossings.all.len());
        let mut found: Vec<(u32, Chain)> = Vec::new();
        for is_closed in [false, true] {
            for (number, edge) in self.edges.iter().enumerate() {
                let [from, to] = edge.within(crossings.levels);
                for level in from..to {
                    let start = crossings.first[number] + (level - from);
                    let has_next = crossings.all[start as usize].next != NONE;
                    if has_next && (is_closed || !crossings.has_previous[start as usize]) {
                        let level_there = &self.levels.between(level, level + 1)[0];
                        let chain = self.follow(&mut crossings.all, start, level_there, &mut points);
                        found.extend(chain.map(|chain| (level, chain)));
                    }
                }
            }
        }
        sorted(crossings.levels, found, &points)
    }

    /// Follows a line from crossing number `start` on, and adds its points to `points`. Returns `None` for a ring around a point.
    fn follow(&self, all: &mut [Crossing], start: u32, level: &Level, points: &mut Vec<[f64; 2]>) -> Option<Chain> {
        let begin = points.len();
        let first = all[start as usize].edge;
        let peak = self.edges[first as usize].high;
        let mut is_around_peak = level.is_at_least && i64::from(self.vertices[peak as usize][2]) == level.least;
        let (mut at, mut least, mut least_at) = (start, self.keys[first as usize], 0);
        let last = loop {
            let crossing = &mut all[at as usize];
            let key = self.keys[crossing.edge as usize];
            if key < least {
                (least, least_at) = (key, points.len() - begin);
            }
            is_around_peak &= self.edges[crossing.edge as usize].high == peak;
            points.push(crossing.point);
            let edge = crossing.edge;
            // A crossing is left once, so this ends even for triangles that are none of a triangulation.
            at = std::mem::replace(&mut crossing.next, NONE);
            if at == NONE || at == start {
                break edge;
            }
        };
        if at == start {
            if is_around_peak {
                points.truncate(begin);
                return None;
            }
            points[begin..].rotate_left(least_at);
            let chain = Chain::new([least; 2], least, 0, begin..points.len());
            return Some(chain.closed(true));
        }
        let ends = [self.keys[first as usize], self.keys[last as usize]];
        let chain = Chain::new(ends, least, least_at as u32, begin..points.len());
        Some(chain.around_peak(is_around_peak))
    }
}

/// Returns the band of chains that were found in any order, with their points in the order of the levels.
fn sorted([first_level, past]: [u32; 2], mut found: Vec<(u32, Chain)>, points: &[[f64; 2]]) -> Band {
    found.sort_by_key(|(level, _)| *level);
    let mut band = Band { first_level, points: Vec::with_capacity(points.len()), ..Band::default() };
    let mut chains = found.into_iter().peekable();
    for level in first_level..past {
        band.starts.push(band.chains.len() as u64);
        while let Some((_, chain)) = chains.next_if(|(of, _)| *of == level) {
            let at = band.points.len() as u64;
            band.points.extend_from_slice(&points[range_of(&chain)]);
            band.chains.push(chain.moved_to(at));
        }
    }
    band.starts.push(band.chains.len() as u64);
    band
}

fn range_of(chain: &Chain) -> Range<usize> {
    chain.at as usize..chain.at as usize + chain.points as usize
}

/// Computes the crossings of an edge from nothing but its ends, so that all triangles and tiles get the same bits.
struct OnEdge {
    low: [f64; 2],
    along: [f64; 2],
    low_height: i64,
    /// How much higher the high end is, in lattice steps.
    height: f64,
    plane: Plane,
}

impl OnEdge {
    fn new([low, high]: [[i32; 3]; 2], plane: Plane) -> OnEdge {
        let difference = |axis: usize| (i64::from(high[axis]) - i64::from(low[axis])) as f64;
        OnEdge {
            low: [0, 1].map(|axis| f64::from(low[axis])),
            along: [0, 1].map(difference),
            low_height: i64::from(low[2]),
            height: difference(2),
            plane,
        }
    }

    /// Returns where a level crosses the edge. All differences of lattice coordinates are exact.
    #[inline]
    fn crossing(&self, level: &Level) -> [f64; 2] {
        let part = level.rise(self.low_height, self.height) / self.height;
        self.plane.source([0, 1].map(|axis| self.low[axis] + part * self.along[axis]))
    }
}
