//! The box of a job's points in source units, as far as headers can be believed.

use delaunay::geometry::Bounds;
use lattice::AxisMap;
use points::options::InputOptions;
use points::{Axis, OptionalFields, PointRules, Source};
use rayon::prelude::*;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use std::ops::Range;
use sys::{Result, interrupt};
use tiles::frame::Frame;

/// The box of all inputs in source units.
pub(crate) struct Extent {
    /// Least x, y, z.
    pub(crate) min: [f64; 3],
    /// Greatest x, y, z.
    pub(crate) max: [f64; 3],
    /// The boxes of the sources by themselves; `None` for one without points.
    pub(crate) boxes: Vec<Option<SourceBox>>,
}

/// If the headers would coarsen the lattice by so much, the points are looked at: a wrong header is more likely.
const SUSPICIOUS: f64 = 100.0;

/// The box of one source in source units: its least and its greatest x, y, z.
pub(crate) type SourceBox = [[f64; 3]; 2];

impl Extent {
    /// Returns the box of `sources`: what their headers say, unless the points show that a header is wrong.
    pub(crate) fn of(sources: &[Source], options: &InputOptions, metres: f64) -> Result<Extent> {
        let boxes = sources.par_iter().map(|s| header_box(s, options)).collect::<Result<Vec<_>>>()?;
        let extent = Extent::around(boxes, options);
        if !extent.is_suspicious(sources, metres) {
            return Ok(extent);
        }
        let boxes =
            sources.par_iter().map(|s| measure(s, options, 0..s.chunks(), u64::MAX)).collect::<Result<Vec<_>>>()?;
        Ok(Extent::around(boxes, options))
    }

    /// Tells whether the box is far too wide or too high for the inputs' steps.
    fn is_suspicious(&self, sources: &[Source], metres: f64) -> bool {
        let is_too_wide = |axis: usize| {
            let finest = sources.iter().map(|s| s.axes[axis].scale).min().unwrap_or(Decimal::ONE);
            self.size(axis) * metres > SUSPICIOUS * Frame::longest_at(to_float(finest) * metres)
        };
        (0..3).any(is_too_wide)
    }

    pub(crate) fn around(boxes: Vec<Option<SourceBox>>, options: &InputOptions) -> Extent {
        let mut extent = Extent { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3], boxes };
        for [min, max] in extent.boxes.iter().flatten() {
            for axis in 0..3 {
                extent.min[axis] = extent.min[axis].min(min[axis]);
                extent.max[axis] = extent.max[axis].max(max[axis]);
            }
        }
        if let Some(bounds) = options.rectangle() {
            for axis in 0..2 {
                extent.min[axis] = extent.min[axis].max(bounds[axis]);
                extent.max[axis] = extent.max[axis].min(bounds[axis + 2]);
            }
        }
        for axis in 0..3 {
            let (min, max) = (extent.min[axis], extent.max[axis]);
            if min > max || !min.is_finite() || !max.is_finite() {
                (extent.min[axis], extent.max[axis]) = (0.0, 0.0);
            }
        }
        extent
    }

    /// Returns the greatest distance from zero along `axis`.
    pub(crate) fn farthest(&self, axis: usize) -> f64 {
        self.min[axis].abs().max(self.max[axis].abs())
    }

    /// Returns the length along `axis`.
    pub(crate) fn size(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }
}

/// Returns the box of a source by its header, or by its points if the first of them show that the header is wrong.
fn header_box(source: &Source, options: &InputOptions) -> Result<Option<SourceBox>> {
    // Every row of a text has been looked at.
    if source.format.is_text() || source.measured().is_some() {
        return Ok(source.wanted_box());
    }
    let header = [source.min, source.max];
    if source.chunks() == 0 {
        return Ok((source.records > 0).then_some(header));
    }
    // The measurement is coarse: allow for two of its steps.
    let slack = |axis: usize| 2.0 * MEASURE as f64 * to_float(source.axes[axis].scale);
    let records = if source.has_index() { SAMPLED_RECORDS } else { u64::MAX };
    match measure(source, options, 0..1, records)? {
        Some([min, max]) if (0..3).any(|k| min[k] < header[0][k] - slack(k) || max[k] > header[1][k] + slack(k)) => {
            measure(source, options, 0..source.chunks(), u64::MAX)
        }
        _ => Ok(Some(header)),
    }
}

/// The number of raw steps in a step of the measurement: every raw integer then lies within reach of the lattice.
pub(crate) const MEASURE: i64 = 16;

/// The records by which the header of a file with an index is judged. They lie all over the area, because they are those of the index's
/// root, and more of them would be read whatever the bounds.
const SAMPLED_RECORDS: u64 = 4096;

/// Returns the box of the points that have a class and a return that the job wants, among the first `records` records of each of `chunks`,
/// to within [`MEASURE`] raw steps; `None` without a point.
pub(crate) fn measure(
    source: &Source,
    options: &InputOptions,
    chunks: Range<usize>,
    records: u64,
) -> Result<Option<SourceBox>> {
    if source.format.is_text() || source.measured().is_some() {
        return Ok(source.wanted_box());
    }
    let Some(rules) = measuring_rules(source, options, [MEASURE; 3]) else {
        return Ok(Some([source.min, source.max]));
    };
    let union = |a: Option<Bounds<3>>, b| a.into_iter().chain(b).reduce(Bounds::union);
    let measure_chunk = |chunk| {
        interrupt::check()?;
        let mut found = None;
        source.decode_start(chunk, records, &rules, &mut |points| {
            let bounds = Bounds::of_points(points.iter().map(|p| [p.position[0], p.position[1], p.z]));
            found = union(found, bounds);
            Ok(())
        })?;
        Ok(found)
    };
    let _ahead = if chunks.len() == source.chunks() { Some(source.read_ahead(None, false)?) } else { None };
    let found = chunks.into_par_iter().map(measure_chunk).try_reduce(|| None, |a, b| Ok(union(a, b)))?;
    let value = |axis: usize, steps: i32| source.axes[axis].value(steps as i64 * MEASURE);
    let corner = |corner: [i32; 3]| [0, 1, 2].map(|axis| value(axis, corner[axis]));
    Ok(found.map(|bounds| [corner(bounds.min), corner(bounds.max)]))
}

/// Returns the rules for the points that have a class and a return that the job wants, wherever they lie, on a lattice that has one step
/// for so many `steps` of each axis, and the offsets of the axes; `None` if these have too many digits.
pub(crate) fn measuring_rules(source: &Source, options: &InputOptions, steps: [i64; 3]) -> Option<PointRules> {
    let map = |axis: usize| {
        let Axis { offset, scale } = source.axes[axis];
        AxisMap::new(offset, scale, offset, scale.checked_mul(steps[axis].into())?)
    };
    Some(PointRules {
        maps: [map(0)?, map(1)?, map(2)?],
        classes: options.kept_classes(),
        returns: options.kept_returns(),
        bounds: None,
        clip: None,
        first_order: 0,
        numbered: false,
        fields: OptionalFields::default(),
    })
}

/// Returns `step` as a floating-point number.
pub(crate) fn to_float(step: Decimal) -> f64 {
    step.to_f64().unwrap_or(f64::NAN)
}
