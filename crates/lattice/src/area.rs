//! An area on the lattice: which lattice points lie within the polygons of `[input] clip`.
//!
//! The vertices of polygons lie on a finer lattice ([`Lattice::for_places`](crate::Lattice::for_places)), so that a polygon between the points of a coarse grid keeps
//! the points within it. The rule, in whole numbers:
//! - A point lies in the area if it lies in any of the polygons.
//! - A point lies in a polygon if a ray from it crosses the rings of the polygon an odd number of times (even-odd). So holes are outside.
//! - A point on an edge lies in the polygon, whether the edge is of the outline or of a hole.
//!
//! Square cells make this fast. No edge comes into most cells, so that all points of one are inside, or all are outside. The other cells
//! list the edges that come near. Whether the lower left corner of such a cell lies in a polygon is known, and so is the number of edges
//! on the way from there to a point: up along the left border of the cell, then to the right.
//!
//! The way must meet no vertex. So it lies beside the corner by less than any distance between coordinates: by ε to the right and by δ
//! upwards, where δ is much less than ε. Wherever a comparison of whole numbers ends in a tie, ε and δ decide it.

/// The polygons of an area: of each its rings, in parts of a lattice step. The last vertex of a ring is joined with the first.
pub type Polygons = Vec<Vec<Vec<[i64; 2]>>>;

/// Vertices lie within this distance of zero along x and y. Cross products of their differences then fit an `i128` with room to spare.
pub const FARTHEST_VERTEX: i64 = 1 << 52;

/// Cells for each edge, so that most cells along a border list one or two.
const CELLS_PER_EDGE: u64 = 16;

/// A small polygon has so many cells.
const FEWEST_CELLS: u64 = 1 << 12;

/// The most cells: four bytes of memory for each.
const MOST_CELLS: u64 = 1 << 22;

/// Edges are listed about so often each, at most; and [`FEWEST_CELLS`] times more in all.
const LISTED_PER_EDGE: u64 = 16;

/// A cell with a side of two to this power holds all points, in parts of a step.
const ALL_IN_ONE_CELL: u32 = 44;

/// Points that fit an `i32` are asked for. No cell lies outside.
const POINTS: [i64; 2] = [i32::MIN as i64, i32::MAX as i64];

/// Answers whether points lie in an area.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatticeArea {
    edges: Vec<Edge>,
    /// The number of parts in a lattice step. All coordinates here are in parts.
    parts: i64,
    /// The least x and y, and the greatest, of all places that may be inside. Inside out if there is none.
    min: [i64; 2],
    max: [i64; 2],
    /// The side of a cell is two to this power.
    shift: u32,
    columns: usize,
    /// What is known of each cell, row by row: [`OUTSIDE`], [`INSIDE`], or where its list begins.
    cells: Vec<u32>,
    /// Lists of edges, with [`END`] behind each.
    lists: Vec<Listed>,
}

/// A cell without points inside.
const OUTSIDE: u32 = u32::MAX;

/// A cell of which all points are inside.
const INSIDE: u32 = u32::MAX - 1;

/// What ends a list.
const END: Listed = Listed { edge: u32::MAX, starts_inside: false };

/// An edge of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Listed {
    edge: u32,
    /// Whether the corner of the cell lies in the edge's polygon.
    starts_inside: bool,
}

/// An edge of a polygon. Those of a polygon follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Edge {
    a: [i64; 2],
    b: [i64; 2],
    polygon: u32,
}

/// A way from the corner of a cell, in parts, to a place, in units of 1 / `SCALE` parts.
#[derive(Clone, Copy)]
struct Way {
    corner: [i64; 2],
    to: [i64; 2],
}

