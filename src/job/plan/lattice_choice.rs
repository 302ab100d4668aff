//! The choice of the job's lattice: as fine as the inputs, as long as the mesh can be written.

use crate::geometry::lattice::{Lattice, REACH, shortest_decimal};
use crate::input::Source;
use crate::job::plan::extent::Area;
use crate::output::frame::Frame;
use crate::{Error, Result};
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};

/// The lattice for `sources` in `area`, `metres` and `metres_z` the units of x and y and of z; `wanted` is the user's step. What had
/// to be rounded goes to `warnings`.
///
/// # Errors
/// [`Error::Config`] if a wanted step does not fit, or no step does.
pub(crate) fn lattice(
    sources: &[Source],
    area: &Area,
    [metres, metres_z]: [f64; 2],
    wanted: Option<Decimal>,
    coarser: Coarser,
    warnings: &mut Vec<String>,
) -> Result<Lattice> {
    let resolution = horizontal_step(sources, area, metres, wanted, coarser.horizontal, warnings)?;
    let resolution_z = vertical_step(sources, area, metres_z, coarser.vertical, warnings)?;
    place(sources, area, resolution, resolution_z)
}

/// How many tens coarser than it would be the lattice is to be, because it proved too fine for the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coarser {
    /// In x and y.
    pub horizontal: u32,
    /// In z.
    pub vertical: u32,
}

/// The steps as [`horizontal_step`] and [`vertical_step`] choose them; the offset near the middle of the area in x and y and at its
/// foot in z, such that the inputs' own grids meet the lattice.
fn place(sources: &[Source], area: &Area, resolution: Decimal, resolution_z: Decimal) -> Result<Lattice> {
    let middle = |axis: usize| (area.min[axis] + area.max[axis]) / 2.0;
    let offset = [
        lattice_point_near(middle(0), phase(sources, 0, resolution)?, resolution)?,
        lattice_point_near(middle(1), phase(sources, 1, resolution)?, resolution)?,
        lattice_point_near(area.min[2].floor(), phase(sources, 2, resolution_z)?, resolution_z)?,
    ];
    Lattice::new(offset, resolution, resolution_z).ok_or_else(|| {
        Error::Config(format!(
            "coordinates in steps of {resolution} (z: {resolution_z}) need more digits than this program has: check the scales of \
             the inputs, or set [input] resolution"
        ))
    })
}

/// Whether 64-bit floating-point numbers tell coordinates up to `farthest` from those a step farther.
fn is_told_apart(farthest: f64, step: f64) -> bool {
    farthest / step < 1.0 / f64::EPSILON
}

/// The share of the area's size that its longest triangle is taken to have in advance: longer ones take a hull edge from one
/// end of the area to the other.
const LIKELY_SPAN: f64 = 0.8;

/// Metres: no scanner measures x and y more finely, so a wide area may be rounded to this without asking.
const FINE_ENOUGH: f64 = 0.0099;

/// The step in x and y: what the user wants, else the finest of the inputs on which a triangle across the whole area could be
/// written, but no coarser than a centimetre for that reason; beyond it [`Error::TooFine`] decides by the mesh itself.
fn horizontal_step(
    sources: &[Source],
    area: &Area,
    metres: f64,
    wanted: Option<Decimal>,
    coarser: u32,
    warnings: &mut Vec<String>,
) -> Result<Decimal> {
    let size = area.size(0).max(area.size(1));
    let farthest = area.farthest(0).max(area.farthest(1));
    let fits = |step: Decimal| size < 2.0 * REACH as f64 * 0.99 * float(step) && is_told_apart(farthest, float(step));
    let is_writable = |step: Decimal| LIKELY_SPAN * size * metres < Frame::longest_at(float(step) * metres);
    if let Some(step) = wanted {
        return if fits(step) { Ok(step) } else { Err(too_fine(step, size, farthest)) };
    }
    let finest = sources.iter().flat_map(|s| [s.axes[0].scale, s.axes[1].scale]).min().unwrap_or(Decimal::ONE);
    let scales = common_step(sources, |source, axis| source.axes[axis].scale);
    let grids = common_step(sources, |source, axis| source.grid[axis]);
    let lossless = [scales, grids].into_iter().flatten().find(|&step| fits(step) && is_writable(step));
    let first = lossless.unwrap_or(finest);
    let mut step = first;
    while !fits(step) || (!is_writable(step) && float(step) * metres < FINE_ENOUGH) {
        step = tens(step, 1)?;
    }
    step = tens(step, coarser)?;
    if step != first {
        warnings.push(format!(
            "x and y are rounded to {step}: glTF's single precision cannot hold every triangle that an area of {size:.0} units may \
             have in steps of {first}"
        ));
    }
    Ok(step)
}

