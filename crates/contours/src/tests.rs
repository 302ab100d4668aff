//! The lines of small triangulations with many ties, compared with segments in exact whole numbers.

use crate::chain::Chain;
use crate::join::join;
use crate::levels::Levels;
use crate::line_points::line_points;
use crate::trace::{Plane, trace};
use delaunay::triangulation::divide_and_conquer::triangulate;
use lattice::Lattice;
use rust_decimal::Decimal;
use std::collections::{BTreeMap, BTreeSet};

/// Crossings lie on multiples of one divided by this: heights differ by up to 5, and levels are multiples of 1/64 step.
const UNITS: i64 = 64 * 60;

/// Eight heights of levels as 64ths of a lattice step.
const LEVELS: [i64; 8] = [-64, 0, 64, 80, 96, 128, 192, 304];

/// A crossing in units, by the place.
type Place = [i64; 2];

/// A directed segment.
type Segment = [Place; 2];

/// A triangulation with heights.
struct Tin {
    vertices: Vec<[i32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Random numbers, the same on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) % end
    }
}

impl Tin {
    fn random(random: &mut Random) -> Tin {
        let (size, highest) = (3 + random.below(8), 2 + random.below(4));
        let places: BTreeSet<[i32; 2]> =
            (0..4 + random.below(40)).map(|_| [0, 1].map(|_| random.below(size) as i32 - 2)).collect();
        let sites: Vec<[i32; 2]> = places.into_iter().collect();
        let mesh = triangulate(&sites).unwrap();
        let mut triangles: Vec<[u32; 3]> = mesh.corners().to_vec();
        // Holes, as max_edge leaves them.
        if random.below(3) == 0 {
            triangles.retain(|_| random.below(6) > 0);
        }
        let vertices = sites.iter().map(|&[x, y]| [x, y, random.below(highest + 1) as i32]).collect();
        Tin { vertices, triangles }
    }

    /// Returns the chains of all levels, of the triangles dealt out to so many tiles, and the points they refer to.
    fn chains(&self, tiles: u64, random: &mut Random) -> (Vec<Vec<Chain>>, Vec<[f64; 2]>) {
        let mut parts: Vec<Vec<[u32; 3]>> = vec![Vec::new(); tiles as usize];
        self.triangles.iter().for_each(|triangle| parts[random.below(tiles) as usize].push(*triangle));
        let (mut chains, mut points) = (vec![Vec::new(); LEVELS.len()], Vec::new());
        for part in parts {
            // A tile has the vertices of its triangles, in an order of its own.
            let mut own: Vec<u32> = part.iter().flatten().copied().collect();
            own.sort_unstable_by_key(|v| v.wrapping_mul(2654435761));
            own.dedup();
            let vertices: Vec<[i32; 3]> = own.iter().map(|v| self.vertices[*v as usize]).collect();
            let number = |v: u32| own.iter().position(|other| *other == v).unwrap() as u32;
            let triangles: Vec<[u32; 3]> = part.iter().map(|triangle| triangle.map(number)).collect();
            trace(&vertices, &triangles, &levels(), Plane { offset: [0.0; 2], step: 1.0 }, &mut |band| {
                for level in band.levels() {
                    let of = band.chains_of(level).iter();
                    chains[level as usize].extend(of.map(|chain| chain.moved_to(chain.at + points.len() as u64)));
                }
                points.extend(&band.points);
                Ok(())
            })
            .unwrap();
        }
        (chains, points)
    }

    /// Returns the lines of each level: whether they are rings, and their points.
    fn lines(&self, tiles: u64, random: &mut Random) -> Vec<Vec<(bool, Vec<[f64; 2]>)>> {
        let (chains, points) = self.chains(tiles, random);
        let of_level = |chains: &Vec<Chain>| {
            let joined = join(chains, 1);
            let line = |line: &crate::Line| {
                let pieces = joined.pieces_of(line).iter();
                let points = pieces.flat_map(|piece| &points[piece.at as usize..][..piece.points as usize]).copied();
                (line.is_closed, line_points(points.collect(), line.is_closed).unwrap())
            };
            joined.lines.iter().map(line).collect()
        };
        chains.iter().map(of_level).collect()
    }