impl LatticeArea {
    /// Returns the area of these polygons, whose coordinates are in units of 1 / `parts` lattice steps. Of rings without three vertices, the
    /// points on their edges are in the area.
    pub fn new(polygons: &[Vec<Vec<[i64; 2]>>], parts: i64) -> LatticeArea {
        let edges = edges_of(polygons);
        let all = |axis: usize| edges.iter().flat_map(move |edge| [edge.a[axis], edge.b[axis]]);
        let min = [0, 1].map(|axis| all(axis).min().unwrap_or(i64::MAX).max(parts * POINTS[0]));
        let max = [0, 1].map(|axis| all(axis).max().unwrap_or(i64::MIN).min(parts * POINTS[1]));
        let empty = LatticeArea { edges, parts, min, max, shift: 0, columns: 0, cells: Vec::new(), lists: Vec::new() };
        if (0..2).any(|axis| min[axis] > max[axis]) { empty } else { empty.with_cells() }
    }

    /// Tells whether a lattice point lies in the area.
    #[inline]
    pub fn holds(&self, point: [i32; 2]) -> bool {
        self.holds_scaled::<1>(point.map(|value| self.parts * i64::from(value)))
    }

    /// Tells whether the centroid of a triangle lies in the area: a third of the sum of its corners.
    #[inline]
    pub fn holds_centroid(&self, corners: [[i32; 2]; 3]) -> bool {
        let sum = |axis: usize| corners.iter().map(|corner| i64::from(corner[axis])).sum::<i64>();
        self.holds_scaled::<3>([0, 1].map(|axis| self.parts * sum(axis)))
    }

    /// Tells whether some of a triangle lies in the area: the centroid of one of the 16 equal triangles that it consists of.
    pub fn holds_some_of(&self, corners: [[i32; 2]; 3]) -> bool {
        let weights = |first: i64, sum: i64| {
            let pairs = (0..=sum).flat_map(move |i| (0..=sum - i).map(move |j| [i, j, sum - i - j]));
            pairs.map(move |thirds| thirds.map(|third| 3 * third + first))
        };
        // Those that point as the whole triangle does, and the others. The weights of a centroid add up to 12.
        weights(1, 3).chain(weights(2, 2)).any(|weights| {
            let weighted = |axis: usize| {
                corners.iter().zip(weights).map(|(corner, weight)| weight * i64::from(corner[axis])).sum::<i64>()
            };
            self.holds_scaled::<12>([0, 1].map(|axis| self.parts * weighted(axis)))
        })
    }

    /// Returns the least and the greatest x and y of lattice points around all that may be inside; `None` if there is none.
    pub fn bounds(&self) -> Option<[[i32; 2]; 2]> {
        if self.cells.is_empty() {
            return None;
        }
        let point = |place: [i64; 2]| Some([i32::try_from(place[0]).ok()?, i32::try_from(place[1]).ok()?]);
        let below = self.min.map(|value| value.div_euclid(self.parts));
        let above = self.max.map(|value| -(-value).div_euclid(self.parts));
        Some([point(below)?, point(above)?])
    }

    /// Tells whether a place lies in the area, whose coordinates are in units of 1 / `SCALE` parts.
    #[inline]
    fn holds_scaled<const SCALE: i64>(&self, point: [i64; 2]) -> bool {
        let is_beyond = |axis: usize| point[axis] < SCALE * self.min[axis] || point[axis] > SCALE * self.max[axis];
        if self.cells.is_empty() || is_beyond(0) || is_beyond(1) {
            return false;
        }
        let cell = [0, 1].map(|axis| (point[axis].div_euclid(SCALE) - self.min[axis]) >> self.shift);
        match self.cells[cell[1] as usize * self.columns + cell[0] as usize] {
            OUTSIDE => false,
            INSIDE => true,
            first => {
                let corner = [0, 1].map(|axis| self.min[axis] + (cell[axis] << self.shift));
                self.is_inside_near_edges::<SCALE>(first, Way { corner, to: point })
            }
        }
    }

