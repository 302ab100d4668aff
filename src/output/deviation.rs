//! How far a simplified terrain is from the one that it was made of, measured along the vertical: the greatest value over all of
//! the ground, not a sample.
//!
//! Both are linear over every triangle, so their difference is linear over every piece that the two sets of edges together cut the
//! ground into, and greatest at a corner of such a piece: at a vertex of the fine mesh (those of the coarse one are among them), or
//! where a fine and a coarse edge cross. `Fans` finds the crossings by walking along every coarse edge through the fine mesh,
//! `Sieve` finds the fine vertices in every coarse triangle.

use crate::geometry::Site;
use crate::geometry::predicates::orient2d;

/// Steps of a walk that an edge may take on average; a mesh that needs more has nothing but slivers.
const STEPS_PER_EDGE: u64 = 64;

/// The greatest vertical distance between the terrains `fine` and `coarse`, triangles of the same `positions` (lattice x, y, z),
/// in steps of z; no smaller than the true one. Both must cover the same ground once, with counterclockwise triangles.
pub fn deviation(positions: &[[i32; 3]], fine: &[[u32; 3]], coarse: &[[u32; 3]]) -> f64 {
    let at_crossings = Fans::new(positions, fine).crossings(coarse);
    let inside = at_crossings.map(|crossings| crossings.max(Sieve::new(positions, 1).inside(coarse)));
    // Rounding loses some 2^-50 of a height.
    let lost = 1e-9;
    inside.map_or_else(|| height_range(positions), |found| if found > 0.0 { found + lost } else { 0.0 })
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
        triangles.iter().flatten().for_each(|&v| starts[v as usize] += 1);
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

    /// The greatest distance where an edge of `coarse` crosses one of this mesh; `None` where that cannot be told.
    fn crossings(&self, coarse: &[[u32; 3]]) -> Option<f64> {
        let mut steps = STEPS_PER_EDGE * (3 * coarse.len() as u64 + 1000);
        let mut greatest = 0.0f64;
        for &[a, b, c] in coarse {
            // The other triangle of an edge has it the other way round; the outline is the same in both meshes.
            for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from < to) {
                greatest = greatest.max(self.along(from, to, &mut steps)?);
            }
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

/// The vertices of the fine mesh, sorted into the cells of a grid, row by row.
pub(super) struct Sieve<'a> {
    positions: &'a [[i32; 3]],
    low: [f64; 2],
    /// Cells in a lattice step.
    scale: [f64; 2],
    columns: usize,
    rows: usize,
    /// Where each cell's vertices start in `sorted`, and their end.
    starts: Vec<u32>,
    sorted: Vec<[i32; 3]>,
    /// Their numbers.
    numbers: Vec<u32>,
}

impl<'a> Sieve<'a> {
    /// Of one vertex of `every`.
    pub(super) fn new(positions: &'a [[i32; 3]], every: usize) -> Sieve<'a> {
        let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let [low, high] = positions.iter().fold(none, |[low, high], p| {
            let p = [p[0] as f64, p[1] as f64];
            [[0, 1].map(|k| low[k].min(p[k])), [0, 1].map(|k| high[k].max(p[k]))]
        });
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1.0));
        let cells = (positions.len() / every + 1) as f64;
        let columns = (cells * size[0] / size[1]).sqrt().ceil().clamp(1.0, cells);
        let rows = (cells / columns).ceil();
        let scale = [columns / (size[0] + 1.0), rows / (size[1] + 1.0)];
        let (columns, rows) = (columns as usize, rows as usize);
        let (starts, sorted, numbers) = (vec![0; columns * rows + 1], Vec::new(), Vec::new());
        let mut sieve = Sieve { positions, low, scale, columns, rows, starts, sorted, numbers };
        sieve.sort(every);
        sieve
    }

    fn sort(&mut self, every: usize) {
        let cells: Vec<u32> = self.positions.iter().step_by(every).map(|p| self.cell(p)).collect();
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

    fn cell(&self, p: &[i32; 3]) -> u32 {
        (self.row(p[1] as f64) * self.columns + self.column(p[0] as f64)) as u32
    }

    fn column(&self, x: f64) -> usize {
        (((x - self.low[0]) * self.scale[0]) as usize).min(self.columns - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.low[1]) * self.scale[1]) as usize).min(self.rows - 1)
    }

    /// The greatest distance between a vertex and the triangle of `coarse` over it.
    fn inside(&self, coarse: &[[u32; 3]]) -> f64 {
        coarse.iter().map(|t| self.inside_one(t.map(|v| self.positions[v as usize])).0).fold(0.0, f64::max)
    }

    /// For every triangle of `coarse` that is off a vertex the distance (its bits) and number of the one it is furthest off.
    pub(super) fn furthest(&self, coarse: &[[u32; 3]]) -> impl Iterator<Item = (u64, u32)> {
        let found = coarse.iter().map(|t| self.inside_one(t.map(|v| self.positions[v as usize])));
        found.filter(|(distance, _)| *distance > 0.0).map(|(distance, v)| (distance.to_bits(), v))
    }

    /// The greatest distance of a triangle, and the number of the vertex where it is.
    fn inside_one(&self, corners: [[i32; 3]; 3]) -> (f64, u32) {
        let ys = corners.map(|p| p[1]);
        let (first, last) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        let mut greatest = (0.0f64, 0);
        for row in self.row(first as f64)..=self.row(last as f64) {
            let [west, east] = self.span(&corners, row);
            let start = self.starts[row * self.columns + self.column(west)];
            let end = self.starts[row * self.columns + self.column(east) + 1];
            for at in start as usize..end as usize {
                let distance = apart(&corners, self.sorted[at]);
                if distance > greatest.0 {
                    greatest = (distance, self.numbers[at]);
                }
            }
        }
        greatest
    }

    /// Between which x the triangle lies in `row`, with a cell to spare for rounding.
    fn span(&self, corners: &[[i32; 3]; 3], row: usize) -> [f64; 2] {
        let y_of = |row: f64| self.low[1] + row / self.scale[1];
        let (south, north) = (y_of(row as f64 - 0.01), y_of(row as f64 + 1.01));
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        for k in 0..3 {
            let [a, b] = [corners[k], corners[(k + 1) % 3]].map(|p| [p[0] as f64, p[1] as f64]);
            let [a, b] = if a[1] <= b[1] { [a, b] } else { [b, a] };
            if a[1] > north || b[1] < south {
                continue;
            }
            let x_at = |y: f64| if a[1] == b[1] { a[0] } else { a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])) };
            let ends = [x_at(south.max(a[1])), if b[1] <= north { b[0] } else { x_at(north) }];
            span = [span[0].min(ends[0]).min(ends[1]), span[1].max(ends[0]).max(ends[1])];
        }
        let spare = 0.01 / self.scale[0];
        [span[0] - spare, span[1] + spare]
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