    /// Returns where a level crosses the edge between two vertices, if it does: in whole units.
    fn crossing(&self, [a, b]: [u32; 2], level: i64) -> Option<Place> {
        let [a, b] = [a, b].map(|v| self.vertices[v as usize].map(i64::from));
        let [low, high] = if a[2] < b[2] { [a, b] } else { [b, a] };
        if 64 * low[2] >= level || 64 * high[2] < level {
            return None;
        }
        // One 64th below a vertex at the level.
        let level = if 64 * high[2] == level { level - 1 } else { level };
        let dz = high[2] - low[2];
        assert_eq!(60 % dz, 0);
        Some([0, 1].map(|axis| low[axis] * UNITS + (level - 64 * low[2]) * (60 / dz) * (high[axis] - low[axis])))
    }

    /// Returns all segments of a level with the higher ground on the left, but for those around a single vertex at the level.
    fn segments(&self, level: i64) -> BTreeSet<Segment> {
        let sides = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
        let mut segments = Vec::new();
        // Lines as sets of crossings that belong together, each with the high ends of its edges.
        let mut line_of: BTreeMap<Place, Place> = BTreeMap::new();
        let mut peaks: BTreeMap<Place, u32> = BTreeMap::new();
        fn root(line_of: &BTreeMap<Place, Place>, mut place: Place) -> Place {
            while line_of.get(&place).is_some_and(|above| *above != place) {
                place = line_of[&place];
            }
            place
        }
        for triangle in &self.triangles {
            let crossed: Vec<(Place, [u32; 2])> =
                sides(*triangle).into_iter().filter_map(|side| Some((self.crossing(side, level)?, side))).collect();
            let [(p, first), (q, second)] = crossed[..] else {
                assert!(crossed.is_empty());
                continue;
            };
            for (place, [a, b]) in [(p, first), (q, second)] {
                line_of.entry(place).or_insert(place);
                let high = if self.vertices[a as usize][2] > self.vertices[b as usize][2] { a } else { b };
                peaks.insert(place, high);
            }
            let [from, to] = [root(&line_of, p), root(&line_of, q)];
            line_of.insert(from, to);
            let high =
                triangle.iter().map(|v| self.vertices[*v as usize]).find(|v| 64 * i64::from(v[2]) >= level).unwrap();
            let high = [0, 1].map(|axis| i64::from(high[axis]) * UNITS);
            segments.push(if turn(p, q, high) > 0 { [p, q] } else { [q, p] });
        }
        let is_point = |place: Place| {
            let line = root(&line_of, place);
            let mut ends = line_of.keys().filter(|other| root(&line_of, **other) == line).map(|other| peaks[other]);
            let peak = ends.next().unwrap();
            64 * i64::from(self.vertices[peak as usize][2]) == level && ends.all(|end| end == peak)
        };
        segments.into_iter().filter(|[p, _]| !is_point(*p)).collect()
    }

    /// Returns the crossings on the border of the triangles.
    fn on_border(&self, level: i64) -> BTreeSet<Place> {
        let mut triangles: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for [a, b, c] in &self.triangles {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                *triangles.entry([*a.min(b), *a.max(b)]).or_default() += 1;
            }
        }
        triangles
            .into_iter()
            .filter(|(_, count)| *count == 1)
            .filter_map(|(edge, _)| self.crossing(edge, level))
            .collect()
    }
}

fn levels() -> Levels {
    let lattice = Lattice::new([Decimal::ZERO; 3], Decimal::ONE, Decimal::ONE).unwrap();
    Levels::new(&lattice, &LEVELS.map(|level| Decimal::from(level).checked_div(Decimal::from(64)).unwrap())).unwrap()
}

/// Returns twice the area of a triangle, which is positive if it turns counterclockwise.
fn turn([ax, ay]: Place, [bx, by]: Place, [cx, cy]: Place) -> i128 {
    let wide = |a: i64, b: i64| i128::from(a - b);
    wide(bx, ax) * wide(cy, ay) - wide(by, ay) * wide(cx, ax)
}

/// Tells whether two segments have a place in common.
fn meet([a, b]: Segment, [c, d]: Segment) -> bool {
    let sides = [turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)].map(i128::signum);
    let on = |[p, q]: Segment, at: Place| {
        turn(p, q, at) == 0 && (0..2).all(|k| p[k].min(q[k]) <= at[k] && at[k] <= p[k].max(q[k]))
    };
    (sides[0] * sides[1] < 0 && sides[2] * sides[3] < 0)
        || on([a, b], c)
        || on([a, b], d)
        || on([c, d], a)
        || on([c, d], b)
}

