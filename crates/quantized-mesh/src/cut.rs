//! Clipping triangles to tiles (Sutherland and Hodgman 1974, "Reentrant polygon clipping"), in whole numbers.
//!
//! A corner of a clipped triangle lies on two lines: edges of the triangle, or sides of the tile. It is kept as these two, and its place is
//! computed from them when the polygon is complete. So no rounding enters a decision, and both tiles beside a border round the same
//! fractions.

use crate::mesh::{LAST, Node, each_once};
use crate::number_hash::NumberMap;
use crate::place::{GridPoint, SPAN};

/// If one of so many triangles has two corners in one place, it is worth while to look for others.
const FLAT_SHARE: usize = 8;

/// What a set of triangles leaves in a tile.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// Vertices; several may have the same place.
    pub nodes: Vec<Node>,
    /// Triangles, also those that rounding has turned over, or flattened.
    pub triangles: Vec<[u32; 3]>,
    /// The heights of the triangles over the corners of the tile: south-west, south-east, north-west, north-east.
    pub corners: [Option<i32>; 4],
}

/// Clips a mesh to tiles. Returns the pieces by column and row of their tiles.
pub fn cut(points: &[GridPoint], triangles: &[[u32; 3]]) -> Vec<([i32; 2], Piece)> {
    let mut cutter = Cutter { points, numbers: NumberMap::default(), pieces: Vec::new() };
    let tile_of = |point: &GridPoint| [point.x.div_euclid(SPAN) as i32, point.y.div_euclid(SPAN) as i32];
    let places: Vec<([i32; 2], bool)> =
        points.iter().map(|point| (tile_of(point), point.x % SPAN != 0 && point.y % SPAN != 0)).collect();
    let mut current: Option<([i32; 2], usize)> = None;
    let mut own: Vec<Vec<u32>> = Vec::new();
    for &triangle in triangles {
        let [a, b, c] = triangle.map(|v| places[v as usize]);
        let is_within_one = a.1 && b.1 && c.1 && a.0 == b.0 && b.0 == c.0;
        if !is_within_one {
            cutter.clip(triangle);
            continue;
        }
        let number = match current {
            Some((tile, number)) if tile == a.0 => number,
            _ => cutter.piece(a.0),
        };
        current = Some((a.0, number));
        own.resize_with(cutter.pieces.len(), Vec::new);
        own[number].extend(triangle);
    }
    own.resize_with(cutter.pieces.len(), Vec::new);
    add_inner(points, &own, &mut cutter.pieces);
    cutter.pieces.iter_mut().for_each(|(_, piece)| piece.join_places());
    cutter.pieces
}

impl Piece {
    /// Makes one vertex of all in a place, the highest, if many are where others are: they would wait for nothing.
    fn join_places(&mut self) {
        let place = |v: u32| [self.nodes[v as usize].u, self.nodes[v as usize].v];
        let is_flat = |[a, b, c]: &[u32; 3]| place(*a) == place(*b) || place(*b) == place(*c) || place(*c) == place(*a);
        if self.triangles.iter().filter(|triangle| is_flat(triangle)).count() * FLAT_SHARE <= self.triangles.len() {
            return;
        }
        self.triangles.retain(|triangle| !is_flat(triangle));
        let (nodes, numbers) = each_once(&self.nodes);
        self.triangles.iter_mut().flatten().for_each(|v| *v = numbers[*v as usize]);
        self.nodes = nodes;
    }
}

/// Adds the triangles that lie within one tile to their pieces. `own` are their corners by piece.
fn add_inner(points: &[GridPoint], own: &[Vec<u32>], pieces: &mut [([i32; 2], Piece)]) {
    // The number of a point in the last piece that had it, and the number of that piece.
    let mut last = vec![[u32::MAX; 2]; points.len()];
    for (number, (corners, (tile, piece))) in (0..).zip(own.iter().zip(pieces)) {
        for &[a, b, c] in corners.as_chunks::<3>().0 {
            let triangle = [a, b, c].map(|v| {
                let known = &mut last[v as usize];
                if known[0] != number {
                    *known = [number, piece.nodes.len() as u32];
                    piece.nodes.push(node(*tile, &points[v as usize]));
                }
                known[1]
            });
            piece.triangles.push(triangle);
        }
    }
}

/// Returns the vertex at a point of a tile.
fn node(tile: [i32; 2], point: &GridPoint) -> Node {
    let along = |axis: usize| (point.along(axis) - i64::from(tile[axis]) * SPAN).clamp(0, i64::from(LAST)) as u16;
    Node { u: along(0), v: along(1), h: point.z }
}

struct Cutter<'a> {
    points: &'a [GridPoint],
    /// The numbers of the pieces.
    numbers: NumberMap<[i32; 2], usize>,
    pieces: Vec<([i32; 2], Piece)>,
}

