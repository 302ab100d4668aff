//! The first pass over a text: what its rows hold.

use std::ops::Range;

use crate::file::random_access::RandomAccessFile;
use crate::points::extremes::Extremes;
use crate::points::nodata::FoundNodata;
use crate::points::nodata_choice::NodataChoice;
use crate::points::nodata_number::{NO_HEIGHT, is_nodata_number};
use crate::text::columns::Columns;
use crate::text::granularity::Granularity;
use crate::text::lines::{TextLine, for_each_line};
use crate::text::lines_between::{LinesBetween, TextStart};
use crate::text::nodata_rows::NodataRows;
use crate::text::noise;
use crate::text::number::Number;
use crate::text::optional_columns::BrightnessScale;
use crate::text::row::RowReader;
use crate::text::row_box::RowBox;
use crate::text::row_choice::RowChoice;
use sys::Result;

/// Of fewer rows, one number from single precision may be there by chance.
const FEW_ROWS: u64 = 10;

/// What the first pass finds in a chunk, or in all chunks.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    /// The number of lines.
    pub(crate) lines: u64,
    /// The number of rows, including malformed rows.
    pub(crate) rows: u64,
    /// The number of malformed rows.
    pub(crate) malformed: u64,
    /// What the rows hold that the job wants.
    pub(crate) wanted: Findings,
    /// The lowest and the highest heights that the job wants, with the numbers of their lines from 0.
    pub(crate) heights: Extremes,
    /// Likewise, those that are too large for any height.
    pub(crate) huge_heights: Extremes,
    /// Likewise, those that the user takes for nodata.
    pub(crate) named_heights: Extremes,
    /// The number of rows whose heights stand for nodata.
    pub(crate) without_height: u64,
    /// The colours of all rows.
    pub(crate) colors: BrightnessScale,
    /// The intensities of all rows.
    pub(crate) intensities: BrightnessScale,
    /// The number of rows that the job wants, but that lie outside the box in which it looks.
    pub(crate) outliers: u64,
    /// Their box.
    pub(crate) outlier_box: RowBox,
    /// The box of the other rows.
    pub(crate) others: RowBox,
    /// What stands between the rows.
    pub(crate) between: LinesBetween,
}

/// What rows hold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Findings {
    /// The number of rows.
    pub(crate) rows: u64,
    /// Their box.
    pub(crate) bounds: RowBox,
    /// The most decimals that an x, a y and a z needs, apart from digits that are noise.
    pub(crate) decimals: [u8; 3],
    /// The coarsest grid on which every x and every y lies, apart from digits that are noise.
    pub(crate) grid: [Granularity; 2],
    /// As `decimals`, where all numbers of the axis were printed from single precision.
    pub(crate) decimals_from_single: [u8; 3],
    /// The number of x, y and z that certainly were.
    pub(crate) singles: [u64; 3],
    /// The number of numbers with digits that are noise.
    pub(crate) noisy: u64,
    /// The first of them.
    pub(crate) noise: Option<Number>,
}

impl Findings {
    fn none() -> Findings {
        Findings {
            rows: 0,
            bounds: RowBox::empty(),
            decimals: [0; 3],
            grid: Default::default(),
            decimals_from_single: [0; 3],
            singles: [0; 3],
            noisy: 0,
            noise: None,
        }
    }

    /// Returns whether the numbers of an axis were printed from single precision. Heights may come from another source than x and y, so
    /// every axis counts for itself.
    pub(crate) fn are_single(&self, axis: usize) -> bool {
        let (singles, rows) = (self.singles[axis], self.rows);
        if rows < FEW_ROWS { singles * 2 > rows } else { singles > 0 && singles >= rows / 10 }
    }

    #[inline(always)]
    fn see(&mut self, numbers: &[Number; 3]) {
        self.rows += 1;
        self.bounds.see(numbers);
        if Number::may_be_long(numbers) {
            return self.see_long(numbers);
        }
        for (axis, number) in numbers.iter().enumerate() {
            self.see_digits(axis, number);
        }
    }

    /// Takes a row into account in which a number may have digits that are noise.
    #[cold]
    fn see_long(&mut self, numbers: &[Number; 3]) {
        for (axis, number) in numbers.iter().enumerate() {
            match number.is_long().then(|| noise::meaning(number)).flatten() {
                Some(meant) => {
                    self.noisy += 1;
                    self.noise = self.noise.or(Some(*number));
                    self.singles[axis] += meant.single as u64;
                    self.see_digits(axis, &meant.number);
                }
                None => self.see_digits(axis, number),
            }
        }
    }

    #[inline(always)]
    fn see_digits(&mut self, axis: usize, number: &Number) {
        // Never more than `decimals`.
        if number.decimals > self.decimals_from_single[axis] {
            self.see_decimals(axis, number);
        }
        if let Some(grid) = self.grid.get_mut(axis) {
            grid.see(number);
        }
    }

    fn see_decimals(&mut self, axis: usize, number: &Number) {
        let number = number.shortest();
        self.decimals[axis] = self.decimals[axis].max(number.decimals);
        if number.decimals > self.decimals_from_single[axis] {
            let decimals = noise::decimals_from_single(&number);
            self.decimals_from_single[axis] = self.decimals_from_single[axis].max(decimals);
        }
    }

    fn add(&mut self, other: &Findings) {
        self.rows += other.rows;
        self.bounds.add(&other.bounds);
        for axis in 0..3 {
            self.decimals[axis] = self.decimals[axis].max(other.decimals[axis]);
            self.decimals_from_single[axis] = self.decimals_from_single[axis].max(other.decimals_from_single[axis]);
            self.singles[axis] += other.singles[axis];
        }
        for (grid, other) in self.grid.iter_mut().zip(&other.grid) {
            grid.add(other);
        }
        self.noisy += other.noisy;
        self.noise = self.noise.or(other.noise);
    }
}

