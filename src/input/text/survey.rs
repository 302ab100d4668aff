//! The first pass over a text: what its rows hold.

use std::ops::Range;

use crate::Result;
use crate::input::file::random_access::RandomAccessFile;
use crate::input::text::columns::Columns;
use crate::input::text::granularity::Granularity;
use crate::input::text::lines::{TextLine, for_each_line};
use crate::input::text::number::Number;
use crate::input::text::row::RowReader;

/// What the first pass finds in a chunk, or in all chunks.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    /// The number of lines.
    pub(crate) lines: u64,
    /// The number of rows, including malformed rows.
    pub(crate) rows: u64,
    /// The least x, y, z; infinite as long as there is no row that can be read.
    pub(crate) min: [f64; 3],
    /// The greatest x, y, z; likewise.
    pub(crate) max: [f64; 3],
    /// The most decimals that an x, a y and a z needs.
    pub(crate) decimals: [u8; 3],
    /// The coarsest grid on which every x and every y lies.
    pub(crate) grid: [Granularity; 2],
}

impl Survey {
    /// Returns the survey of no line.
    pub(crate) fn empty() -> Survey {
        Survey {
            lines: 0,
            rows: 0,
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
            decimals: [0; 3],
            grid: Default::default(),
        }
    }

    /// Surveys the lines that begin in `range`. The first row of the text is at byte `first`.
    pub(crate) fn of_range(
        file: &RandomAccessFile,
        columns: &Columns,
        first: u64,
        range: Range<u64>,
    ) -> Result<Survey> {
        let mut survey = Survey::empty();
        let mut reader = RowReader::new(columns);
        survey.lines = for_each_line(file, first, range, |_, line| {
            match line {
                TextLine::Whole(line) if columns.skips(line) => return Ok(()),
                TextLine::Whole(line) if reader.read(line).is_ok() => survey.see(&reader.numbers),
                _ => {}
            }
            survey.rows += 1;
            Ok(())
        })?;
        Ok(survey)
    }

    #[inline]
    fn see(&mut self, numbers: &[Number; 3]) {
        for (axis, number) in numbers.iter().enumerate() {
            let value = number.value();
            self.min[axis] = self.min[axis].min(value);
            self.max[axis] = self.max[axis].max(value);
            if number.decimals > self.decimals[axis] {
                self.decimals[axis] = self.decimals[axis].max(number.shortest().decimals);
            }
        }
        for (grid, number) in self.grid.iter_mut().zip(numbers) {
            grid.see(number);
        }
    }

    /// Adds the survey of the lines that follow.
    pub(crate) fn add(&mut self, other: &Survey) {
        self.lines += other.lines;
        self.rows += other.rows;
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
            self.decimals[axis] = self.decimals[axis].max(other.decimals[axis]);
        }
        for (grid, other) in self.grid.iter_mut().zip(&other.grid) {
            grid.add(other);
        }
    }
}
