//! Heights along lines: where they cross the edges of the mesh, and at their own vertices.

use crate::common_lattice::nearest;
use crate::places::read_places;
use overlay::{Crossing, Met, Point, Rectangle, Segment, crossings};
use points::lines::{LineFeature, LineShape};
use rayon::prelude::*;
use std::fmt::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::{Error, Warnings, interrupt};
use terrain::{FinishedTerrain, Result};

/// The vertices of lines are moved to the nearest of so many places in a lattice step.
const PARTS_OF_STEP: i64 = 1 << 8;

/// Decimals beyond those of the lattice.
const MORE_DECIMALS: u32 = 3;

/// Columns and rows of the grid in which segments are looked for.
const CELLS: usize = 128;

/// What is wanted.
#[derive(Clone, Debug)]
pub struct ProfileRequest {
    /// The output directory of the terrain.
    pub terrain: PathBuf,
    /// The file of lines.
    pub lines: PathBuf,
    /// About how many bytes the file of lines may take.
    pub memory: u64,
}

/// The heights along the lines of a file.
pub struct Profile {
    lines: Vec<Line>,
    segments: Vec<LineSegment>,
    /// In the order of the segments, and along each.
    found: Found,
    lattice: FineLattice,
    /// Decimals of x, y and distances, and of heights.
    decimals: [usize; 2],
    /// What the user should know.
    pub warnings: Warnings,
}

/// A place on a line. Lengths are in source units.
#[derive(Clone, Copy, Debug)]
struct Row {
    distance: f64,
    place: [f64; 2],
    /// `None` outside of the terrain, and where the line leaves it.
    height: Option<f64>,
}

/// A line in source coordinates.
struct Line {
    name: String,
    vertices: Vec<[f64; 2]>,
}

/// A segment of a line on the fine lattice.
struct LineSegment {
    line: usize,
    /// The number of the vertex where it begins.
    vertex: usize,
    ends: Segment,
}

/// Computes heights along lines.
///
/// # Errors
/// Those of [`crate::diff::run`] about the terrain; [`Error::Input`] if the file of lines is bad, or has no lines; [`Error::Config`] if there
/// is no way from its CRS to that of the terrain.
pub fn run(request: &ProfileRequest) -> Result<Profile> {
    let terrain = FinishedTerrain::open(&request.terrain)?;
    let mut warnings = Warnings::default();
    let file = read_places(&request.lines, terrain.system(), request.memory, &mut warnings)?;
    let lines: Vec<Line> = file.features.iter().flat_map(lines_of).collect();
    if lines.is_empty() {
        return Err(Error::input(&request.lines, "has no lines").into());
    }
    let lattice = FineLattice::of(&terrain);
    let segments = lattice.segments(&lines, &request.lines)?;
    let run = Run { terrain: &terrain, segments: &segments, next: AtomicUsize::new(0) };
    let lanes = 0..rayon::current_num_threads();
    let found = lanes.into_par_iter().map(|_| run.read_tiles());
    let mut found = found.try_reduce(Vec::new, |mut all, more| {
        all.extend(more);
        Ok(all)
    })?;
    found.par_sort_unstable_by(|(a, first), (b, second)| {
        a.cmp(b).then_with(|| first.part.order(second.part)).then_with(|| first.met.cmp(&second.met))
    });
    let decimals = [terrain.lattice().resolution, terrain.lattice().resolution_z];
    let decimals = decimals.map(|step| (step.normalize().scale() + MORE_DECIMALS) as usize);
    Ok(Profile { lines, segments, found: merged(found), lattice, decimals, warnings })
}

/// Returns the lines of a feature, or the outlines of an area.
fn lines_of(feature: &LineFeature) -> Vec<Line> {
    let is_area = matches!(feature.shape, LineShape::Area(_));
    let name = feature.name.clone().unwrap_or_else(|| feature.number.to_string());
    let line = |outline: &Vec<[f64; 3]>| {
        let closing = outline.first().filter(|_| is_area);
        let vertices = outline.iter().chain(closing).map(|[x, y, _]| [*x, *y]).collect();
        Line { name: name.clone(), vertices }
    };
    feature.shape.outlines().iter().map(line).collect()
}

/// The lattice of a terrain with finer steps in x and y.
struct FineLattice {
    offset: [f64; 3],
    /// In x and y, and in z.
    steps: [f64; 2],
}

impl FineLattice {
    fn of(terrain: &FinishedTerrain) -> FineLattice {
        let lattice = terrain.lattice();
        let steps = [nearest(lattice.resolution) / PARTS_OF_STEP as f64, nearest(lattice.resolution_z)];
        FineLattice { offset: lattice.offset.map(nearest), steps }
    }