    /// Walks from the corner of a cell to a point, and counts the edges of each polygon on the way.
    fn is_inside_near_edges<const SCALE: i64>(&self, first: u32, way: Way) -> bool {
        let mut is_inside = false;
        let mut polygon = None;
        for listed in self.lists[first as usize..].iter().take_while(|listed| **listed != END) {
            let edge = &self.edges[listed.edge as usize];
            if polygon != Some(edge.polygon) {
                if is_inside {
                    return true;
                }
                (polygon, is_inside) = (Some(edge.polygon), listed.starts_inside);
            }
            match edge.is_crossed::<SCALE>(way) {
                None => return true,
                Some(is_crossed) => is_inside ^= is_crossed,
            }
        }
        is_inside
    }

    /// Returns the area with cells, as small as the number of edges allows.
    fn with_cells(mut self) -> LatticeArea {
        let edges = self.edges.len() as u64;
        let most = (CELLS_PER_EDGE * edges).clamp(FEWEST_CELLS, MOST_CELLS);
        let most_listed = LISTED_PER_EDGE * edges + FEWEST_CELLS;
        let count = |axis: usize, shift: u32| ((self.max[axis] - self.min[axis]) >> shift) as u64 + 1;
        // The areas of small polygons have few points.
        let is_fit = |shift: &u32| {
            count(0, *shift).saturating_mul(count(1, *shift)) <= most && self.listed(*shift, most_listed) <= most_listed
        };
        self.shift = (0..ALL_IN_ONE_CELL).find(is_fit).unwrap_or(ALL_IN_ONE_CELL);
        let [columns, rows] = [count(0, self.shift) as usize, count(1, self.shift) as usize];
        self.columns = columns;
        let mut edges_of_rows = vec![Vec::new(); rows];
        for (number, edge) in (0..).zip(&self.edges) {
            for row in self.cells_between(1, self.shift, edge.span(1)) {
                edges_of_rows[row].push(number);
            }
        }
        self.cells = Vec::with_capacity(columns * rows);
        for (row, edges) in edges_of_rows.iter().enumerate() {
            self.add_row(row, edges);
        }
        self
    }

    /// Returns about how often edges are listed in cells of this size; it stops to count beyond `most`.
    fn listed(&self, shift: u32, most: u64) -> u64 {
        let mut listed = 0;
        for edge in &self.edges {
            let [columns, rows] = [0, 1].map(|axis| self.cells_between(axis, shift, edge.span(axis)).count() as u64);
            listed += columns + rows;
            if listed > most {
                break;
            }
        }
        listed
    }

    /// Returns the columns (axis 0) or rows (axis 1) of cells whose closed squares meet the coordinates from `low` to `high`.
    fn cells_between(&self, axis: usize, shift: u32, [low, high]: [i64; 2]) -> std::ops::Range<usize> {
        let last = (self.max[axis] - self.min[axis]) >> shift;
        let first = ((low - self.min[axis] - 1) >> shift).max(0);
        let end = ((high - self.min[axis]) >> shift).min(last) + 1;
        if first < end { first as usize..end as usize } else { 0..0 }
    }

    /// Adds the cells of a row, into which these `edges` come.
    fn add_row(&mut self, row: usize, edges: &[u32]) {
        let low = self.min[1] + ((row as i64) << self.shift);
        let high = low + (1 << self.shift);
        let mut in_cells: Vec<(usize, u32)> = Vec::new();
        let mut crossings: Vec<(u32, usize)> = Vec::new();
        for &number in edges {
            let edge = self.edges[number as usize];
            in_cells.extend(self.cells_between(0, self.shift, edge.x_between(low, high)).map(|cell| (cell, number)));
            if (edge.a[1] > low) != (edge.b[1] > low) {
                crossings.push((edge.polygon, self.first_beyond(edge.x_at(low)[1])));
            }
        }
        in_cells.sort_unstable();
        crossings.sort_unstable();
        let around = self.polygons_around_corners(&crossings);
        let mut left = in_cells.as_slice();
        for (cell, &around) in around.iter().enumerate() {
            let (here, rest) = left.split_at(left.partition_point(|(of, _)| *of == cell));
            left = rest;
            let found = self.cell(cell, around, here, &crossings);
            self.cells.push(found);
        }
    }

