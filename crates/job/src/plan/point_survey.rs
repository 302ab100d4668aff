//! Looks at the points of one input before the lattice is chosen: a sample tells where most of them lie, and a pass over all which lie
//! elsewhere.

use crate::plan::extent::{MEASURE, SourceBox, measuring_rules, to_float};
use delaunay::geometry::Bounds;
use points::options::InputOptions;
use points::samples::{FileSamples, fingerprint_of};
use points::{FileFormat, MeasuredPoints, Middle, Outliers, PointRules, RawBox, RowBox, Source, plausible_box};
use rayon::prelude::*;
use sys::{Result, interrupt};

/// The chunks of a first sample.
const SAMPLED_CHUNKS: usize = 16;

/// The records of a sample in all chunks together.
const SAMPLED_RECORDS: usize = 1 << 16;

/// If a first sample has fewer points that the job wants, all chunks are looked at.
const ENOUGH: usize = 256;

/// Of every chunk, so many points at least.
const LEAST_OF_CHUNK: usize = 16;

/// The farthest integer of a coordinate in steps of the survey.
const FARTHEST: f64 = (1 << 28) as f64;

/// The points that a job wants of one input, in steps that are coarse enough for all of them.
pub(crate) struct PointSurvey<'a> {
    source: &'a Source,
    rules: PointRules,
    /// How many steps of the source one of the survey is long.
    steps: [i64; 3],
}

/// Some of the points of an input.
#[derive(Clone, Copy, Default)]
pub(crate) struct PointGroup {
    pub(crate) points: u64,
    bounds: Option<Bounds<3>>,
}

impl PointGroup {
    fn see(&mut self, place: [i32; 3]) {
        self.points += 1;
        self.add_box(Some(Bounds { min: place, max: place }));
    }

    fn add_box(&mut self, bounds: Option<Bounds<3>>) {
        self.bounds = self.bounds.into_iter().chain(bounds).reduce(Bounds::union);
    }

    fn and(mut self, other: PointGroup) -> PointGroup {
        self.points += other.points;
        self.add_box(other.bounds);
        self
    }
}

/// The points within a box, and those outside.
#[derive(Clone, Copy, Default)]
pub(crate) struct Split {
    within: PointGroup,
    outside: PointGroup,
    /// The first chunk with points outside.
    first_in: Option<usize>,
    /// The number of the first record outside.
    first: Option<u64>,
}

impl Split {
    /// Adds later chunks.
    fn and(self, later: Split) -> Split {
        Split {
            within: self.within.and(later.within),
            outside: self.outside.and(later.outside),
            first_in: self.first_in.or(later.first_in),
            first: self.first.or(later.first),
        }
    }
}

/// The points within a box, and those outside, by their numbers and their boxes in source units.
#[derive(Clone, Copy, Default)]
pub(crate) struct SplitBoxes {
    pub(crate) within: (u64, Option<SourceBox>),
    pub(crate) outside: (u64, Option<SourceBox>),
    /// The number of the first record outside, of one file.
    pub(crate) first: Option<u64>,
}

impl SplitBoxes {
    /// Adds those of another file.
    pub(crate) fn add(&mut self, other: SplitBoxes) {
        let sum = |a: (u64, Option<SourceBox>), b: (u64, Option<SourceBox>)| {
            (a.0 + b.0, box_around(a.1.into_iter().chain(b.1).flatten()))
        };
        self.within = sum(self.within, other.within);
        self.outside = sum(self.outside, other.outside);
    }

    /// Returns the box of all.
    pub(crate) fn all(&self) -> Option<SourceBox> {
        box_around(self.within.1.into_iter().chain(self.outside.1).flatten())
    }
}

/// Returns the box around these places; `None` without any.
pub(crate) fn box_around(places: impl Iterator<Item = [f64; 3]>) -> Option<SourceBox> {
    let least = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| a[axis].min(b[axis]));
    let greatest = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| a[axis].max(b[axis]));
    places.map(|place| [place; 2]).reduce(|a, b| [least(a[0], b[0]), greatest(a[1], b[1])])
}