    fn point(point: [i32; 3]) -> Point {
        let [x, y, z] = point.map(i64::from);
        [x * PARTS_OF_STEP, y * PARTS_OF_STEP, z]
    }

    fn place(&self, [x, y, _]: [f64; 3]) -> [f64; 2] {
        [self.offset[0] + x * self.steps[0], self.offset[1] + y * self.steps[0]]
    }

    fn height(&self, [.., z]: [f64; 3]) -> f64 {
        self.offset[2] + z * self.steps[1]
    }

    fn segments(&self, lines: &[Line], path: &Path) -> sys::Result<Vec<LineSegment>> {
        let mut segments = Vec::new();
        for (number, line) in lines.iter().enumerate() {
            let place = |vertex: &[f64; 2]| {
                let steps = [0, 1].map(|axis| ((vertex[axis] - self.offset[axis]) / self.steps[0]).round());
                let is_near = steps.iter().all(|steps| steps.abs() <= overlay::REACH as f64);
                let far = || {
                    let what = format!(
                        "line {} lies far outside of the terrain: correct its coordinates or its CRS",
                        line.name
                    );
                    Error::input(path, what)
                };
                is_near.then(|| steps.map(|steps| steps as i64)).ok_or_else(far)
            };
            let places = line.vertices.iter().map(place).collect::<sys::Result<Vec<_>>>()?;
            let ends = places.windows(2).map(|pair| [pair[0], pair[1]]).enumerate();
            let ends = ends.filter(|(_, ends)| ends[0] != ends[1]);
            segments.extend(ends.map(|(vertex, ends)| LineSegment { line: number, vertex, ends }));
        }
        Ok(segments)
    }
}

/// What the threads share.
struct Run<'a> {
    terrain: &'a FinishedTerrain,
    segments: &'a [LineSegment],
    /// The number of the next tile.
    next: AtomicUsize,
}

/// The number of a segment, and what it meets.
type Found = Vec<(usize, Crossing)>;

impl Run<'_> {
    fn read_tiles(&self) -> sys::Result<Found> {
        let mut found = Vec::new();
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            if number >= self.terrain.count() {
                return Ok(found);
            }
            interrupt::check()?;
            for part in self.terrain.read_tile(number)? {
                let points: Vec<Point> = part.points.iter().map(|point| FineLattice::point(*point)).collect();
                let cells = SegmentCells::new(Rectangle::around(points.iter().map(|p| [p[0], p[1]])), self.segments);
                for triangle in &part.triangles {
                    let corners = triangle.map(|v| points[v as usize]);
                    cells.near(&corners, |segment| {
                        crossings(&corners, &self.segments[segment].ends, |crossing| found.push((segment, crossing)));
                    });
                }
            }
        }
    }
}

/// The segments in the cells of a grid over a tile.
struct SegmentCells {
    bounds: Rectangle,
    /// The side of a cell.
    side: i64,
    cells: Vec<Vec<usize>>,
}

impl SegmentCells {
    fn new(bounds: Rectangle, segments: &[LineSegment]) -> SegmentCells {
        let side = bounds.max[0].saturating_sub(bounds.min[0]).max(bounds.max[1].saturating_sub(bounds.min[1]));
        let mut cells = SegmentCells { bounds, side: side / CELLS as i64 + 1, cells: vec![Vec::new(); CELLS * CELLS] };
        for (number, segment) in segments.iter().enumerate() {
            if Rectangle::around(segment.ends).meets(&bounds) {
                cells.add(number, segment.ends);
            }
        }
        cells
    }

    fn place(&self, coordinate: i64, axis: usize) -> usize {
        let cell = (coordinate - self.bounds.min[axis]).div_euclid(self.side);
        usize::try_from(cell).unwrap_or(0).min(CELLS - 1)
    }