    /// Returns what is known of the cell in this column, whose corner lies in so many polygons, and into which the edges of `here` come.
    fn cell(&mut self, column: usize, around: u32, here: &[(usize, u32)], crossings: &[(u32, usize)]) -> u32 {
        let (first, mut own, mut last) = (self.lists.len(), 0, None);
        let mut starts_inside = false;
        for &(_, number) in here {
            let polygon = self.edges[number as usize].polygon;
            if last != Some(polygon) {
                last = Some(polygon);
                let before = |until: usize| crossings.partition_point(|crossing| *crossing < (polygon, until));
                starts_inside = (before(column + 1) - before(0)) % 2 == 1;
                own += u32::from(starts_inside);
            }
            self.lists.push(Listed { edge: number, starts_inside });
        }
        // A polygon that holds the corner and has no edge here holds the cell.
        if around > own || here.is_empty() {
            self.lists.truncate(first);
            return if around > own { INSIDE } else { OUTSIDE };
        }
        self.lists.push(END);
        first as u32
    }

    /// Returns the number of polygons in which the corner of each cell of a row lies. A crossing has the polygon, and the first cell whose
    /// corner lies on its right.
    fn polygons_around_corners(&self, crossings: &[(u32, usize)]) -> Vec<u32> {
        let mut changes = vec![0; self.columns + 1];
        for of_polygon in crossings.chunk_by(|a, b| a.0 == b.0) {
            // A closed ring crosses a line an even number of times.
            for pair in of_polygon.chunks(2) {
                for ((_, cell), change) in pair.iter().zip([1, -1]) {
                    changes[*cell] += change;
                }
            }
        }
        let mut around = 0;
        let sum = |change: &i32| {
            around += change;
            around.unsigned_abs()
        };
        changes[..self.columns].iter().map(sum).collect()
    }

    /// Returns the first column whose left border is at or beyond `x`.
    fn first_beyond(&self, x: i64) -> usize {
        let cell = (x - self.min[0] + (1 << self.shift) - 1) >> self.shift;
        cell.clamp(0, self.columns as i64) as usize
    }
}

impl Edge {
    /// Returns the least and the greatest coordinate.
    fn span(&self, axis: usize) -> [i64; 2] {
        [self.a[axis].min(self.b[axis]), self.a[axis].max(self.b[axis])]
    }

    /// Returns whole numbers below and above the x of the edge at this y, which lies between those of its ends, which differ.
    fn x_at(&self, y: i64) -> [i64; 2] {
        let [dx, dy] = [0, 1].map(|axis| i128::from(self.b[axis] - self.a[axis]));
        let (numerator, dy) = (i128::from(y - self.a[1]) * dx * dy.signum(), dy.abs());
        let low = self.a[0] + numerator.div_euclid(dy) as i64;
        [low, low + i64::from(numerator.rem_euclid(dy) != 0)]
    }

    /// Returns whole numbers below and above the x of all that lies between these y.
    fn x_between(&self, low: i64, high: i64) -> [i64; 2] {
        let [least, greatest] = self.span(1);
        if least == greatest {
            return self.span(0);
        }
        let [a, b] = [self.x_at(low.max(least)), self.x_at(high.min(greatest))];
        [a[0].min(b[0]), a[1].max(b[1])]
    }