/// Which rows a survey looks at: those of a job, within a box if there is one.
#[derive(Clone, Copy)]
pub(crate) struct Wanted<'a> {
    pub(crate) choice: &'a RowChoice,
    pub(crate) nodata: &'a NodataRows,
    pub(crate) within: Option<RowBox>,
}

impl Survey {
    /// Returns the survey of no line.
    pub(crate) fn empty() -> Survey {
        let none = RowBox::empty();
        Survey {
            lines: 0,
            rows: 0,
            malformed: 0,
            wanted: Findings::none(),
            heights: Extremes::default(),
            huge_heights: Extremes::default(),
            named_heights: Extremes::default(),
            without_height: 0,
            colors: BrightnessScale::default(),
            intensities: BrightnessScale::default(),
            outliers: 0,
            outlier_box: none,
            others: none,
            between: LinesBetween::default(),
        }
    }

    /// Returns the survey of all lines, given those of their chunks.
    pub(crate) fn of_all(surveys: &[Survey]) -> Survey {
        let mut all = Survey::empty();
        surveys.iter().for_each(|survey| all.add(survey));
        all
    }

    /// Surveys the lines that begin in `range`. The first row of the text is at byte `first`. Lines that are no rows are compared with
    /// `start`, if it is given.
    pub(crate) fn of_range(
        file: &RandomAccessFile,
        columns: &Columns,
        first: u64,
        range: Range<u64>,
        wanted: Wanted,
        start: Option<&TextStart>,
    ) -> Result<Survey> {
        let mut survey = Survey::empty();
        let mut reader = RowReader::new(columns);
        let is_all = wanted.choice.is_all() && wanted.within.is_none();
        survey.lines = for_each_line(file, first, range, |index, line| {
            match line {
                TextLine::Whole(line) if columns.skips(line) => {
                    survey.see_between(start, index, line);
                    return Ok(());
                }
                TextLine::Whole(line) if reader.read(line).is_ok() => {
                    survey.colors.see(reader.colors);
                    survey.intensities.see(reader.brightness);
                    let height = reader.height();
                    if wanted.nodata.has(height) {
                        survey.see_nodata(&reader, wanted, index);
                    } else if is_all || wanted.has(&reader) {
                        survey.heights.see(height, index);
                        survey.wanted.see(&reader.numbers);
                    } else {
                        if wanted.is_chosen(&reader) {
                            survey.outliers += 1;
                            survey.outlier_box.see(&reader.numbers);
                        }
                        survey.others.see(&reader.numbers);
                    }
                }
                TextLine::Whole(line) => {
                    survey.malformed += 1;
                    survey.see_between(start, index, line);
                }
                TextLine::TooLong => survey.malformed += 1,
            }
            survey.rows += 1;
            Ok(())
        })?;
        Ok(survey)
    }

    fn see_between(&mut self, start: Option<&TextStart>, index: u64, line: &[u8]) {
        if let Some(start) = start {
            self.between.see(start, index, line);
        }
    }

    /// Counts the last row of `reader`, whose height stands for nodata, on line `index`.
    #[cold]
    fn see_nodata(&mut self, reader: &RowReader, wanted: Wanted, index: u64) {
        self.without_height += 1;
        let height = reader.height();
        if !wanted.is_chosen(reader) {
            return;
        }
        if wanted.choice.nodata.heights().contains(&height) {
            self.named_heights.see(height, index);
        } else if height.abs() >= NO_HEIGHT {
            self.huge_heights.see(height, index);
        }
    }

    /// Adds the survey of the lines that follow.
    pub(crate) fn add(&mut self, other: &Survey) {
        self.heights.add(&other.heights, self.lines);
        self.huge_heights.add(&other.huge_heights, self.lines);
        self.named_heights.add(&other.named_heights, self.lines);
        self.without_height += other.without_height;
        self.between.add(&other.between, self.lines);
        self.lines += other.lines;
        self.rows += other.rows;
        self.malformed += other.malformed;
        self.wanted.add(&other.wanted);
        self.colors.add(&other.colors);
        self.intensities.add(&other.intensities);
        self.outliers += other.outliers;
        self.outlier_box.add(&other.outlier_box);
        self.others.add(&other.others);
    }

    /// Returns the heights that stand for nodata beside those that `choice` names.
    pub(crate) fn nodata(&self, choice: &NodataChoice) -> FoundNodata {
        if !choice.is_on() {
            return FoundNodata::default();
        }
        let mut heights = self.heights.clone();
        heights.add(&self.huge_heights, 0);
        heights.nodata(is_nodata_number)
    }

    /// Returns the box of all rows that can be read.
    pub(crate) fn bounds(&self) -> Option<RowBox> {
        let mut all = self.wanted.bounds;
        all.add(&self.others);
        all.some()
    }
}

impl Wanted<'_> {
    /// Returns whether place, class and return of the last row of `reader` are wanted.
    fn is_chosen(&self, reader: &RowReader) -> bool {
        self.choice.wants(&reader.numbers, reader.class(), reader.pulse_return())
    }

    /// Returns whether the last row of `reader` is wanted.
    pub(crate) fn has(&self, reader: &RowReader) -> bool {
        !self.nodata.has(reader.height())
            && self.is_chosen(reader)
            && self.within.is_none_or(|within| within.holds(&reader.numbers))
    }
}
