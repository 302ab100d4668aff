//! Lines level by level, as rows of their table and as a drawing has them.

use crate::publish::contours::check::TerrainLevels;
use crate::publish::contours::drawing::drawn;
use crate::publish::contours::waiting_chains::{FinishedChains, POINT};
use contours::{JoinedLines, Line, join, line_points};
use rayon::prelude::*;
use std::ops::Range;
use sys::{Result, interrupt};
use tiles::contour_options::ContourHeight;
use tiles::geopackage::lines::{LineAttributes, LineRow};

/// About how many points of lines are in memory at one time, if no line has more. As many more are being written.
const POINTS_AT_ONCE: u64 = 1 << 19;

/// About how many of them a thread reads at one time.
const POINTS_PER_THREAD: u64 = 1 << 16;

/// The most points of a line. A longer one is cut: SQLite holds no row of a gigabyte.
const LONGEST_LINE: usize = 1 << 22;

/// A line as files have it.
pub(super) struct WrittenLine {
    /// As a row of its table.
    pub(super) row: LineRow,
    /// As the bytes of a drawing; empty without one.
    pub(super) drawn: Vec<u8>,
}

/// Makes the rows of all lines, in their order.
pub(super) struct LineProducer<'a> {
    chains: &'a mut FinishedChains,
    levels: &'a TerrainLevels,
    /// The number of the system of coordinates.
    system: i32,
    /// Whether lines are drawn too.
    has_drawing: bool,
    /// The number of the next level.
    next_level: usize,
    /// The lines of the level before, and the number of the first that is not made yet.
    lines: JoinedLines,
    next_line: usize,
}

impl<'a> LineProducer<'a> {
    /// Returns what makes the lines of `chains`.
    pub(super) fn new(
        chains: &'a mut FinishedChains,
        levels: &'a TerrainLevels,
        system: i32,
        has_drawing: bool,
    ) -> LineProducer<'a> {
        LineProducer { chains, levels, system, has_drawing, next_level: 0, lines: JoinedLines::default(), next_line: 0 }
    }

    /// Returns the next rows; `None` after the last level. There may be none of a level.
    ///
    /// # Errors
    /// [`sys::Error::Io`] on the chains, [`sys::Error::Interrupted`].
    pub(super) fn next(&mut self) -> Result<Option<Vec<WrittenLine>>> {
        interrupt::check()?;
        if self.next_line == self.lines.lines.len() {
            let Ok(level) = u32::try_from(self.next_level) else { return Ok(None) };
            if self.next_level == self.levels.heights.len() {
                return Ok(None);
            }
            self.lines = join(&self.chains.chains_of(level)?, POINT);
            self.next_level += 1;
            self.next_line = 0;
        }
        let window = self.lines_from(self.next_line, self.lines.lines.len(), POINTS_AT_ONCE);
        self.next_line = window.end;
        let mut shares = Vec::new();
        let mut from = window.start;
        while from < window.end {
            let share = self.lines_from(from, window.end, POINTS_PER_THREAD);
            from = share.end;
            shares.push(share);
        }
        let height = self.levels.heights.get(self.next_level.saturating_sub(1)).copied();
        let rows = |share: Range<usize>| height.map_or(Ok(Vec::new()), |height| self.rows(share, height));
        let rows: Result<Vec<Vec<WrittenLine>>> = shares.into_par_iter().with_max_len(1).map(rows).collect();
        Ok(Some(rows?.into_iter().flatten().collect()))
    }

    /// Returns the numbers of lines from number `from` on, before number `to`, that have about so many points together; at least one.
    fn lines_from(&self, from: usize, to: usize, most: u64) -> Range<usize> {
        let mut points = 0;
        let lines = self.lines.lines[from..to].iter().take_while(|line| {
            let is_taken = points < most;
            points += self.points(line);
            is_taken
        });
        from..from + lines.count()
    }

    fn points(&self, line: &Line) -> u64 {
        self.lines.pieces_of(line).iter().map(|piece| u64::from(piece.points)).sum()
    }

    fn rows(&self, share: Range<usize>, height: ContourHeight) -> Result<Vec<WrittenLine>> {
        interrupt::check()?;
        let lines = &self.lines.lines[share];
        let pieces: Vec<_> = lines.iter().flat_map(|line| self.lines.pieces_of(line)).copied().collect();
        let points = self.chains.points_of(&pieces)?;
        let (mut left, mut rows) = (&points[..], Vec::with_capacity(lines.len()));
        for line in lines {
            let (own, rest) = left.split_at(self.points(line) as usize);
            left = rest;
            if let Some(points) = line_points(own.to_vec(), line.is_closed) {
                self.add_rows(&mut rows, &points, line.is_closed, height);
            }
        }
        Ok(rows)
    }

    /// Adds a line; several if it is too long for one. Each begins where the one before ends.
    fn add_rows(&self, rows: &mut Vec<WrittenLine>, points: &[[f64; 2]], is_closed: bool, height: ContourHeight) {
        let is_closed = is_closed && points.len() <= LONGEST_LINE;
        let attributes = LineAttributes { height: height.number, is_index: height.is_index, is_closed };
        let line = |points: &[[f64; 2]]| WrittenLine {
            row: LineRow::new(points, attributes, self.system),
            drawn: if self.has_drawing { drawn(points, is_closed, height) } else { Vec::new() },
        };
        let mut left = points;
        while left.len() > LONGEST_LINE {
            rows.push(line(&left[..LONGEST_LINE]));
            left = &left[LONGEST_LINE - 1..];
        }
        rows.push(line(left));
    }
}
