//! How far a simplified terrain is from the one that it was made of, measured along the vertical: the greatest value over all of
//! the ground, not a sample.
//!
//! Both are linear over every triangle, so their difference is linear over every piece that the two sets of edges together cut the
//! ground into, and greatest at a corner of such a piece: at a vertex of the fine mesh (those of the coarse one are among them), or
//! where a fine and a coarse edge cross. `Fans` finds the crossings by walking along a coarse edge through the fine mesh, `Sieve`
//! finds the fine vertices in a coarse triangle; `Relief` tells beforehand how far off a coarse triangle can be at the most, so that
//! few of them have to be looked at.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;
use crate::output::lod::cells::Cells;
use crate::output::lod::height_bounds::Relief;

/// Steps of a walk that an edge may take on average; a mesh that needs more has nothing but slivers.
const STEPS_PER_EDGE: u64 = 64;
/// So many triangles are looked at in the order of how far off they can be.
const FIRST: usize = 256;

/// The greatest vertical distance between the terrains `fine` and `coarse`, triangles of the same `positions` (lattice x, y, z),
/// in steps of z; no smaller than the true one. Both must cover the same ground once, with counterclockwise triangles.
pub fn deviation(positions: &[[i32; 3]], fine: &[[u32; 3]], coarse: &[[u32; 3]]) -> f64 {
    let relief = Relief::new(positions, fine);
    let mut bounds: Vec<(u64, u32)> = coarse.iter().map(|triangle| relief.bound(triangle)).zip(0..).collect();
    // What can be furthest off comes first, so that most of the others need not be looked at.
    let first = FIRST.min(bounds.len());
    if first < bounds.len() {
        bounds.select_nth_unstable_by(first, |a, b| b.cmp(a));
    }
    bounds[..first].sort_unstable_by(|a, b| b.cmp(a));
    let (fans, sieve) = (Fans::new(positions, fine), Sieve::new(positions, 1));
    let mut steps = STEPS_PER_EDGE * (3 * coarse.len() as u64 + 1000);
    let mut greatest = 0.0f64;
    for (bound, triangle) in bounds {
        if bound as f64 > greatest {
            let triangle = &coarse[triangle as usize];
            let Some(at_crossings) = fans.crossings(triangle, &mut steps) else { return height_range(positions) };
            greatest = greatest.max(at_crossings).max(sieve.inside_one(triangle).0);
        }
    }
    // Rounding loses some 2^-50 of a height.
    let lost = 1e-9;
    if greatest > 0.0 { greatest + lost } else { 0.0 }
}

/// No two terrains over the same vertices are further apart.
fn height_range(positions: &[[i32; 3]]) -> f64 {
    let (low, high) = positions.iter().fold((i32::MAX, i32::MIN), |(l, h), p| (l.min(p[2]), h.max(p[2])));
    if low > high { 0.0 } else { high as f64 - low as f64 }
}

fn plane(point: [i32; 3]) -> Site {
    [point[0], point[1]]
}

/// For every vertex the edges opposite it.
struct Fans<'a> {
    positions: &'a [[i32; 3]],
    /// Where each vertex's edges start in `opposite`, and their end.
    starts: Vec<u32>,
    /// The other two corners of a triangle, in its sense of rotation.
    opposite: Vec<[u32; 2]>,
}

/// Where a walk stands.
enum At {
    /// At a vertex.
    Vertex(u32),
    /// On the edge with these ends, the first to the right of the way.
    Edge(u32, u32),
}

impl<'a> Fans<'a> {
    fn new(positions: &'a [[i32; 3]], triangles: &[[u32; 3]]) -> Fans<'a> {
        let mut starts = vec![0u32; positions.len() + 1];
        triangles.as_flattened().iter().for_each(|&v| starts[v as usize] += 1);
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let mut opposite = vec![[0; 2]; triangles.len() * 3];
        for &[a, b, c] in triangles.iter().rev() {
            for (v, edge) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let at = &mut starts[v as usize];
                *at -= 1;
                opposite[*at as usize] = edge;
            }
        }
        Fans { positions, starts, opposite }
    }

    fn around(&self, v: u32) -> &[[u32; 2]] {
        &self.opposite[self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize]
    }

    /// The third corner of the triangle with the directed edge ab.
    fn third(&self, a: u32, b: u32) -> Option<u32> {
        self.around(a).iter().find(|edge| edge[0] == b).map(|edge| edge[1])
    }