    /// Tells whether a way crosses the edge an odd number of times; `None` if it ends on the edge.
    #[inline]
    fn is_crossed<const SCALE: i64>(&self, Way { corner, to: [x, y] }: Way) -> Option<bool> {
        let [a, b] = [self.a, self.b].map(|end| end.map(|value| i128::from(SCALE * value)));
        let (point, start) = ([i128::from(x), i128::from(y)], corner.map(|value| i128::from(SCALE * value)));
        // Above 0 if a point lies to the left of ab.
        let turn = |[x, y]: [i128; 2]| ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])).signum();
        let may_touch = |axis: usize| point[axis] >= a[axis].min(b[axis]) && point[axis] <= a[axis].max(b[axis]);
        if may_touch(0) && may_touch(1) && turn(point) == 0 {
            return None;
        }
        let mut is_crossed = false;
        if (a[0] > start[0]) != (b[0] > start[0]) {
            // Up along the border at x + ε, from y + δ to y + δ. The edge goes to the right from `a` to `b`, or it is turned round.
            let rises = (b[0] - a[0]).signum();
            let slope = ((b[1] - a[1]) * rises).signum();
            let is_above = |y: i128| match -turn([start[0], y]) * rises {
                0 => slope > 0,
                side => side > 0,
            };
            is_crossed ^= is_above(start[1]) != is_above(point[1]);
        }
        if (a[1] > point[1]) != (b[1] > point[1]) {
            // To the right at y + δ, from the border at x + ε. On a tie with the border, the edge is on its left.
            let rises = (b[1] - a[1]).signum();
            let is_right_of_border = turn([start[0], point[1]]) * rises > 0;
            let is_right_of_point = turn(point) * rises > 0;
            is_crossed ^= is_right_of_border != is_right_of_point;
        }
        Some(is_crossed)
    }
}