impl Cutter<'_> {
    /// Returns the number of the piece in a tile.
    fn piece(&mut self, tile: [i32; 2]) -> usize {
        *self.numbers.entry(tile).or_insert_with(|| {
            self.pieces.push((tile, Piece::default()));
            self.pieces.len() - 1
        })
    }

    /// Clips a triangle to all tiles that it meets.
    fn clip(&mut self, triangle: [u32; 3]) {
        let corners = triangle.map(|v| self.points[v as usize]);
        let range = |axis: usize| {
            let along = corners.map(|corner| corner.along(axis));
            let (low, high) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
            // A triangle that only touches a tile leaves nothing in it.
            let (first, last) = (low.div_euclid(SPAN), (high - 1).div_euclid(SPAN));
            first as i32..=last.max(first) as i32
        };
        let rows = range(1);
        for x in range(0) {
            for y in rows.clone() {
                self.clip_to([x, y], corners);
            }
        }
        corners.iter().for_each(|corner| self.add_on_border(corner));
        self.add_over_corners(corners);
    }

    /// Adds the heights of a triangle over corners of tiles to all tiles around these, also to those that it only touches.
    fn add_over_corners(&mut self, corners: [GridPoint; 3]) {
        let lines = |axis: usize| {
            let along = corners.map(|corner| corner.along(axis));
            let (low, high) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
            (low + SPAN - 1).div_euclid(SPAN) as i32..=high.div_euclid(SPAN) as i32
        };
        for x in lines(0) {
            for y in lines(1) {
                let Some(height) = Clip::new([x, y], corners).height_over_south_west() else { continue };
                for corner in 0..4 {
                    let tile = [x - (corner & 1), y - (corner >> 1)];
                    let number = self.piece(tile);
                    let known = &mut self.pieces[number].1.corners[corner as usize];
                    *known = (*known).max(Some(height));
                }
            }
        }
    }

    /// Adds a vertex on the border of tiles to all of them, also to those that none of its triangles lies in.
    fn add_on_border(&mut self, point: &GridPoint) {
        let numbers = |along: i64| {
            let last = along.div_euclid(SPAN) as i32;
            if along % SPAN == 0 { last - 1..=last } else { last..=last }
        };
        if point.x % SPAN != 0 && point.y % SPAN != 0 {
            return;
        }
        for x in numbers(point.x) {
            for y in numbers(point.y) {
                let (number, node) = (self.piece([x, y]), node([x, y], point));
                let piece = &mut self.pieces[number].1;
                piece.nodes.push(node);
                if let Some(corner) = node.corner() {
                    piece.corners[corner] = piece.corners[corner].max(Some(node.h));
                }
            }
        }
    }

    fn clip_to(&mut self, tile: [i32; 2], corners: [GridPoint; 3]) {
        let clip = Clip::new(tile, corners);
        let polygon = clip.polygon();
        if polygon.len() < 3 {
            return;
        }
        let number = self.piece(tile);
        let piece = &mut self.pieces[number].1;
        let first = piece.nodes.len() as u32;
        let places: Vec<Node> = polygon.iter().map(|&place| node(tile, &clip.point(place))).collect();
        let len = places.len() as u32;
        // A fan from its least vertex, so that it does not matter where the polygon begins.
        let fan = (0..len).min_by_key(|&i| places[i as usize]).unwrap_or(0);
        piece.nodes.extend(places);
        let triangle = |i: u32| [fan, (fan + i) % len, (fan + i + 1) % len].map(|i| first + i);
        let turned = |[a, b, c]: [u32; 3]| if clip.is_turned { [a, c, b] } else { [a, b, c] };
        piece.triangles.extend((1..len - 1).map(triangle).map(turned));
    }
}

/// A line: an edge of the triangle by its first corner, or a side of the tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    Edge(usize),
    Side(usize),
}

/// A corner of a polygon: a corner of the triangle, or where a line crosses a side of the tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Corner(usize),
    Crossing(Line, usize),
}

/// A corner of a polygon, and the line that leads from it to the next.
type Leg = (Place, Line);

/// A triangle that is clipped to a tile.
struct Clip {
    /// Its corners, counterclockwise.
    corners: [GridPoint; 3],
    /// Whether they were clockwise.
    is_turned: bool,
    /// The x of the west and the east side, the y of the south and the north side.
    sides: [i64; 4],
    /// Twice its area.
    area: i128,
}

impl Clip {
    fn new(tile: [i32; 2], [a, b, c]: [GridPoint; 3]) -> Clip {
        let area = orient([a.x, a.y], [b.x, b.y], [c.x, c.y]);
        let corners = if area < 0 { [a, c, b] } else { [a, b, c] };
        let [west, south] = tile.map(|number| i64::from(number) * SPAN);
        let sides = [west, west + SPAN, south, south + SPAN];
        Clip { corners, is_turned: area < 0, sides, area: area.abs() }
    }

    /// Returns the corners of what lies in the tile.
    fn polygon(&self) -> Vec<Place> {
        let mut legs: Vec<Leg> = (0..3).map(|k| (Place::Corner(k), Line::Edge(k))).collect();
        for side in 0..4 {
            if legs.iter().any(|&(place, _)| self.inside(place, side) < 0) {
                legs = self.clipped(&legs, side);
            }
        }
        legs.into_iter().map(|(place, _)| place).collect()
    }