    /// Adds a segment to the cells that it may meet.
    fn add(&mut self, number: usize, ends: Segment) {
        // Rounding is made up for by some steps.
        const MARGIN: f64 = 2.0;
        let [low, high] = if ends[0][1] <= ends[1][1] { ends } else { [ends[1], ends[0]] };
        let [from, to] = [low, high].map(|end| end.map(|value| value as f64));
        for row in self.place(low[1], 1)..=self.place(high[1], 1) {
            let south = self.bounds.min[1] + row as i64 * self.side;
            let within = [south as f64 - MARGIN, (south + self.side) as f64 + MARGIN];
            let at = |y: f64| from[0] + (to[0] - from[0]) * ((y - from[1]) / (to[1] - from[1]));
            let xs = match to[1] > from[1] {
                true => within.map(|y| at(y.clamp(from[1], to[1]))),
                false => [from[0], to[0]],
            };
            let [west, east] = [xs[0].min(xs[1]) - MARGIN, xs[0].max(xs[1]) + MARGIN];
            for column in self.place(west as i64, 0)..=self.place(east as i64, 0) {
                self.cells[row * CELLS + column].push(number);
            }
        }
    }

    /// Calls `visit` with the segments that may meet a triangle, with some of them more than once.
    fn near(&self, corners: &[Point; 3], mut visit: impl FnMut(usize)) {
        let around = Rectangle::around(corners.map(|[x, y, _]| [x, y]));
        let range = |axis: usize| self.place(around.min[axis], axis)..=self.place(around.max[axis], axis);
        for row in range(1) {
            for column in range(0) {
                self.cells[row * CELLS + column].iter().for_each(|segment| visit(*segment));
            }
        }
    }
}

/// Joins what several triangles have found at one place.
fn merged(found: Found) -> Found {
    let mut all: Found = Vec::with_capacity(found.len());
    for (segment, crossing) in found {
        match all.last_mut() {
            Some((last, before)) if *last == segment && before.met == crossing.met => {
                before.is_covered_after |= crossing.is_covered_after;
            }
            _ => all.push((segment, crossing)),
        }
    }
    all
}

/// Calls `visit` with the name and the rows of each line, one after the other. What was found comes in the order of the segments.
fn each_line<E>(
    lines: &[Line],
    segments: &[LineSegment],
    found: &Found,
    lattice: &FineLattice,
    mut visit: impl FnMut(&str, &[Row]) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let mut of_segments = found.chunk_by(|a, b| a.0 == b.0).peekable();
    let mut segments = segments.iter().enumerate().peekable();
    let mut rows = Vec::new();
    for (line_number, line) in lines.iter().enumerate() {
        rows.clear();
        let mut start = 0.0;
        while let Some((number, segment)) = segments.next_if(|(_, segment)| segment.line == line_number) {
            let crossings = of_segments.next_if(|group| group[0].0 == number).unwrap_or_default();
            let [from, to] = [line.vertices[segment.vertex], line.vertices[segment.vertex + 1]];
            let length = ((to[0] - from[0]) * (to[0] - from[0]) + (to[1] - from[1]) * (to[1] - from[1])).sqrt();
            SegmentRows { ends: [from, to], start, length, lattice }.add(crossings, &mut rows);
            start += length;
        }
        visit(&line.name, &rows)?;
    }
    Ok(())
}

struct SegmentRows<'a> {
    ends: [[f64; 2]; 2],
    /// The distance at the start.
    start: f64,
    length: f64,
    lattice: &'a FineLattice,
}

impl SegmentRows<'_> {
    /// Adds the rows from the start of the segment to its end. The row of the start is there if a segment came before.
    fn add(&self, crossings: &[(usize, Crossing)], rows: &mut Vec<Row>) {
        let find = |met: Met| crossings.iter().map(|(_, crossing)| crossing).find(|crossing| crossing.met == met);
        let row = |at: usize, crossing: Option<&Crossing>| Row {
            distance: if at == 0 { self.start } else { self.start + self.length },
            place: self.ends[at],
            height: crossing.map(|crossing| self.lattice.height(crossing.place)),
        };
        let start = find(Met::Start);
        if rows.is_empty() {
            rows.push(row(0, start));
        }
        let is_inside = |crossing: &Crossing| crossing.part.is_inside();
        let at_start = crossings.iter().filter(|(_, crossing)| crossing.part.is_start());
        let mut is_covered = at_start.fold(false, |any, (_, crossing)| any | crossing.is_covered_after);
        self.end_stretch(is_covered, rows);
        for (_, crossing) in crossings.iter().filter(|(_, crossing)| is_inside(crossing)) {
            rows.push(Row {
                distance: self.start + crossing.part.value() * self.length,
                place: self.lattice.place(crossing.place),
                height: Some(self.lattice.height(crossing.place)),
            });
            is_covered = crossing.is_covered_after;
            self.end_stretch(is_covered, rows);
        }
        rows.push(row(1, find(Met::End)));
    }

    /// Where the line leaves the terrain, a row without a height follows the last one with a height.
    fn end_stretch(&self, is_covered: bool, rows: &mut Vec<Row>) {
        if let Some(last) = rows.last().copied().filter(|last| last.height.is_some() && !is_covered) {
            rows.push(Row { height: None, ..last });
        }
    }
}