/// Returns the edges of the polygons, in their order. A ring that rounding has made a point keeps it, as an edge of no length.
fn edges_of(polygons: &[Vec<Vec<[i64; 2]>>]) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (polygon, rings) in (0..).zip(polygons) {
        for ring in rings {
            let next = ring.iter().cycle().skip(1);
            edges.extend(ring.iter().zip(next).map(|(&a, &b)| Edge { a, b, polygon }));
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The rule, edge by edge: a point in units of 1 / `scale`.
    fn is_inside(polygons: &Polygons, [x, y]: [i64; 2], scale: i64) -> bool {
        polygons.iter().any(|rings| {
            let (mut is_inside, mut is_on_edge) = (false, false);
            for ring in rings {
                for (i, a) in ring.iter().enumerate() {
                    let b = ring[(i + 1) % ring.len()];
                    let [[ax, ay], [bx, by]] = [*a, b].map(|end| end.map(|value| i128::from(value * scale)));
                    let (x, y) = (i128::from(x), i128::from(y));
                    let turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
                    let in_box = x >= ax.min(bx) && x <= ax.max(bx) && y >= ay.min(by) && y <= ay.max(by);
                    is_on_edge |= turn == 0 && in_box;
                    if (ay > y) != (by > y) {
                        is_inside ^= (turn > 0) == (by > ay);
                    }
                }
            }
            is_inside || is_on_edge
        })
    }

    /// A star with this many vertices around a place, at distances up to `size`.
    fn star(at: [i64; 2], size: i64, distances: &[i64]) -> Vec<[i64; 2]> {
        let count = distances.len() as f64;
        let corner = |(i, distance): (usize, &i64)| {
            let angle = i as f64 / count * std::f64::consts::TAU;
            let far = (size * distance) as f64 / 100.0;
            [at[0] + (far * angle.cos()) as i64, at[1] + (far * angle.sin()) as i64]
        };
        distances.iter().enumerate().map(corner).collect()
    }

    prop_compose! {
        fn polygon(size: i64, far: i64)(
            at in prop::array::uniform2(-far..=far),
            outline in prop::collection::vec(20i64..100, 3..40),
            hole in prop::collection::vec(0i64..60, 3..12),
            has_hole in any::<bool>(),
        ) -> Vec<Vec<[i64; 2]>> {
            let mut rings = vec![star(at, size, &outline)];
            if has_hole {
                rings.push(star(at, size, &hole));
            }
            rings
        }
    }

    /// Rings of any vertices, which cross themselves.
    fn tangle() -> impl Strategy<Value = Vec<Vec<[i64; 2]>>> {
        let ring = prop::collection::vec(prop::array::uniform2(-12i64..12), 1..9);
        prop::collection::vec(ring, 1..4)
    }

    proptest! {
        #[test]
        fn the_rule_is_that_of_all_edges(
            polygons in prop::collection::vec(prop_oneof![polygon(60, 80), polygon(9, 20), tangle()], 0..5),
            points in prop::collection::vec(prop::array::uniform2(-150i32..150), 40),
            parts in prop_oneof![2 => Just(1), 1 => 2i64..7],
        ) {
            let area = LatticeArea::new(&polygons, parts);
            let vertices = polygons.iter().flatten().flatten().map(|vertex| vertex.map(|value| value as i32));
            let points = points.into_iter().chain(vertices).map(|point| point.map(|value| value / parts as i32));
            let points: Vec<[i32; 2]> = points.collect();
            for point in &points {
                let place = point.map(|value| parts * i64::from(value));
                prop_assert_eq!(area.holds(*point), is_inside(&polygons, place, 1), "{:?}", point);
                let is_around = |[min, max]: [[i32; 2]; 2]| (0..2).all(|axis| min[axis] <= point[axis] && point[axis] <= max[axis]);
                prop_assert!(!area.holds(*point) || area.bounds().is_some_and(is_around));
            }
            for corners in points.windows(3) {
                let sum = [0, 1].map(|axis| parts * corners.iter().map(|corner| i64::from(corner[axis])).sum::<i64>());
                let corners = [corners[0], corners[1], corners[2]];
                let triples = (0..12).flat_map(|i| (0..12).map(move |j| [i, j, 12 - i - j]));
                let is_part = |weights: &[i64; 3]| weights[2] > 0 && weights.iter().all(|weight| weight % 3 == weights[0] % 3 && weight % 3 > 0);
                let mut centroids = triples.filter(is_part).map(|weights| {
                    [0, 1].map(|axis| (0..3).map(|corner| parts * weights[corner] * i64::from(corners[corner][axis])).sum())
                });
                let holds_some = centroids.any(|centroid| is_inside(&polygons, centroid, 12));
                prop_assert_eq!(area.holds_some_of(corners), holds_some, "{:?}", corners);
                prop_assert_eq!(area.holds_centroid(corners), is_inside(&polygons, sum, 3), "{:?}", corners);
            }
        }

        #[test]
        fn large_polygons_follow_the_same_rule(
            polygons in prop::collection::vec(polygon(1 << 31, 1 << 29), 1..3),
            points in prop::collection::vec(prop::array::uniform2(-(1i32 << 29)..1 << 29), 60),
            shares in prop::collection::vec((0usize..1000, 0i64..=8), 30),
        ) {
            let area = LatticeArea::new(&polygons, 1);
            let ring = &polygons[0][0];
            // Points on edges, as far as these have some, and beside them.
            let on_edges = shares.iter().map(|&(edge, share)| {
                let (a, b) = (ring[edge % ring.len()], ring[(edge + 1) % ring.len()]);
                [0, 1].map(|axis| (a[axis] + (b[axis] - a[axis]) * share / 8) as i32)
            });
            for point in points.into_iter().chain(on_edges) {
                prop_assert_eq!(area.holds(point), is_inside(&polygons, point.map(i64::from), 1), "{:?}", point);
            }
        }
    }

    /// Every point near a polygon with edges along rows, columns and diagonals of cells.
    #[test]
    fn all_points_around_follow_the_rule() {
        let square = |low: i64, high: i64| vec![[low, low], [high, low], [high, high], [low, high]];
        let diamond = vec![[64, 0], [128, 64], [64, 128], [0, 64]];
        let comb: Vec<[i64; 2]> = (0..60).map(|i| [i * 2, if i % 2 == 0 { 0 } else { 120 }]).collect();
        for polygons in [
            vec![vec![square(0, 128), square(32, 64)]],
            vec![vec![diamond.clone(), square(40, 88)], vec![square(60, 70)]],
            vec![vec![diamond], vec![square(0, 128)]],
            vec![vec![comb]],
            vec![vec![square(0, 128), square(0, 128)]],
            vec![vec![vec![[0, 0], [100, 50]]], vec![vec![[7, 7]]]],
        ] {
            let area = LatticeArea::new(&polygons, 1);
            for y in -3..132 {
                for x in -3..132 {
                    let expected = is_inside(&polygons, [x.into(), y.into()], 1);
                    assert_eq!(area.holds([x, y]), expected, "{x}, {y} in {polygons:?}");
                }
            }
        }
    }

    #[test]
    fn borders_of_outlines_and_holes_are_inside() {
        let square = |low: i64, high: i64| vec![[low, low], [high, low], [high, high], [low, high]];
        let area = LatticeArea::new(&[vec![square(0, 100), square(40, 60)]], 1);
        for (point, expected) in [
            ([0, 0], true),
            ([100, 37], true),
            ([101, 37], false),
            ([40, 50], true),
            ([60, 60], true),
            ([41, 50], false),
            ([39, 50], true),
        ] {
            assert_eq!(area.holds(point), expected, "{point:?}");
        }
        assert_eq!(area.bounds(), Some([[0, 0], [100, 100]]));
        let [none, far] = [Vec::new(), vec![vec![square(1 << 40, 1 << 41)]]].map(|all| LatticeArea::new(&all, 1));
        assert!(none.bounds().is_none() && !none.holds([0, 0]));
        assert!(far.bounds().is_none() && !far.holds([i32::MAX; 2]));
    }

    /// On a grid of a metre, a polygon in centimetres keeps what lies within, and not what its rounded corners would.
    #[test]
    fn corners_lie_between_lattice_points() {
        let area = LatticeArea::new(&[vec![vec![[50, 50], [1049, 50], [1049, 1050], [50, 1050]]]], 100);
        let inside = (-2..14).flat_map(|x| (-2..14).map(move |y| [x, y])).filter(|point| area.holds(*point));
        assert_eq!(inside.count(), 100);
        assert_eq!(area.bounds(), Some([[0, 0], [11, 11]]));
    }

    /// The extremes of a lattice and of its parts.
    #[test]
    fn an_area_of_everything_holds_the_farthest_points() {
        let far = 1000 * POINTS[1];
        let area =
            LatticeArea::new(&[vec![vec![[-far - 1000, -far - 1000], [far, -far], [far, far], [-far, far]]]], 1000);
        for (point, expected) in [([i32::MAX; 2], true), ([i32::MIN; 2], true), ([i32::MIN, 0], false), ([0, 0], true)]
        {
            assert_eq!(area.holds(point), expected, "{point:?}");
        }
        assert!(area.holds_some_of([[i32::MIN; 2], [i32::MAX, i32::MIN], [0, i32::MAX]]));
    }

    /// A country around a village: the grid covers what points can reach.
    #[test]
    fn a_polygon_may_reach_far_beyond_the_lattice() {
        let far = FARTHEST_VERTEX;
        let area = LatticeArea::new(&[vec![vec![[-far, -far], [far, -far], [far, far]]]], 1);
        for (point, expected) in
            [([0, 0], true), ([0, 1], false), ([i32::MAX, i32::MAX - 1], true), ([i32::MIN; 2], true)]
        {
            assert_eq!(area.holds(point), expected, "{point:?}");
        }
    }

    /// Cells list few edges, however many vertices there are.
    #[test]
    fn cells_along_a_border_list_few_edges() {
        let distances: Vec<i64> = (0..100_000).map(|i| 70 + i * 7919 % 23).collect();
        let area = LatticeArea::new(&[vec![star([0, 0], 5_000_000, &distances)]], 1);
        let listed = area.lists.len() as u64;
        assert!(listed < (LISTED_PER_EDGE + 1) * 100_000, "{listed}");
        assert!(area.cells.iter().filter(|cell| **cell == INSIDE).count() > area.cells.len() / 4);
    }
}