    /// The greatest distance where an edge of a coarse triangle crosses one of this mesh; `None` where that cannot be told.
    fn crossings(&self, &[a, b, c]: &[u32; 3], steps: &mut u64) -> Option<f64> {
        let mut greatest = 0.0f64;
        // The other triangle of an edge has it the other way round; the outline is the same in both meshes.
        for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from < to) {
            greatest = greatest.max(self.along(from, to, steps)?);
        }
        Some(greatest)
    }

    /// The greatest distance along one coarse edge.
    fn along(&self, from: u32, to: u32, steps: &mut u64) -> Option<f64> {
        let line = Line::new(self.positions[from as usize], self.positions[to as usize]);
        let mut greatest = 0.0f64;
        let mut at = At::Vertex(from);
        loop {
            *steps = steps.checked_sub(1)?;
            at = match at {
                At::Vertex(v) if v == to => return Some(greatest),
                At::Vertex(v) => self.leave(v, to, &line)?,
                At::Edge(right, left) => {
                    let [r, l] = [right, left].map(|v| self.positions[v as usize]);
                    greatest = greatest.max(line.apart_from_edge(r, l));
                    let next = self.third(left, right)?;
                    self.beyond(right, left, next, &line)
                }
            };
            if let At::Vertex(v) = at {
                greatest = greatest.max(line.apart_from_vertex(self.positions[v as usize]));
            }
        }
    }

    /// From vertex `v` on towards `to`.
    fn leave(&self, v: u32, to: u32, line: &Line) -> Option<At> {
        let here = self.positions[v as usize];
        for &[right, left] in self.around(v) {
            if right == to || left == to {
                return Some(At::Vertex(to));
            }
            let [r, l] = [right, left].map(|corner| self.positions[corner as usize]);
            let (of_right, of_left) = (line.side(r), line.side(l));
            if of_right < 0 && of_left > 0 {
                return Some(At::Edge(right, left));
            }
            if let Some(corner) = [(right, r, of_right), (left, l, of_left)]
                .into_iter()
                .find_map(|(corner, p, side)| (side == 0 && line.leads(here, p)).then_some(corner))
            {
                return Some(At::Vertex(corner));
            }
        }
        None
    }

    /// From the edge between `right` and `left` into the triangle whose third corner is `next`.
    fn beyond(&self, right: u32, left: u32, next: u32, line: &Line) -> At {
        match line.side(self.positions[next as usize]) {
            0 => At::Vertex(next),
            side if side > 0 => At::Edge(right, next),
            _ => At::Edge(next, left),
        }
    }
}

/// A coarse edge.
struct Line {
    from: [i32; 3],
    to: [i32; 3],
}

impl Line {
    fn new(from: [i32; 3], to: [i32; 3]) -> Line {
        Line { from, to }
    }

    /// Positive to the left of the line.
    fn side(&self, point: [i32; 3]) -> i64 {
        orient2d(plane(self.from), plane(self.to), plane(point))
    }

    /// Whether `point`, on the line, lies ahead of `here`.
    fn leads(&self, here: [i32; 3], point: [i32; 3]) -> bool {
        (0..2).any(|k| {
            (self.to[k] as i64 - self.from[k] as i64).signum() * (point[k] as i64 - here[k] as i64).signum() > 0
        })
    }

    /// The line's height above or below a vertex on it.
    fn apart_from_vertex(&self, point: [i32; 3]) -> f64 {
        let difference = |k: usize, p: [i32; 3]| p[k] as f64 - self.from[k] as f64;
        let longer = if difference(0, self.to).abs() >= difference(1, self.to).abs() { 0 } else { 1 };
        let share = difference(longer, point) / difference(longer, self.to);
        (difference(2, self.to) * share - difference(2, point)).abs()
    }

    /// The distance between the line and the edge that it crosses, where they cross.
    fn apart_from_edge(&self, right: [i32; 3], left: [i32; 3]) -> f64 {
        let (to_right, to_left) = (-self.side(right) as f64, self.side(left) as f64);
        let height = |p: [i32; 3]| p[2] as f64 - self.from[2] as f64;
        let of_edge = (height(right) * to_left + height(left) * to_right) / (to_left + to_right);
        let start = orient2d(plane(right), plane(left), plane(self.from)) as f64;
        let end = -orient2d(plane(right), plane(left), plane(self.to)) as f64;
        let of_line = height(self.to) * (start / (start + end));
        (of_edge - of_line).abs()
    }
}

/// The vertices of the fine mesh, sorted into cells.
pub(crate) struct Sieve<'a> {
    positions: &'a [[i32; 3]],
    cells: Cells,
    /// Where each cell's vertices start in `sorted`, and their end.
    starts: Vec<u32>,
    sorted: Vec<[i32; 3]>,
    /// Their numbers.
    numbers: Vec<u32>,
}

