//! A warning about heights that lie so far from all others that they are mistakes, or stand for nodata: which file has how many of them, where
//! the first is, and which `[input] heights` leave them out.

use crate::options::JobOptions;
use crate::plan::extent::{Extent, SourceBox, to_float};
use crate::plan::height_groups::{FLAT, HIGH, HeightBins, HeightGroup, HeightsApart, LOW, TerrainScale, heights_apart};
use crate::plan::height_range::HeightSample;
use crate::plan::job_plan::{Plan, decoded_records};
use crate::plan::rounded_box::rounded_heights;
use crate::plan::suspect_heights::{own_height, shown_own_height};
use delaunay::geometry::Bounds;
use lattice::Lattice;
use points::{KeptHeights, OptionalFields, PointRules, Source};
use rayon::prelude::*;
use sys::{Result, interrupt};

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

/// What is known of the heights of a file, in steps of the lattice.
struct FileHeights {
    /// Those that lie apart from all others.
    found: Option<HeightsApart>,
    /// How many points were looked at, if not all.
    sampled: Option<usize>,
    /// Where all others lie; `None` if there is none.
    good: Option<[i64; 2]>,
}

impl JobHeights<'_> {
    /// Returns warnings about the files with heights that lie apart from all others. Who sets `[input] heights` has looked at them, but may
    /// have left out whole files.
    ///
    /// # Errors
    /// Those of reading.
    pub(crate) fn warnings(&self) -> Result<Vec<String>> {
        if let Some(kept) = self.options.input.heights {
            return Ok(self.file_left_out(kept).into_iter().collect());
        }
        let flat = self.flat_files();
        let (mut files, mut read) = (Vec::new(), 0);
        let all = self.sample.groups();
        for index in 0..self.sources.len() {
            let file = self.look(index, &all, &mut read)?;
            files.push(if flat.contains(&index) { FileHeights { good: None, ..file } } else { file });
        }
        let kept = self.advice(&files);
        let apart = files.iter().zip(self.sources).filter_map(|(file, source)| {
            file.found.as_ref().map(|found| self.sentence(source, found, file.sampled, &kept))
        });
        apart.chain(self.flat_file(&flat, &kept).map(Ok)).collect()
    }

    /// Looks at the heights of a file. `all` are those of the sample; `read` is the number of records that have been read for that.
    fn look(&self, index: usize, all: &[HeightGroup], read: &mut u64) -> Result<FileHeights> {
        let source = &self.sources[index];
        let records = decoded_records(source, &self.rules[index]);
        let can_read = *read + records <= MOST_RECORDS;
        let known = self.sample.by_file.get(&source.path).map_or(&[][..], |file| &file.heights);
        let claim = self.extent.boxes[index].map(|claim| self.claimed(claim));
        let Some(ends) = self.doubtful_ends(known, all, claim.filter(|_| can_read)) else {
            let seen = known.iter().min().zip(known.iter().max()).map(|(low, high)| [*low, *high].map(i64::from));
            let ends = claim.into_iter().chain(seen).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            return Ok(FileHeights { found: None, sampled: None, good: ends });
        };
        let (bins, sampled) = match can_read {
            true => (self.read(index, ends)?, None),
            false => (HeightBins::of(known), Some(known.len())),
        };
        *read += if can_read { records } else { 0 };
        let groups = bins.groups();
        let found = heights_apart(&groups, self.scale());
        let others = found.map(|found| found.others).or_else(|| groups.iter().copied().reduce(HeightGroup::and));
        Ok(FileHeights { found, sampled, good: others.map(|group| [group.low, group.high]) })
    }

    /// Returns the `[input] heights` that keep all good heights of all files, as a user writes them, each file in its own unit.
    fn advice(&self, files: &[FileHeights]) -> [String; 2] {
        let own = |(file, source): (&FileHeights, &Source)| {
            // What was rounded to the lattice may lie a step beyond.
            let is_rounded = self.lattice.resolution_z > source.axes[2].scale;
            let [low, high] = file.good?;
            Some(
                [low - i64::from(is_rounded), high + i64::from(is_rounded)]
                    .map(|z| own_height(source, self.lattice, z)),
            )
        };
        let ranges = files.iter().zip(self.sources).filter_map(own);
        rounded_heights(ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default())
    }

    /// Returns what to say about the unit of `[input] heights` where files have several.
    fn unit_of_each(&self) -> &'static str {
        let mut factors = self.sources.iter().map(Source::factor_of_heights);
        let first = factors.next();
        if factors.all(|factor| Some(factor) == first) {
            ""
        } else {
            ", in the unit of each file (such as feet and metres),"
        }
    }

    /// Returns a warning about the first file of which no point of the sample is kept, though others are, as all lie outside of `kept`.
    fn file_left_out(&self, KeptHeights([low, high]): KeptHeights) -> Option<String> {
        let counts = |source: &&Source| self.sample.by_file.get(&source.path).map(|file| &file.counts);
        let is_out = |source: &&Source| {
            counts(source)
                .is_some_and(|found| found.kept == 0 && found.out_of_bounds > 0 && found.out_of_bounds == found.read)
        };
        // Bounds leave out whole files as a rule.
        let mut out = self.sources.iter().filter(|_| self.options.input.rectangle().is_none()).filter(is_out);
        let source = out.next().filter(|_| self.sample.counts.kept > 0)?;
        let more = match out.count() {
            0 => String::new(),
            1 => " (nor of 1 other file)".into(),
            count => format!(" (nor of {count} other files)"),
        };
        Some(format!(
            "{}: no point of a sample lies within [input] heights = [{low}, {high}]{more}; fix: wider [input] heights (in the unit of \
             each file), or leave the file out of [input] files",
            source.path.display()
        ))
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

    fn sentence(
        &self,
        source: &Source,
        found: &HeightsApart,
        sampled: Option<usize>,
        kept: &[String; 2],
    ) -> Result<String> {
        let value = |height: i64| shown_own_height(source, self.lattice, height);
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
        let others = match [found.others.low, found.others.high].map(value) {
            [low, high] if low == high => format!("have the height {low}"),
            [low, high] => format!("lie between {low} and {high}"),
        };
        Ok(format!(
            "{}: {of}{}, far from all others, which {others}; fix: {}, if they are wrong or stand for nodata",
            source.path.display(),
            parts.join(", and "),
            self.remedy(source, found, kept)
        ))
    }

    /// Returns what to do about heights that lie apart: `[input] heights` holds for all files.
    fn remedy(&self, source: &Source, found: &HeightsApart, kept: &[String; 2]) -> String {
        let [low, high] = kept;
        let is_kept = |height: i64| {
            let [least, greatest] = kept.each_ref().map(|end| end.parse().unwrap_or(f64::NAN));
            (least..=greatest).contains(&own_height(source, self.lattice, height))
        };
        let is_beside = !found.below.is_some_and(|group| is_kept(group.high))
            && !found.above.is_some_and(|group| is_kept(group.low));
        let unit = self.unit_of_each();
        match is_beside {
            true => format!("[input] heights = [{low}, {high}]{unit} leaves them out"),
            false => format!(
                "remove them from the file ([input] heights holds for all files, which lie between {low} and {high}{unit})"
            ),
        }
    }

    /// Returns the numbers of the files that claim one height, far below those of all files around them or far above.
    fn flat_files(&self) -> Vec<usize> {
        let is_flat = |[min, max]: &SourceBox| (max[2] - min[2]) * self.metres <= FLAT;
        let claims = self.extent.boxes.iter().enumerate().filter_map(|(index, claim)| Some((index, (*claim)?)));
        let (flat, others): (Vec<_>, Vec<_>) = claims.partition(|(_, claim)| is_flat(claim));
        let is_apart = |claim: SourceBox| {
            let around = || others.iter().map(|(_, other)| *other).filter(|other| are_neighbours(claim, *other));
            around().next().is_some() && around().all(|other| self.lies_apart(claim, other))
        };
        flat.into_iter().filter(|(_, claim)| is_apart(*claim)).map(|(index, _)| index).collect()
    }

    /// Returns a warning about the first of the files `flat`.
    fn flat_file(&self, flat: &[usize], [low, high]: &[String; 2]) -> Option<String> {
        let (first, rest) = flat.split_first()?;
        let (source, claim) = (&self.sources[*first], self.extent.boxes[*first]?);
        let more = match rest.len() {
            0 => String::new(),
            count => format!(" (and so do {count} other files)"),
        };
        let own = |end: usize| claim[end][2] / source.factor_of_heights();
        Some(format!(
            "{}: all points have {}, far from those of the files around it{more}; fix: [input] heights = [{low}, {high}]{} leaves them \
             out, if they are wrong or stand for nodata",
            source.path.display(),
            range_text([own(0), own(1)]),
            self.unit_of_each().trim_end_matches(',')
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
    if source.format.is_text() && plan.records <= MOST_RECORDS || plan.options.input.heights.is_some() {
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
    // The option holds for all files, each in its own unit.
    let ends =
        |height: i32| plan.inputs.iter().map(move |input| own_height(&input.source, &plan.lattice, height.into()));
    let [lowest, highest] = rounded_heights([
        ends(known.low).fold(own(known.low), f64::min),
        ends(known.high).fold(own(known.high), f64::max),
    ]);
    (below || above).then(|| {
        format!(
            "has heights from {} to {}, though nearly all points of a sample of all files lie between {lowest} and {highest}; fix: \
             [input] heights = [{lowest}, {highest}], if those beyond are wrong or stand for nodata",
            own(min[2]),
            own(max[2])
        )
    })
}
