//! Rows that lie so far from all others that they are mistakes, such as 0, 0, 0 among coordinates of a national grid.

use std::cmp::Ordering;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::file::random_access::RandomAccessFile;
use crate::text::columns::Columns;
use crate::text::lines::{TextLine, for_each_line};
use crate::text::number::Number;
use crate::text::row::RowReader;
use crate::text::row_box::RowBox;
use crate::text::survey::{Survey, Wanted};
use sys::Result;

/// The most rows of a chunk that are looked at.
const ROWS_OF_A_CHUNK: u64 = 4096;

/// The sizes of the middle of the rows by which an outlier at least lies outside it.
const FAR: f64 = 10.0;

/// A height that no terrain has above or below its middle unless this is steep.
const HIGH: f64 = 5000.0;

/// The fraction of the rows beyond either end of their middle.
const TAIL: f64 = 0.05;

/// Of fewer rows nobody can say where the middle is.
const LEAST_ROWS: usize = 5;

/// One row in so many may be an outlier. If there are more, they are a part of the terrain.
const RARE: u64 = 50;

/// Rows that lie far from all others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outliers {
    /// How many rows they are.
    pub rows: u64,
    /// At how many places they lie, or the number of rows. Rows at one place are one mistake, such as 0, 0, 0 for "nothing measured".
    pub places: u64,
}

impl Outliers {
    /// Returns the outliers that a survey has found.
    pub(crate) fn of(survey: &Survey) -> Outliers {
        let rows = survey.outliers;
        Outliers { rows, places: if survey.outlier_box.is_point() { rows.min(1) } else { rows } }
    }

    /// Counts those of another file as well.
    pub fn add(&mut self, other: Outliers) {
        self.rows += other.rows;
        self.places += other.places;
    }

    /// Returns whether they are so few among `rows` that they are mistakes. Of a few rows none is, unless `even_among_few`: then one may be.
    pub fn are_rare(&self, rows: u64, even_among_few: bool) -> bool {
        self.places > 0 && self.places <= (rows / RARE).max(even_among_few as u64)
    }
}

/// Where most rows lie.
pub struct Middle {
    /// The box of nine in ten rows on each axis.
    pub bounds: RowBox,
    /// The median of each axis.
    pub(crate) centre: [f64; 3],
}

impl Middle {
    /// Returns where most of these places lie; `None` if they are too few to tell. A place counts once, however many rows have it: rows
    /// at one place are one mistake.
    pub fn of(mut places: Vec<[f64; 3]>) -> Option<Middle> {
        places
            .sort_unstable_by(|a, b| a.iter().zip(b).fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b))));
        places.dedup();
        if places.len() < LEAST_ROWS {
            return None;
        }
        let cut = ((places.len() as f64 * TAIL) as usize).max(1);
        let (mut bounds, mut centre) = (RowBox::empty(), [0.0; 3]);
        for axis in 0..3 {
            let mut values: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            (bounds.min[axis], bounds.max[axis]) = (values[cut], values[values.len() - 1 - cut]);
            centre[axis] = values[values.len() / 2];
        }
        Some(Middle { bounds, centre })
    }

    /// Returns how far a row lies from the centre, on the axis on which it is farthest, in the unit of z. One of x and y has so many `steps`
    /// of z.
    pub(crate) fn distance_to(&self, numbers: &[Number; 3], steps: f64) -> f64 {
        let distance = |axis: usize| (numbers[axis].value() - self.centre[axis]).abs();
        (distance(0).max(distance(1)) * steps).max(distance(2))
    }
}

/// Returns the box outside which a row is an outlier, given the box of the middle of the rows; `None` if that is a point. One of x
/// and y is as long as so many `steps` of z: 1 for lengths, and for degrees their length on the ground.
pub fn plausible_box(middle: &RowBox, steps: f64) -> Option<RowBox> {
    // A strip or a plane is narrow on one axis, which says nothing about how far its rows may lie apart there.
    let size = |axis: usize| middle.max[axis] - middle.min[axis];
    let widest = (size(0).max(size(1)) * steps).max(size(2));
    // A wide area is no reason for points in outer space.
    let upwards = (FAR * widest).min((FAR * size(2)).max(HIGH));
    let margins = [FAR * widest / steps, FAR * widest / steps, upwards];
    let beside = |corner: [f64; 3], side: f64| std::array::from_fn(|axis| corner[axis] + side * margins[axis]);
    (widest > 0.0).then(|| RowBox { min: beside(middle.min, -1.0), max: beside(middle.max, 1.0) })
}

/// Returns the places of a sample of the wanted rows in these chunks, given as byte ranges.
pub(crate) fn sampled_places(
    file: &RandomAccessFile,
    columns: &Columns,
    first: u64,
    chunks: &[Range<u64>],
    wanted: Wanted,
) -> Result<Vec<[f64; 3]>> {
    let mut places: Vec<[f64; 3]> = Vec::new();
    for chunk in chunks {
        let mut lines = 0;
        for_each_line(file, first, chunk.clone(), |_, _| {
            lines += 1;
            Ok(())
        })?;
        let stride = lines / ROWS_OF_A_CHUNK + 1;
        let mut reader = RowReader::new(columns);
        for_each_line(file, first, chunk.clone(), |index, line| {
            if let TextLine::Whole(line) = line
                && index % stride == 0
                && !columns.skips(line)
                && reader.read(line).is_ok()
                && wanted.has(&reader)
            {
                places.push(reader.numbers.each_ref().map(Number::value));
            }
            Ok(())
        })?;
    }
    Ok(places)
}
