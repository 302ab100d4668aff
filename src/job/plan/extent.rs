//! Where the points of a job lie, as far as headers can be believed.

use crate::geometry::lattice::AxisMap;
use crate::input::{Axis, FileFormat, PointRules, Source};
use crate::job::options::JobOptions;
use crate::job::partition::read::around;
use crate::output::frame::Frame;
use crate::{Result, interrupt};
use rayon::prelude::*;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use std::ops::Range;

/// The box around all inputs in source units, as far as their headers can be believed.
pub(crate) struct Area {
    /// Least x, y, z.
    pub(crate) min: [f64; 3],
    /// Greatest x, y, z.
    pub(crate) max: [f64; 3],
}

/// When the headers would have the lattice coarsened so much, the points are looked at: a header is wrong more often than that.
const SUSPICIOUS: f64 = 100.0;

impl Area {
    /// The box around `sources`: what their headers say, unless their points say otherwise.
    pub(crate) fn of(sources: &[Source], config: &JobOptions, metres: f64) -> Result<Area> {
        let classes = config.input.kept_classes();
        let boxes = sources.par_iter().map(|s| header_box(s, &classes)).collect::<Result<Vec<_>>>()?;
        let area = Area::around(&boxes, config);
        if !area.is_suspicious(sources, metres) {
            return Ok(area);
        }
        let boxes = sources.par_iter().map(|s| measure(s, &classes, 0..s.chunks())).collect::<Result<Vec<_>>>()?;
        Ok(Area::around(&boxes, config))
    }

    /// Whether the area is far too wide or too high for the inputs' steps.
    fn is_suspicious(&self, sources: &[Source], metres: f64) -> bool {
        let is_too_wide = |axis: usize| {
            let finest = sources.iter().map(|s| s.axes[axis].scale).min().unwrap_or(Decimal::ONE);
            self.size(axis) * metres > SUSPICIOUS * Frame::longest_at(to_float(finest) * metres)
        };
        (0..3).any(is_too_wide)
    }

    fn around(boxes: &[Option<[[f64; 3]; 2]>], config: &JobOptions) -> Area {
        let mut area = Area { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
        for [min, max] in boxes.iter().flatten() {
            for axis in 0..3 {
                area.min[axis] = area.min[axis].min(min[axis]);
                area.max[axis] = area.max[axis].max(max[axis]);
            }
        }
        if let Some(bounds) = config.input.bounds {
            for axis in 0..2 {
                area.min[axis] = area.min[axis].max(bounds.0[axis]);
                area.max[axis] = area.max[axis].min(bounds.0[axis + 2]);
            }
        }
        for axis in 0..3 {
            if area.min[axis] > area.max[axis] || !area.min[axis].is_finite() || !area.max[axis].is_finite() {
                (area.min[axis], area.max[axis]) = (0.0, 0.0);
            }
        }
        area
    }

    /// The greatest distance from zero along `axis`.
    pub(crate) fn farthest(&self, axis: usize) -> f64 {
        self.min[axis].abs().max(self.max[axis].abs())
    }

    /// Its extent along `axis`.
    pub(crate) fn size(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }
}

/// The box [min, max] of a source by its header, or by its points if its first piece shows that the header is wrong.
fn header_box(source: &Source, classes: &[bool; 256]) -> Result<Option<[[f64; 3]; 2]>> {
    let header = [source.min, source.max];
    if source.format == FileFormat::Text || source.chunks() == 0 {
        return Ok((source.records > 0).then_some(header));
    }
    // Two steps of the measurement for its own coarseness.
    let slack = |axis: usize| 2.0 * MEASURE as f64 * to_float(source.axes[axis].scale);
    match measure(source, classes, 0..1)? {
        Some([min, max]) if (0..3).any(|k| min[k] < header[0][k] - slack(k) || max[k] > header[1][k] + slack(k)) => {
            measure(source, classes, 0..source.chunks())
        }
        _ => Ok(Some(header)),
    }
}

/// Raw steps in a step of the measurement, so that any raw integer lies within reach.
const MEASURE: i64 = 16;

/// The box [min, max] around the points of `pieces` that have one of `classes`, to [`MEASURE`] raw steps; `None` without any.
fn measure(source: &Source, classes: &[bool; 256], pieces: Range<usize>) -> Result<Option<[[f64; 3]; 2]>> {
    let map = |axis: &Axis| AxisMap::new(axis.offset, axis.scale, axis.offset, axis.scale.checked_mul(MEASURE.into())?);
    let [Some(x), Some(y), Some(z)] = source.axes.each_ref().map(map) else {
        return Ok(Some([source.min, source.max]));
    };
    let rules = PointRules { maps: [x, y, z], classes: *classes, bounds: None, first_order: 0, rgb: false };
    let measure_piece = |piece| {
        interrupt::check()?;
        let mut found = None;
        source.decode(piece, &rules, &mut |points| {
            let boxes = points.iter().map(|p| [[p.position[0], p.position[1], p.z]; 2]);
            found = found.into_iter().chain(boxes).reduce(around);
            Ok(())
        })?;
        Ok(found)
    };
    let join = |a: Option<_>, b: Option<_>| Ok(a.into_iter().chain(b).reduce(around));
    let found = pieces.into_par_iter().map(measure_piece).try_reduce(|| None, join)?;
    let value = |axis: usize, steps: i32| source.axes[axis].value(steps as i64 * MEASURE);
    Ok(found.map(|corners| corners.map(|corner: [i32; 3]| [0, 1, 2].map(|axis| value(axis, corner[axis])))))
}

fn to_float(step: Decimal) -> f64 {
    step.to_f64().unwrap_or(f64::NAN)
}