fn exact(point: [f64; 2]) -> Place {
    point.map(|coordinate| {
        let units = coordinate * UNITS as f64;
        assert!((units - units.round()).abs() < 1e-6, "{coordinate}");
        units.round() as i64
    })
}

#[test]
fn lines_are_those_of_the_triangles_and_never_touch() {
    let mut random = Random(7);
    let (mut lines, mut rings, mut left_out) = (0, 0, 0);
    for number in 0..300 {
        let tin = Tin::random(&mut random);
        let of_levels = tin.lines(1, &mut random);
        let mut all: Vec<Segment> = Vec::new();
        for (found, level) in of_levels.iter().zip(LEVELS) {
            let expected = tin.segments(level);
            let border = tin.on_border(level);
            let mut segments = BTreeSet::new();
            for (is_closed, points) in found {
                let places: Vec<Place> = points.iter().copied().map(exact).collect();
                let ends = [places[0], *places.last().unwrap()];
                assert_eq!(ends[0] == ends[1], *is_closed, "{number}");
                assert!(*is_closed || ends.iter().all(|end| border.contains(end)), "{number}: a line ends inside");
                for pair in places.windows(2) {
                    assert!(segments.insert([pair[0], pair[1]]), "{number}: twice");
                }
                (lines, rings) = (lines + 1, rings + usize::from(*is_closed));
            }
            assert_eq!(segments, expected, "{number}, level {level}");
            left_out += usize::from(
                expected.is_empty()
                    && tin.triangles.iter().flatten().any(|v| 64 * i64::from(tin.vertices[*v as usize][2]) == level),
            );
            all.extend(segments);
        }
        for (n, first) in all.iter().enumerate() {
            for second in &all[n + 1..] {
                let follow = first[1] == second[0] || second[1] == first[0];
                // Segments that follow each other have no more than one end in common; the third corner of a triangle is elsewhere.
                let back = follow
                    && turn(first[0], first[1], if first[1] == second[0] { second[1] } else { second[0] }) == 0
                    && (first[0] == second[1] && first[1] == second[0]);
                assert!(if follow { !back } else { !meet(*first, *second) }, "{number}: {first:?} and {second:?} meet");
            }
        }
    }
    assert!(lines > 1_000 && rings > 100 && left_out > 10, "{lines} lines, {rings} rings, {left_out} left out");
}

#[test]
fn lines_are_the_same_in_any_tiles() {
    let mut random = Random(11);
    for number in 0..100 {
        let tin = Tin::random(&mut random);
        let whole = tin.lines(1, &mut random);
        for tiles in [2, 5, 40] {
            assert_eq!(tin.lines(tiles, &mut random), whole, "{number}, {tiles} tiles");
        }
    }
}

#[test]
fn a_hill_has_a_ring_with_the_top_on_its_left() {
    let vertices = vec![[0, 0, 4], [2, 2, 0], [-2, 2, 0], [-2, -2, 0], [2, -2, 0]];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
    let of_levels = Tin { vertices, triangles }.lines(2, &mut Random(3));
    // Heights 0 to 4: the levels -1 and 0 have no low vertex.
    assert_eq!(of_levels.iter().map(Vec::len).collect::<Vec<_>>(), [0, 0, 1, 1, 1, 1, 1, 0]);
    let (is_closed, points) = &of_levels[5][0];
    assert!(is_closed);
    // Half way, counterclockwise.
    assert_eq!(*points, [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]);
    assert_eq!(points.first(), points.last());
}

#[test]
fn a_vertex_at_the_level_alone_has_no_line_and_a_plateau_has_one() {
    let at = |z: [i32; 2]| Tin {
        vertices: vec![[0, 0, z[0]], [1, 0, z[1]], [5, 5, 0], [-5, 5, 0], [-5, -5, 0], [5, -5, 0]],
        triangles: vec![[0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 1, 2], [1, 5, 2], [0, 5, 1]],
    };
    let count = |z: [i32; 2]| at(z).lines(3, &mut Random(1))[2].len();
    assert_eq!([count([1, 0]), count([1, 1]), count([2, 0])], [0, 1, 1]);
}