impl Profile {
    /// Writes the profile as CSV, line by line: a title, and a row for each place.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv<E>(&self, mut out: impl FnMut(&str) -> std::result::Result<(), E>) -> std::result::Result<(), E> {
        const PIECE: usize = 1 << 16;
        let [plane, up] = self.decimals;
        let mut text = String::from("line,distance,x,y,z\n");
        each_line(&self.lines, &self.segments, &self.found, &self.lattice, |name, rows| {
            let name = CsvText(name).to_string();
            for Row { distance, place: [x, y], height } in rows {
                // Writing to a string cannot fail.
                let _ = write!(text, "{name},{distance:.plane$},{x:.plane$},{y:.plane$},");
                let _ = match height {
                    Some(height) => writeln!(text, "{height:.up$}"),
                    None => writeln!(text),
                };
                if text.len() >= PIECE {
                    out(&text)?;
                    text.clear();
                }
            }
            Ok(())
        })?;
        out(&text)
    }
}

/// A text as a field of CSV.
struct CsvText<'a>(&'a str);

impl fmt::Display for CsvText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.contains([',', '"', '\n', '\r']) {
            true => write!(f, "\"{}\"", self.0.replace('"', "\"\"")),
            false => f.write_str(self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_quoted_where_they_must_be() {
        assert_eq!(CsvText("a road").to_string(), "a road");
        assert_eq!(CsvText("a, \"b\"").to_string(), "\"a, \"\"b\"\"\"");
    }

    /// Two triangles of the plane z = x + y, and a gap between them and a third.
    fn rows_of(vertices: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let triangles: [[Point; 3]; 3] = [
            [[0, 0, 0], [10, 0, 10], [10, 10, 20]],
            [[0, 0, 0], [10, 10, 20], [0, 10, 10]],
            [[20, 0, 20], [30, 0, 30], [20, 10, 30]],
        ];
        let fine = |[x, y, z]: Point| [x * PARTS_OF_STEP, y * PARTS_OF_STEP, z];
        let lattice = FineLattice { offset: [0.0; 3], steps: [1.0 / PARTS_OF_STEP as f64, 1.0] };
        let lines = vec![Line { name: "a".into(), vertices: vertices.to_vec() }];
        let segments = lattice.segments(&lines, Path::new("a")).unwrap();
        let mut found = Vec::new();
        let points = triangles.as_flattened().iter().map(|point| fine(*point));
        let cells = SegmentCells::new(Rectangle::around(points.map(|[x, y, _]| [x, y])), &segments);
        for corners in triangles.map(|corners| corners.map(fine)) {
            cells.near(&corners, |segment| {
                crossings(&corners, &segments[segment].ends, |crossing| found.push((segment, crossing)))
            });
        }
        found.sort_by(|(a, first), (b, second)| {
            a.cmp(b).then(first.part.order(second.part)).then(first.met.cmp(&second.met))
        });
        let mut all = Vec::new();
        let visit = |_: &str, rows: &[Row]| {
            all.extend(rows.iter().map(|row| [row.distance, row.height.unwrap_or(f64::NAN)]));
            Ok::<(), ()>(())
        };
        each_line(&lines, &segments, &merged(found), &lattice, visit).unwrap();
        all
    }

    fn text(rows: &[[f64; 2]]) -> String {
        rows.iter().map(|[distance, z]| format!("{distance} {z}")).collect::<Vec<_>>().join("; ")
    }

    #[test]
    fn rows_are_at_vertices_and_edges_and_gaps_are_breaks() {
        let rows = rows_of(&[[2.0, 5.0], [24.0, 5.0]]);
        assert_eq!(text(&rows), "0 7; 3 10; 8 15; 8 NaN; 18 25; 22 29");
        let rows = rows_of(&[[-4.0, 5.0], [5.0, 5.0], [5.0, 20.0]]);
        assert_eq!(text(&rows), "0 NaN; 4 5; 9 10; 14 15; 14 NaN; 24 NaN");
        // Along an edge, and out at its end.
        let rows = rows_of(&[[0.0, 0.0], [15.0, 0.0]]);
        assert_eq!(text(&rows), "0 0; 10 10; 10 NaN; 15 NaN");
        assert_eq!(text(&rows_of(&[[40.0, 0.0], [41.0, 0.0]])), "0 NaN; 1 NaN");
    }
}
