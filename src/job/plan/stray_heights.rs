//! A warning about heights that lie so far from all others that they are mistakes, or stand for nodata: which file has how many of them, where
//! the first is, and which `[input] heights` leave them out.

use crate::geometry::Bounds;
use crate::geometry::lattice::Lattice;
use crate::input::{FileFormat, OptionalFields, PointRules, Source};
use crate::job::options::JobOptions;
use crate::job::plan::doubtful_heights::own_height;
use crate::job::plan::extent::{Extent, SourceBox, to_float};
use crate::job::plan::height_groups::{
    FLAT, HIGH, HeightBins, HeightGroup, HeightsApart, LOW, TerrainScale, heights_apart,
};
use crate::job::plan::height_range::HeightSample;
use crate::job::plan::job_plan::{Plan, decoded_records};
use crate::job::plan::point_survey::box_around;
use crate::job::plan::rounded_box::rounded;
use crate::{Result, interrupt};
use rayon::prelude::*;

/// The most records of all files together that are read only for the sake of the warning.
const MOST_RECORDS: u64 = 1 << 24;

/// Of more records only a sample was looked at, which may have missed a mountain: so many times as much is needed then.
const TIMES_UNSEEN: f64 = 10.0;

/// The heights of a job, before its points are read.
pub(crate) struct JobHeights<'a> {
    pub(crate) sources: &'a [Source],
    pub(crate) rules: &'a [PointRules],
    pub(crate) options: &'a JobOptions,
    pub(crate) lattice: &'a Lattice,
    pub(crate) extent: &'a Extent,
    pub(crate) sample: &'a HeightSample,
    /// Metres of the unit of heights.
    pub(crate) metres: f64,
}

impl JobHeights<'_> {
    /// Returns warnings about the files with heights that lie apart from all others. Who sets `[input] heights` has looked at them.
    ///
    /// # Errors
    /// Those of reading.
    pub(crate) fn warnings(&self) -> Result<Vec<String>> {
        let (mut warnings, mut read) = (Vec::new(), 0);
        if self.options.input.heights.is_some() {
            return Ok(warnings);
        }
        let all = self.sample.groups();
        for (index, source) in self.sources.iter().enumerate() {
            let records = decoded_records(source, &self.rules[index]);
            let can_read = read + records <= MOST_RECORDS;
            let known = self.sample.by_file.get(&source.path).map_or(&[][..], |file| &file.heights);
            let claim = self.extent.boxes[index].map(|claim| self.claimed(claim)).filter(|_| can_read);
            let Some(ends) = self.doubtful_ends(known, &all, claim) else { continue };
            let (bins, sampled) = match can_read {
                true => (self.read(index, ends)?, None),
                false => (HeightBins::of(known), Some(known.len())),
            };
            read += if can_read { records } else { 0 };
            let found = heights_apart(&bins.groups(), self.scale());
            if let Some(found) = found {
                warnings.push(self.sentence(source, &found, sampled)?);
            }
        }
        warnings.extend(self.flat_file());
        Ok(warnings)
    }

    fn scale(&self) -> TerrainScale {
        let step = to_float(self.lattice.resolution_z);
        TerrainScale::new(step * self.metres, -to_float(self.lattice.offset[2]) / step)
    }

    /// Returns the heights that a source claims, in steps of the lattice.
    fn claimed(&self, [min, max]: SourceBox) -> [i64; 2] {
        let (offset, step) = (to_float(self.lattice.offset[2]), to_float(self.lattice.resolution_z));
        [min[2], max[2]].map(|height| ((height - offset) / step).round() as i64)
    }

    /// Returns the lowest and the highest height of a file if the `known` ones, and those that it claims, seem to lie apart. Of a file that
    /// the sample has not seen, those of `all` tell.
    fn doubtful_ends(&self, known: &[i32], all: &[HeightGroup], claim: Option<[i64; 2]>) -> Option<[i64; 2]> {
        let mut groups = if known.is_empty() { all.to_vec() } else { HeightBins::of(known).groups() };
        if let (Some([low, high]), Some(first), Some(last)) = (claim, groups.first().copied(), groups.last().copied()) {
            let one = |height: i64| HeightGroup { count: 1, low: height, high: height, first: 0 };
            groups.splice(0..0, (low < first.low).then(|| one(low)));
            groups.extend((high > last.high).then(|| one(high)));
        }
        heights_apart(&groups, self.scale())?;
        Some([groups.first()?.low, groups.last()?.high])
    }

    /// Reads the heights of all points that the job wants of a source, most of which lie between `ends`.
    fn read(&self, index: usize, ends: [i64; 2]) -> Result<HeightBins> {
        let (source, rules) = (&self.sources[index], &self.rules[index]);
        let rules = PointRules { first_order: 0, numbered: true, fields: OptionalFields::default(), ..rules.clone() };
        let look = |chunk: usize| {
            interrupt::check()?;
            let mut bins = HeightBins::between(ends);
            source.decode(chunk, &rules, &mut |points| {
                points.iter().for_each(|point| bins.see(point.z, point.order()));
                Ok(())
            })?;
            Ok(bins)
        };
        let _ahead = source.read_ahead(rules.bounds.as_ref(), false)?;
        let empty = || HeightBins::between(ends);
        (0..source.chunks()).into_par_iter().map(look).try_reduce(empty, |a, b| Ok(a.and(b)))
    }

    fn sentence(&self, source: &Source, found: &HeightsApart, sampled: Option<usize>) -> Result<String> {
        let value = |height: i64| own_height(source, self.lattice, height);
        let range = |group: &HeightGroup| range_text([group.low, group.high].map(value));
        let apart = |group: &HeightGroup| {
            let (points, has) = if group.count == 1 { ("point", "has") } else { ("points", "have") };
            Ok(match (sampled, group.count) {
                (Some(_), count) => format!("{count} {points} {has} {}", range(group)),
                (None, 1) => format!("{} has {}", source.record_name(group.first)?, range(group)),
                (None, count) => {
                    format!("{count} points have {} (the first is {})", range(group), source.record_name(group.first)?)
                }
            })
        };
        let parts = found.below.iter().chain(&found.above).map(apart).collect::<Result<Vec<String>>>()?;
        let of = sampled.map_or(String::new(), |count| format!("of a sample of {count} points, "));
        let others = found.others;
        let [low, high] = rounded([others.low, others.high].map(value));
        Ok(format!(
            "{}: {of}{}, far from all others, which lie between {} and {}: they may be mistakes, or stand for nodata; [input] heights = \
             [{low}, {high}] leaves them out",
            source.path.display(),
            parts.join(", and "),
            value(others.low),
            value(others.high)
        ))
    }

    /// Returns a warning about the first file that claims one height, far below those of all files around it or far above.
    fn flat_file(&self) -> Option<String> {
        let claims =
            self.sources.iter().zip(&self.extent.boxes).filter_map(|(source, claim)| Some((source, (*claim)?)));
        let is_flat = |[min, max]: SourceBox| (max[2] - min[2]) * self.metres <= FLAT;
        let (flat, others): (Vec<_>, Vec<_>) = claims.partition(|(_, claim)| is_flat(*claim));
        let is_apart = |claim: SourceBox| {
            let mut around =
                others.iter().map(|(_, other)| *other).filter(|other| are_neighbours(claim, *other)).peekable();
            around.peek().is_some() && around.all(|other| self.lies_apart(claim, other))
        };
        let mut found = flat.into_iter().filter(|(_, claim)| is_apart(*claim));
        let (source, claim) = found.next()?;
        let more = match found.count() {
            0 => String::new(),
            count => format!(" (and so do {count} other files)"),
        };
        let own = |height: f64| height / source.factor_of_heights();
        let [min, max] = box_around(others.iter().flat_map(|(_, other)| *other))?;
        let [low, high] = rounded([own(min[2]), own(max[2])]);
        Some(format!(
            "{}: all points have {}, far from those of the files around it{more}: they may be mistakes, or stand for nodata; \
             leave them out with [input] heights = [{low}, {high}], or the file out of [input] files",
            source.path.display(),
            range_text([own(claim[0][2]), own(claim[1][2])])
        ))
    }

    /// Returns whether no terrain joins the heights of two boxes.
    fn lies_apart(&self, claim: SourceBox, other: SourceBox) -> bool {
        let [below, above] = [other[0][2] - claim[1][2], claim[0][2] - other[1][2]].map(|gap| gap * self.metres);
        below >= LOW || above >= HIGH
    }
}