impl<'a> Sieve<'a> {
    /// Of one vertex of `every`.
    pub(crate) fn new(positions: &'a [[i32; 3]], every: usize) -> Sieve<'a> {
        let cells = Cells::new(positions, positions.len() / every + 1);
        let (starts, sorted, numbers) = (vec![0; cells.count() + 1], Vec::new(), Vec::new());
        let mut sieve = Sieve { positions, cells, starts, sorted, numbers };
        sieve.sort(every);
        sieve
    }

    fn sort(&mut self, every: usize) {
        let cells: Vec<u32> = self.positions.iter().step_by(every).map(|p| self.cells.of(p)).collect();
        cells.iter().for_each(|&cell| self.starts[cell as usize] += 1);
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.sorted = vec![[0; 3]; cells.len()];
        self.numbers = vec![0; cells.len()];
        for (i, &cell) in cells.iter().enumerate().rev() {
            let v = i * every;
            let at = &mut self.starts[cell as usize];
            *at -= 1;
            (self.sorted[*at as usize], self.numbers[*at as usize]) = (self.positions[v], v as u32);
        }
    }

    /// For every triangle of `coarse` that is off a vertex the distance (its bits) and number of the one it is furthest off.
    pub(crate) fn furthest(&self, coarse: &[[u32; 3]]) -> impl Iterator<Item = (u64, u32)> {
        let found = coarse.iter().map(|triangle| self.inside_one(triangle));
        found.filter(|(distance, _)| *distance > 0.0).map(|(distance, v)| (distance.to_bits(), v))
    }

    /// The greatest distance of a triangle, and the number of the vertex where it is.
    fn inside_one(&self, triangle: &[u32; 3]) -> (f64, u32) {
        let corners = triangle.map(|v| self.positions[v as usize]);
        let ys = corners.map(|p| p[1]);
        let (first, last) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        let mut greatest = (0.0f64, 0);
        for row in self.cells.row(first as f64)..=self.cells.row(last as f64) {
            let [west, east] = self.cells.span(&corners, row);
            let [start, end] = [self.cells.at(row, west), self.cells.at(row, east) + 1].map(|cell| self.starts[cell]);
            for at in start as usize..end as usize {
                let distance = apart(&corners, self.sorted[at]);
                if distance > greatest.0 {
                    greatest = (distance, self.numbers[at]);
                }
            }
        }
        greatest
    }
}

/// The distance between `p` and the counterclockwise triangle over it; 0 outside.
fn apart(corners: &[[i32; 3]; 3], p: [i32; 3]) -> f64 {
    let [a, b, c] = *corners;
    let weight = |from, to| orient2d(plane(from), plane(to), plane(p));
    let of_a = weight(b, c);
    if of_a < 0 {
        return 0.0;
    }
    let of_b = weight(c, a);
    if of_b < 0 {
        return 0.0;
    }
    let weights = [of_a, of_b, weight(a, b)];
    if weights[2] < 0 {
        return 0.0;
    }
    let total: f64 = weights.iter().map(|&w| w as f64).sum();
    let height = |k: usize| weights[k] as f64 * (corners[k][2] as f64 - p[2] as f64);
    ((height(0) + height(1) + height(2)) / total).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::half_edge::HalfEdgeMesh;
    use crate::triangulation::canonical;
    use proptest::prelude::*;

    fn triangulation(positions: &[[i32; 3]], kept: &[u32]) -> HalfEdgeMesh {
        let sites: Vec<Site> = kept.iter().map(|&v| plane(positions[v as usize])).collect();
        canonical(&sites).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Mostly flat, with a few high places, so that most triangles need not be looked at.
        #[test]
        fn what_is_not_looked_at_is_no_further_off(
            mut positions in prop::collection::vec((0..3_000, 0..3_000, 0..20i32), 400..3_000),
            peaks in prop::collection::vec((0..400usize, 20..5_000), 0..6),
            every in 3..9usize,
        ) {
            peaks.iter().for_each(|&(at, height)| positions[at].2 = height);
            let mut positions: Vec<[i32; 3]> = positions.into_iter().map(|(x, y, z)| [x, y, z]).collect();
            positions.sort_unstable();
            positions.dedup_by_key(|p| plane(*p));
            let all: Vec<u32> = (0..positions.len() as u32).collect();
            let fine = triangulation(&positions, &all);
            let mut kept = vec![false; positions.len()];
            kept.iter_mut().step_by(every).for_each(|kept| *kept = true);
            fine.hull().for_each(|h| kept[fine.origin(h).get()] = true);
            let kept: Vec<u32> = all.into_iter().filter(|&v| kept[v as usize]).collect();
            let coarse = triangulation(&positions, &kept).triangles;
            let coarse: Vec<[u32; 3]> = coarse.iter().map(|t| t.map(|v| kept[v.get()])).collect();

            let (fans, sieve) = (Fans::new(&positions, fine.corners()), Sieve::new(&positions, 1));
            let mut steps = u64::MAX;
            let furthest = coarse.iter().map(|t| fans.crossings(t, &mut steps).unwrap().max(sieve.inside_one(t).0));
            let furthest = furthest.fold(0.0, f64::max);
            let found = deviation(&positions, fine.corners(), &coarse);
            prop_assert!(found == 0.0 && furthest == 0.0 || found == furthest + 1e-9, "{} and {}", found, furthest);
        }
    }
}
