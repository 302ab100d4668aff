//! The rows of the table.

use super::line_segments::{FineLattice, Line, LineSegment};
use overlay::{Crossing, Met};
use std::fmt::{self, Write};
use sys::Result;

/// A place on a line. Lengths are in source units.
#[derive(Clone, Copy, Debug)]
struct Row {
    distance: f64,
    place: [f64; 2],
    /// `None` outside of the terrain, and where the line leaves it.
    height: Option<f64>,
}

/// Writes rows as CSV, segment by segment.
pub(super) struct TableWriter<'a, O> {
    lines: &'a [Line],
    lattice: &'a FineLattice,
    /// Decimals of x, y and distances, and of heights.
    decimals: [usize; 2],
    out: O,
    text: String,
    /// The number of the line of the last segment.
    line: Option<usize>,
    /// The distance at the end of the last segment.
    distance: f64,
    /// The last row of the line, which is written already.
    last: Vec<Row>,
}

impl<'a, O: FnMut(&str) -> Result<()>> TableWriter<'a, O> {
    pub(super) fn new(lines: &'a [Line], lattice: &'a FineLattice, decimals: [usize; 2], out: O) -> TableWriter<'a, O> {
        let text = String::from("line,distance,x,y,z\n");
        TableWriter { lines, lattice, decimals, out, text, line: None, distance: 0.0, last: Vec::new() }
    }

    /// Writes the rows of the next segment, which meets these crossings.
    ///
    /// # Errors
    /// Those of the output.
    pub(super) fn add(&mut self, segment: &LineSegment, crossings: &[(usize, Crossing)]) -> Result<()> {
        if self.line.replace(segment.line) != Some(segment.line) {
            (self.distance, self.last) = (0.0, Vec::new());
        }
        let line = &self.lines[segment.line];
        let [from, to] = [line.vertices[segment.vertex], line.vertices[segment.vertex + 1]];
        let length = ((to[0] - from[0]) * (to[0] - from[0]) + (to[1] - from[1]) * (to[1] - from[1])).sqrt();
        let mut rows = std::mem::take(&mut self.last);
        let written = rows.len();
        SegmentRows { ends: [from, to], start: self.distance, length, lattice: self.lattice }.add(crossings, &mut rows);
        self.write(&line.name, &rows[written..])?;
        self.distance += length;
        self.last.extend(rows.last());
        Ok(())
    }

    fn write(&mut self, name: &str, rows: &[Row]) -> Result<()> {
        const PIECE: usize = 1 << 16;
        let [plane, up] = self.decimals;
        let name = CsvText(name).to_string();
        for Row { distance, place: [x, y], height } in rows {
            // Writing to a string cannot fail.
            let _ = write!(self.text, "{name},{distance:.plane$},{x:.plane$},{y:.plane$},");
            let _ = match height {
                Some(height) => writeln!(self.text, "{height:.up$}"),
                None => writeln!(self.text),
            };
            if self.text.len() >= PIECE {
                (self.out)(&self.text)?;
                self.text.clear();
            }
        }
        Ok(())
    }

    /// Writes what is left.
    ///
    /// # Errors
    /// Those of the output.
    pub(super) fn finish(mut self) -> Result<()> {
        (self.out)(&self.text)
    }
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
    use super::super::line_segments::PARTS_OF_STEP;
    use super::super::search::Search;
    use super::*;
    use std::path::Path;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use terrain::LatticePart;

    #[test]
    fn names_are_quoted_where_they_must_be() {
        assert_eq!(CsvText("a road").to_string(), "a road");
        assert_eq!(CsvText("a, \"b\"").to_string(), "\"a, \"\"b\"\"\"");
    }

    /// Two triangles of the plane z = x + y in one tile, and behind a gap a third in another.
    fn tile(number: usize) -> Vec<LatticePart> {
        let part = match number {
            0 => LatticePart {
                points: vec![[0, 0, 0], [10, 0, 10], [10, 10, 20], [0, 10, 10]],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
            },
            _ => LatticePart { points: vec![[20, 0, 20], [30, 0, 30], [20, 10, 30]], triangles: vec![[0, 1, 2]] },
        };
        vec![part]
    }

    /// Returns distances and heights along lines, with this many crossings in memory, and how many tiles were read.
    fn rows_with(most: usize, lines: &[&[[f64; 2]]]) -> (String, usize) {
        let lattice = FineLattice { offset: [0.0; 3], steps: [1.0 / PARTS_OF_STEP as f64, 1.0] };
        let lines: Vec<Line> = lines.iter().map(|line| Line { name: "a".into(), vertices: line.to_vec() }).collect();
        let segments = lattice.segments(&lines, Path::new("a")).unwrap();
        let tiles_read = AtomicUsize::new(0);
        let read = |number| {
            tiles_read.fetch_add(1, Ordering::Relaxed);
            Ok(tile(number))
        };
        let mut text = String::new();
        let mut table = TableWriter::new(&lines, &lattice, [0, 0], |piece: &str| {
            text.push_str(piece);
            Ok(())
        });
        let search = Search::new(2, &read, &segments);
        search.each(most, |segment, crossings| table.add(segment, crossings)).unwrap();
        table.finish().unwrap();
        let columns = |row: &str| {
            let values: Vec<&str> = row.split(',').collect();
            format!("{} {}", values[1], if values[4].is_empty() { "none" } else { values[4] })
        };
        (text.lines().skip(1).map(columns).collect::<Vec<_>>().join("; "), tiles_read.into_inner())
    }

    fn rows_of(vertices: &[[f64; 2]]) -> String {
        rows_with(usize::MAX, &[vertices]).0
    }

    #[test]
    fn less_memory_gives_the_same_rows() {
        let zigzag: Vec<[f64; 2]> =
            (0..40).map(|k| [if k % 2 == 0 { -1.0 } else { 31.0 }, f64::from(k) / 5.0]).collect();
        let lines: [&[[f64; 2]]; 3] = [&zigzag, &[[1.0, 1.0], [1.0, 2.0], [3.0, 9.0]], &[[25.0, 1.0], [25.0, 2.0]]];
        let (all, once) = rows_with(usize::MAX, &lines);
        assert_eq!(once, 2);
        for most in [1, 7, 50] {
            let (rows, tiles_read) = rows_with(most, &lines);
            assert_eq!(rows, all);
            assert!(tiles_read > once, "{most}: all was done in one run");
        }
    }

    #[test]
    fn rows_are_at_vertices_and_edges_and_gaps_are_breaks() {
        let rows = rows_of(&[[2.0, 5.0], [24.0, 5.0]]);
        assert_eq!(rows, "0 7; 3 10; 8 15; 8 none; 18 25; 22 29");
        let rows = rows_of(&[[-4.0, 5.0], [5.0, 5.0], [5.0, 20.0]]);
        assert_eq!(rows, "0 none; 4 5; 9 10; 14 15; 14 none; 24 none");
        // Along an edge, and out at its end.
        assert_eq!(rows_of(&[[0.0, 0.0], [15.0, 0.0]]), "0 0; 10 10; 10 none; 15 none");
        assert_eq!(rows_of(&[[40.0, 0.0], [41.0, 0.0]]), "0 none; 1 none");
    }
}
