//! The heights of a LAS or LAZ file that a job keeps, and finding those that stand for nodata. A text is surveyed for them when it is opened.

use crate::points::axis::Axis;
use crate::points::chunk_request::ChunkRequest;
use crate::points::extremes::Extremes;
use crate::points::kept_heights::RawHeights;
use crate::points::nodata::{FoundNodata, left_out};
use crate::points::nodata_number::is_number_in_steps;
use crate::points::raw_bounds::RawBounds;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::PulseReturn;
use crate::source::{PointData, Source};
use crate::text::row_choice::RowChoice;
use lattice::shortest_decimal;
use rayon::prelude::*;
use rust_decimal::prelude::ToPrimitive;
use sys::{Result, interrupt};

/// A file of more records is not read only to look for heights that the user takes for nodata.
const MOST_RECORDS: u64 = 1 << 24;

impl Source {
    /// Keeps only the heights of a LAS or LAZ file that `choice` wants. The header claims no others then.
    pub(super) fn keep_heights(&mut self, choice: &RowChoice) {
        if let Some(heights) = choice.heights {
            self.kept_heights = Some(heights.raw(&self.axes[2]));
            let [low, high] = heights.0;
            [self.min[2], self.max[2]] = [self.min[2], self.max[2]].map(|height| height.clamp(low, high));
        }
    }

    /// Finds the heights of a LAS or LAZ file that stand for nodata, and leaves them out. A file whose header claims none is not read for
    /// that.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read.
    pub(super) fn find_nodata(&mut self, choice: &RowChoice) -> Result<()> {
        let z = self.axes[2];
        self.nodata = choice.nodata.heights().iter().filter_map(|height| raw_of(&z, *height)).collect();
        let claims_nodata = choice.nodata.is_on() && self.claims_nodata();
        if !claims_nodata && !self.may_have_named() {
            return Ok(());
        }
        let SeenHeights { wanted, named } = self.see_heights(choice)?;
        self.warnings.extend(named.next_to(&wanted, "point"));
        if claims_nodata {
            let FoundNodata { heights, others } = wanted.nodata(|value| is_number(&z, value));
            self.nodata.extend(heights.iter().filter_map(|height| raw_of(&z, height.value)));
            self.warnings.extend(heights.iter().map(|height| left_out(height, "point")));
            let [low, high] = others.unwrap_or_default();
            (self.min[2], self.max[2]) = (low, high);
        }
        Ok(())
    }

    /// Returns whether the file may have points of a height that the user takes for nodata, as far as its header claims, and is read to
    /// look for them.
    fn may_have_named(&self) -> bool {
        let is_claimed = |raw: &i64| (self.min[2]..=self.max[2]).contains(&self.axes[2].value(*raw));
        self.records <= MOST_RECORDS && self.nodata.iter().any(is_claimed)
    }

    /// Returns whether the lowest or the highest height that the header claims stands for nodata, or may.
    fn claims_nodata(&self) -> bool {
        let z = &self.axes[2];
        let is_named = |value: f64| raw_of(z, value).is_some_and(|raw| self.nodata.contains(&raw));
        [self.min[2], self.max[2]].into_iter().any(|value| is_named(value) || is_number(z, value))
    }

    /// Reads the lowest and the highest heights of all points that the job wants, in the unit of the file, apart from those that the user
    /// names as nodata. A file that is not a text has them only in its points.
    ///
    /// # Errors
    /// `Io` or `Input` if the file cannot be read.
    pub fn heights_of(&self, choice: &RowChoice) -> Result<Extremes> {
        Ok(self.see_heights(choice)?.wanted)
    }

    fn see_heights(&self, choice: &RowChoice) -> Result<SeenHeights> {
        let axes = self.transform.as_ref().map_or(&self.axes, |transform| &transform.own.axes);
        let bounds = choice.bounds.map(|bounds| RawBounds::of(axes, bounds));
        let request = ChunkRequest { bounds: bounds.as_ref(), ..ChunkRequest::all() };
        let _ahead = self.read_ahead(bounds.as_ref(), false)?;
        let look = |chunk| {
            interrupt::check()?;
            let seen = SeenHeights::default();
            let mut heights =
                Heights { choice, bounds: bounds.as_ref(), named: &self.nodata, kept: self.kept_heights, seen };
            self.read_chunk_of_file(chunk, request, &mut heights)?;
            Ok(heights.seen)
        };
        let chunks = (0..self.chunks()).into_par_iter();
        let SeenHeights { wanted, named } = chunks.map(look).try_reduce(SeenHeights::default, |a, b| Ok(a.and(&b)))?;
        let [wanted, named] = [wanted, named].map(|heights| heights.map(|raw| axes[2].value(raw as i64)));
        Ok(SeenHeights { wanted, named })
    }

    /// Returns the lowest and the highest heights of a text, without those that stand for nodata.
    pub fn heights_of_text(&self) -> Option<&Extremes> {
        match &self.points {
            PointData::Text(table) => Some(table.heights_of_lines()),
            _ => None,
        }
    }
}

/// Returns whether a height on this axis is a number for nodata, or the end of the raw integers: a writer makes that of what does not fit.
fn is_number(z: &Axis, value: f64) -> bool {
    let is_end = |raw: i64| raw == i64::from(i32::MIN) || raw == i64::from(i32::MAX);
    is_number_in_steps(value, z.scale.to_f64().unwrap_or(1.0)) || raw_of(z, value).is_some_and(is_end)
}

/// Returns the raw integer of a height.
fn raw_of(z: &Axis, value: f64) -> Option<i64> {
    shortest_decimal(value)?.checked_sub(z.offset)?.checked_div(z.scale)?.round().to_i64()
}

/// Sees the heights of the records that a job wants.
struct Heights<'a> {
    choice: &'a RowChoice,
    bounds: Option<&'a RawBounds>,
    /// The raw heights that the user names as nodata.
    named: &'a [i64],
    /// Those that the job keeps.
    kept: Option<RawHeights>,
    seen: SeenHeights,
}

/// The lowest and the highest heights of records.
#[derive(Default)]
struct SeenHeights {
    /// Of those that the job wants.
    wanted: Extremes,
    /// Of those whose height the user takes for nodata.
    named: Extremes,
}

impl SeenHeights {
    fn and(mut self, other: &SeenHeights) -> SeenHeights {
        self.wanted.add(&other.wanted, 0);
        self.named.add(&other.named, 0);
        self
    }
}

impl RecordSink for Heights<'_> {
    fn push(&mut self, number: u64, record: &PointRecord, _: impl Fn() -> String) -> Result<()> {
        let is_within = self.bounds.is_none_or(|bounds| bounds.hold(&record.raw))
            && self.kept.is_none_or(|kept| kept.hold(record.raw[2]));
        let is_wanted = self.choice.classes[record.class as usize] && self.choice.returns.has(record.pulse_return);
        if is_within && is_wanted && !record.withheld {
            let is_named = self.named.contains(&record.raw[2]);
            let seen = if is_named { &mut self.seen.named } else { &mut self.seen.wanted };
            seen.see(record.raw[2] as f64, number);
        }
        Ok(())
    }

    fn push_out_of_bounds(&mut self, _: u8) {}

    fn push_outlier(&mut self, _: u8, _: PulseReturn, _: impl FnOnce() -> String) {}

    /// A record that cannot be read has no height.
    fn malformed(&mut self, _: u64, _: impl FnOnce() -> String) {}

    fn not_decoded(&mut self, _: u64) {}

    fn misplaced(&mut self, _: u64) {}
}