fn too_fine(step: Decimal, size: f64, farthest: f64) -> Error {
    Error::Config(format!(
        "[input] resolution = {step} is too fine for an area of {size:.0} units with coordinates up to {farthest:.0}: it may have at \
         most 2^30 steps, and lie within 2^52 steps of zero"
    ))
}

/// The step in z: the finest of the inputs on which all heights between the lowest and the highest can be written.
fn vertical_step(
    sources: &[Source],
    area: &Area,
    metres: f64,
    coarser: u32,
    warnings: &mut Vec<String>,
) -> Result<Decimal> {
    let finest = sources.iter().map(|s| s.axes[2].scale).min().unwrap_or(Decimal::ONE);
    let mut step = finest;
    let fits = |step: Decimal| {
        area.size(2) * metres < Frame::longest_at(float(step) * metres) && is_told_apart(area.farthest(2), float(step))
    };
    while !fits(step) {
        step = tens(step, 1)?;
    }
    step = tens(step, coarser)?;
    if step != finest {
        let size = area.size(2);
        warnings.push(format!(
            "heights are rounded to {step}: glTF's single precision cannot hold {size:.0} units in steps of {finest}"
        ));
    }
    Ok(step)
}

/// The largest step on which the points of all inputs lie, if those of each lie on steps of `step_of` it and an axis: the
/// greatest common divisor of these and of the distances between the inputs' offsets. `None` if that takes too many digits.
fn common_step(sources: &[Source], step_of: impl Fn(&Source, usize) -> Decimal) -> Option<Decimal> {
    let first = sources.first()?;
    let mut common = Decimal::ZERO;
    for source in sources {
        for axis in 0..2 {
            let distance = source.axes[axis].offset.checked_sub(first.axes[axis].offset)?;
            common = divisor(divisor(common, step_of(source, axis))?, distance.abs())?;
        }
    }
    Some(common.normalize())
}

/// The greatest common divisor of two decimals, by Euclid's algorithm.
fn divisor(mut a: Decimal, mut b: Decimal) -> Option<Decimal> {
    while !b.is_zero() {
        (a, b) = (b, a.checked_rem(b)?);
    }
    Some(a)
}

fn tens(step: Decimal, count: u32) -> Result<Decimal> {
    let product = (0..count).try_fold(step, |step, _| step.checked_mul(Decimal::TEN));
    let step = product.ok_or_else(|| {
        Error::Config("the inputs span too much for any terrain: check their coordinates, or set [input] bounds".into())
    })?;
    Ok(step.normalize())
}

fn float(step: Decimal) -> f64 {
    step.to_f64().unwrap_or(f64::NAN)
}

/// Where between two steps the lattice lies: the least remainder of the inputs' offsets, so that the order of the files does
/// not matter. Inputs that agree in it lose nothing.
fn phase(sources: &[Source], axis: usize, step: Decimal) -> Result<Decimal> {
    let remainder = |source: &Source| {
        let rest = source.axes[axis].offset.checked_rem(step)?;
        if rest < Decimal::ZERO { rest.checked_add(step) } else { Some(rest) }
    };
    let mut least: Option<Decimal> = None;
    for source in sources {
        let rest = remainder(source).ok_or_else(|| {
            Error::input(&source.path, format!("its offset has too many digits for the lattice step {step}"))
        })?;
        least = Some(least.map_or(rest, |l| l.min(rest)));
    }
    Ok(least.unwrap_or_default())
}

/// The whole number next to `near`, or where the lattice through `phase` does not meet it, the lattice point next to that.
fn lattice_point_near(near: f64, phase: Decimal, step: Decimal) -> Result<Decimal> {
    let out_of_range = || {
        Error::Config(format!(
            "coordinates around {near:e} have too many digits for the lattice step {step}: check the inputs"
        ))
    };
    let near = shortest_decimal(near.round()).ok_or_else(out_of_range)?;
    let steps = near.checked_sub(phase).and_then(|d| d.checked_div(step)).ok_or_else(out_of_range)?.round();
    let point = steps.checked_mul(step).and_then(|d| d.checked_add(phase)).ok_or_else(out_of_range)?;
    Ok(point.normalize())
}