fn range_text([low, high]: [f64; 2]) -> String {
    if low == high { format!("the height {low}") } else { format!("heights from {low} to {high}") }
}

/// Returns whether two boxes lie side by side in x and y: no farther apart than the first of them is long.
fn are_neighbours([min, max]: SourceBox, other: SourceBox) -> bool {
    let longest = (max[0] - min[0]).max(max[1] - min[1]);
    (0..2).all(|axis| other[0][axis] - max[axis] <= longest && min[axis] - other[1][axis] <= longest)
}

/// Returns a sentence about points of a source that were read, in the box `read` of the lattice, if some lie far from all heights of the sample
/// that the plan has taken, and the plan could not know it.
pub(crate) fn unforeseen_heights(source: &Source, read: Option<Bounds<3>>, plan: &Plan) -> Option<String> {
    let (Bounds { min, max }, known) = (read?, plan.heights?);
    if source.format == FileFormat::Text && plan.records <= MOST_RECORDS || plan.options.input.heights.is_some() {
        return None;
    }
    let (offset, step) = (to_float(plan.lattice.offset[2]), to_float(plan.lattice.resolution_z));
    let [low, high] = [source.min[2], source.max[2]].map(|height| (height - offset) / step);
    let spread = f64::from(known.high) - f64::from(known.low);
    let is_far = |beyond: f64, is_claimed: bool, least: f64| {
        let least = least / plan.frame.resolution_metres()[1];
        match is_claimed {
            false => beyond > least.max(spread),
            // Few points have been read for that.
            true => plan.records > MOST_RECORDS && beyond > TIMES_UNSEEN * least.max(spread),
        }
    };
    let below = is_far(f64::from(known.low) - f64::from(min[2]), f64::from(min[2]) >= low - 1.0, LOW);
    let above = is_far(f64::from(max[2]) - f64::from(known.high), f64::from(max[2]) <= high + 1.0, HIGH);
    let own = |height: i32| own_height(source, &plan.lattice, height.into());
    let [lowest, highest] = rounded([own(known.low), own(known.high)]);
    (below || above).then(|| {
        format!(
            "has heights from {} to {}, though nearly all points of a sample of all files lie between {lowest} and {highest}: some may be mistakes, or stand for \
             nodata; [input] heights = [{lowest}, {highest}] leaves out what lies beyond",
            own(min[2]),
            own(max[2])
        )
    })
}