    /// Returns the part of a polygon on the inner side of a side of the tile.
    fn clipped(&self, legs: &[Leg], side: usize) -> Vec<Leg> {
        let signs: Vec<i8> = legs.iter().map(|&(place, _)| self.inside(place, side)).collect();
        let mut clipped = Vec::with_capacity(legs.len() + 1);
        for (i, &(place, line)) in legs.iter().enumerate() {
            let (sign, next) = (signs[i], signs[(i + 1) % legs.len()]);
            match (sign >= 0, next >= 0) {
                (true, true) => clipped.push((place, line)),
                (true, false) if sign == 0 => clipped.push((place, Line::Side(side))),
                (true, false) => clipped.extend([(place, line), (Place::Crossing(line, side), Line::Side(side))]),
                (false, true) if next > 0 => clipped.push((Place::Crossing(line, side), line)),
                (false, _) => {}
            }
        }
        clipped
    }

    /// Returns 1 for a place on the inner side of a side, 0 on it, and -1 beyond.
    fn inside(&self, place: Place, side: usize) -> i8 {
        let (axis, bound) = (side / 2, self.sides[side]);
        let sign = match place {
            Place::Corner(k) => (self.corners[k].along(axis) - bound).signum() as i8,
            Place::Crossing(Line::Side(other), own) => {
                let at = if other / 2 == axis { other } else { own };
                (self.sides[at] - bound).signum() as i8
            }
            Place::Crossing(Line::Edge(_), own) if own / 2 == axis => (self.sides[own] - bound).signum() as i8,
            Place::Crossing(Line::Edge(k), own) => {
                let (edge, [part, whole]) = self.share(k, own);
                let [from, to] = edge.map(|end| i128::from(end.along(axis)));
                ((from - i128::from(bound)) * whole + (to - from) * part).signum() as i8
            }
        };
        if side.is_multiple_of(2) { sign } else { -sign }
    }

    /// Returns the ends of an edge in order, and how far along it the line of a side crosses: a fraction.
    fn share(&self, edge: usize, side: usize) -> ([GridPoint; 2], [i128; 2]) {
        let (a, b) = (self.corners[edge], self.corners[(edge + 1) % 3]);
        let (from, to) = (a.min(b), a.max(b));
        let axis = side / 2;
        let part = i128::from(self.sides[side] - from.along(axis));
        let whole = i128::from(to.along(axis) - from.along(axis));
        ([from, to], if whole < 0 { [-part, -whole] } else { [part, whole] })
    }

    /// Returns the grid point of a corner of the polygon.
    fn point(&self, place: Place) -> GridPoint {
        match place {
            Place::Corner(k) => self.corners[k],
            Place::Crossing(Line::Side(other), own) => {
                let [x, y] = if own < 2 { [own, other] } else { [other, own] }.map(|side| self.sides[side]);
                GridPoint { x, y, z: self.height_at([x, y]) }
            }
            Place::Crossing(Line::Edge(k), own) => {
                let ([from, to], [part, whole]) = self.share(k, own);
                let between = |from: i64, to: i64| from + nearest(i128::from(to - from) * part, whole) as i64;
                let z = between(from.z.into(), to.z.into()) as i32;
                match own / 2 {
                    0 => GridPoint { x: self.sides[own], y: between(from.y, to.y), z },
                    _ => GridPoint { x: between(from.x, to.x), y: self.sides[own], z },
                }
            }
        }
    }

    /// Returns the height of the triangle over the south-west corner of the tile, if it reaches there.
    fn height_over_south_west(&self) -> Option<i32> {
        let place = [self.sides[0], self.sides[2]];
        let [a, b, c] = self.corners.map(|corner| [corner.x, corner.y]);
        let is_within = [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| orient(from, to, place) >= 0);
        (self.area > 0 && is_within).then(|| self.height_at(place))
    }

    /// Returns the height of the plane of the triangle at a place.
    fn height_at(&self, place: [i64; 2]) -> i32 {
        let [a, b, c] = self.corners.map(|corner| [corner.x, corner.y]);
        let parts = [orient(b, c, place), orient(c, a, place), orient(a, b, place)];
        let base = self.corners[0].z;
        if self.area == 0 {
            return base;
        }
        let heights = self.corners.map(|corner| i128::from(corner.z) - i128::from(base));
        let sum: i128 = parts.iter().zip(heights).map(|(part, height)| part * height).sum();
        (i64::from(base) + nearest(sum, self.area) as i64) as i32
    }
}

/// Returns the whole number nearest to a fraction, the greater of two.
fn nearest(numerator: i128, denominator: i128) -> i128 {
    (2 * numerator + denominator).div_euclid(2 * denominator)
}

/// Returns twice the area of a triangle, negative if it is clockwise.
fn orient(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i128 {
    let from_a = |p: [i64; 2]| [p[0] - a[0], p[1] - a[1]].map(i128::from);
    let ([bx, by], [cx, cy]) = (from_a(b), from_a(c));
    bx * cy - by * cx
}