/// Returns how many of these places lie within a box, and how many outside.
pub(crate) fn at_places(places: &[[f64; 3]], within: &RowBox) -> SplitBoxes {
    let holds = |place: &[f64; 3]| within.holds_box(&RowBox { min: *place, max: *place });
    let (inner, outer): (Vec<[f64; 3]>, Vec<[f64; 3]>) = places.iter().copied().partition(holds);
    let of = |places: Vec<[f64; 3]>| (places.len() as u64, box_around(places.into_iter()));
    SplitBoxes { within: of(inner), outside: of(outer), first: None }
}

impl<'a> PointSurvey<'a> {
    /// Returns the survey of `source`; `None` if its steps have too many digits, or it has no points.
    pub(crate) fn new(source: &'a Source, options: &InputOptions) -> Option<PointSurvey<'a>> {
        if source.chunks() == 0 {
            return None;
        }
        let steps = [0, 1, 2].map(|axis| steps_of(source, axis));
        let rules = measuring_rules(source, options, steps)?;
        let bounds = options.rectangle().and_then(|bounds| source.raw_bounds(bounds));
        Some(PointSurvey { source, rules: PointRules { bounds, numbered: true, ..rules }, steps })
    }

    /// Returns the box outside which a point is a mistake if such points are few; `None` if there are too few points to tell.
    pub(crate) fn plausible_box(&self) -> Result<Option<RowBox>> {
        Ok(self.middle()?.and_then(|middle| plausible_box(&middle.bounds, 1.0)))
    }

    /// Returns where most points lie, by a sample; `None` if there are too few to tell.
    pub(crate) fn middle(&self) -> Result<Option<Middle>> {
        Ok(Middle::of(self.sample()?))
    }

    /// Tells whether `plausible` holds all that the source claims, as far as the job wants it.
    pub(crate) fn holds_claim(&self, plausible: &RowBox, [min, max]: SourceBox) -> bool {
        let (mut min, mut max) = (min, max);
        if let Some(bounds) = &self.rules.bounds {
            for axis in 0..2 {
                min[axis] = min[axis].max(self.source.axes[axis].value(bounds.min[axis]));
                max[axis] = max[axis].min(self.source.axes[axis].value(bounds.max[axis]));
            }
        }
        plausible.holds_box(&RowBox { min, max })
    }

    /// Looks at all points: which lie outside `plausible`, and where the others lie.
    pub(crate) fn measure(&self, plausible: &RowBox) -> Result<MeasuredPoints> {
        let cells = self.cells_of(plausible);
        let Split { within, outside, first_in, .. } = self.split(&cells)?;
        let raw = |corner: [i32; 3]| [0, 1, 2].map(|axis| i64::from(corner[axis]).saturating_mul(self.steps[axis]));
        let is_one_place = outside.bounds.is_some_and(|bounds| bounds.min == bounds.max);
        let rows = outside.points;
        Ok(MeasuredPoints {
            plausible: (rows > 0).then(|| RawBox { min: raw(cells.min), max: raw(cells.max) }),
            content: fingerprint_of(vec![FileSamples::of(&self.source.path)?]),
            outliers: Outliers { rows, places: if is_one_place { rows.min(1) } else { rows } },
            first_in,
            points: within.points + outside.points,
            rest: within.bounds.map(|bounds| self.source_box(bounds)),
            all: within.and(outside).bounds.map(|bounds| self.source_box(bounds)),
            remedy: String::new(),
        })
    }

    /// Looks at all points: how many lie within a box, how many outside, and where.
    pub(crate) fn split_at(&self, within: &RowBox) -> Result<SplitBoxes> {
        let Split { within, outside, first, .. } = self.split(&self.cells_of(within))?;
        let of = |group: PointGroup| (group.points, group.bounds.map(|bounds| self.source_box(bounds)));
        Ok(SplitBoxes { within: of(within), outside: of(outside), first })
    }

    /// Returns the number of records that a look at all points decodes.
    pub(crate) fn records(&self) -> u64 {
        self.source.decoded_chunks(self.rules.bounds.as_ref()).records
    }

    /// Returns the places of a sample of points, in source units.
    pub(crate) fn sample(&self) -> Result<Vec<[f64; 3]>> {
        let chunks = self.source.chunks();
        let places = chunks.min(SAMPLED_CHUNKS);
        let spread: Vec<usize> = (0..places).map(|place| (2 * place + 1) * chunks / (2 * places)).collect();
        let each = SAMPLED_RECORDS / places;
        let first = self.first_points(&spread, each as u64, each)?;
        if first.len() >= ENOUGH || places == chunks {
            return Ok(first);
        }
        let each = (SAMPLED_RECORDS / chunks).max(LEAST_OF_CHUNK);
        self.first_points(&(0..chunks).collect::<Vec<_>>(), u64::MAX, each)
    }

    /// Returns the places of up to `most` points among the first `records` records of each of these chunks.
    fn first_points(&self, chunks: &[usize], records: u64, most: usize) -> Result<Vec<[f64; 3]>> {
        let look = |&chunk: &usize| {
            interrupt::check()?;
            let mut found: Vec<[f64; 3]> = Vec::new();
            self.source.decode_start(chunk, records, &self.rules, &mut |points| {
                let room = most - found.len().min(most);
                found.extend(points.iter().take(room).map(|p| self.values([p.position[0], p.position[1], p.z])));
                Ok(())
            })?;
            Ok(found)
        };
        Ok(chunks.par_iter().map(look).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
    }

    fn split(&self, cells: &Bounds<3>) -> Result<Split> {
        let holds = |place: &[i32; 3]| (0..3).all(|axis| (cells.min[axis]..=cells.max[axis]).contains(&place[axis]));
        let look = |chunk: usize| {
            interrupt::check()?;
            let mut split = Split::default();
            self.source.decode(chunk, &self.rules, &mut |points| {
                for point in points {
                    let place = [point.position[0], point.position[1], point.z];
                    if holds(&place) {
                        split.within.see(place);
                    } else {
                        split.outside.see(place);
                        split.first = split.first.or(Some(point.order()));
                    }
                }
                Ok(())
            })?;
            split.first_in = (split.outside.points > 0).then_some(chunk);
            Ok(split)
        };
        let _ahead = self.source.read_ahead(self.rules.bounds.as_ref(), false)?;
        // The reduction keeps the order of the chunks.
        (0..self.source.chunks()).into_par_iter().map(look).try_reduce(Split::default, |a, b| Ok(a.and(b)))
    }

    fn step(&self, axis: usize) -> f64 {
        to_float(self.source.axes[axis].scale) * self.steps[axis] as f64
    }

    fn values(&self, place: [i32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| to_float(self.source.axes[axis].offset) + f64::from(place[axis]) * self.step(axis))
    }

    /// Returns a box in steps of the survey.
    fn cells_of(&self, values: &RowBox) -> Bounds<3> {
        let cell = |axis: usize, value: f64| (value - to_float(self.source.axes[axis].offset)) / self.step(axis);
        Bounds {
            min: [0, 1, 2].map(|axis| cell(axis, values.min[axis]).floor() as i32),
            max: [0, 1, 2].map(|axis| cell(axis, values.max[axis]).ceil() as i32),
        }
    }

    /// Returns a box in source units around all points that the survey has put into `bounds`, half a step farther out.
    fn source_box(&self, bounds: Bounds<3>) -> SourceBox {
        let [min, max] = [bounds.min, bounds.max].map(|corner| self.values(corner));
        let half = |axis: usize| self.step(axis) / 2.0;
        [[0, 1, 2].map(|axis| min[axis] - half(axis)), [0, 1, 2].map(|axis| max[axis] + half(axis))]
    }
}

/// Returns how many steps of an axis one of the survey is long. Binary files have integers of 32 bits, and of a text all numbers are known.
fn steps_of(source: &Source, axis: usize) -> i64 {
    let farthest = match source.format {
        FileFormat::Text => source.min[axis].abs().max(source.max[axis].abs()),
        FileFormat::Las | FileFormat::Laz | FileFormat::Ept => 0.0,
    };
    let scale = to_float(source.axes[axis].scale);
    let mut steps = MEASURE;
    while farthest / (scale * steps as f64) > FARTHEST && steps < i64::MAX / 10 {
        steps *= 10;
    }
    steps
}
