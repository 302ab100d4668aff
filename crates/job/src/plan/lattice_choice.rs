//! Choosing the job's lattice: as fine as the inputs, as long as the mesh can be written.

use crate::plan::extent::{Extent, to_float};
use delaunay::geometry::REACH;
use lattice::{Lattice, shortest_decimal};
use points::Source;
use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};
use sys::{Error, Result, Warnings};
use tiles::frame::Frame;

/// What earlier attempts at the job showed: by how many powers of ten the lattice is coarser than it would be, because a finer one
/// proved too fine for the mesh, and whether headers can be believed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LatticeCoarsening {
    /// In x and y.
    pub horizontal: u32,
    /// In z.
    pub vertical: u32,
    /// Whether every point is looked at before the plane is cut into parts, because a header proved wrong, or a file that is to be left out
    /// bad.
    #[serde(default)]
    pub measured: bool,
    /// Whether every point is looked at before the lattice is chosen, because some lie far outside what headers claim.
    #[serde(default)]
    pub far_points: bool,
}

/// What a lattice is to be like.
pub(crate) struct LatticeRequest {
    /// The length of the unit of x and y, and of that of z.
    pub(crate) metres: [f64; 2],
    /// The step in x and y, and the step in z, that the user sets.
    pub(crate) steps: [Option<Decimal>; 2],
    /// How much coarser than the inputs ask for.
    pub(crate) coarsening: LatticeCoarsening,
}

/// Returns the lattice for `sources` within `extent`. A warning says what had to be rounded.
///
/// # Errors
/// [`Error::Config`] if a wanted step does not fit, or no step does.
pub(crate) fn choose_lattice(
    sources: &[Source],
    extent: &Extent,
    wish: &LatticeRequest,
    warnings: &mut Warnings,
) -> Result<Lattice> {
    let horizontal = horizontal_step(sources, extent, wish)?;
    let vertical = vertical_step(sources, extent, wish)?;
    if horizontal.step != horizontal.finest {
        let (step, finest) = (horizontal.step, horizontal.finest);
        let size = extent.size(0).max(extent.size(1));
        warnings.push(format!(
            "x and y are rounded to {step}, and the inputs have {finest}: glTF's single precision allows no finer step over {size:.0} \
             units; fix: [input] bounds for a smaller area, if that is too coarse"
        ));
    }
    if vertical.step != vertical.finest {
        let (step, finest, size) = (vertical.step, vertical.finest, extent.size(2));
        warnings.push(format!(
            "heights are rounded to {step}, and the inputs have {finest}: glTF's single precision allows no finer step over {size:.0} \
             units; fix: [input] heights without stray points, if that is too coarse"
        ));
    }
    place(sources, extent, horizontal.step, vertical.step)
}

/// A step that has been chosen.
struct ChosenStep {
    step: Decimal,
    /// The step without anything that makes it coarser.
    finest: Decimal,
    /// Whether a triangle across the whole extent can be written in steps of `finest`.
    lossless: bool,
    /// The step in which such a triangle can be written. If there is one, the mesh will need it.
    writable: Decimal,
}

/// How well a lattice can hold an extent.
pub(crate) struct Fineness {
    /// In x and y, and in z; `None` if no lattice can.
    steps: [Option<ChosenStep>; 2],
    /// The length of the unit of x and y, and of that of z.
    metres: [f64; 2],
}

/// A step in metres. Nobody misses what is finer, so nothing is left out of a lattice for the sake of a finer step.
const MEANINGFUL: f64 = 0.00101;

/// A step in metres. A lattice this coarse or coarser is no lattice for points that one other point makes it so coarse for.
const USELESS: f64 = 0.099;

/// A step in metres. If the inputs are rounded to a coarser one, the user should know which point makes them that wide.
const COARSE: f64 = 0.0101;

/// Returns how well a lattice can hold `extent`.
pub(crate) fn fineness(sources: &[Source], extent: &Extent, wish: &LatticeRequest) -> Fineness {
    let steps = [horizontal_step(sources, extent, wish).ok(), vertical_step(sources, extent, wish).ok()];
    Fineness { steps, metres: wish.metres }
}

impl Fineness {
    /// Returns whether each step holds what the inputs mean, or is so fine that nobody misses the rest.
    pub(crate) fn is_meaningful(&self) -> bool {
        self.steps.iter().zip(self.metres).all(|(step, metres)| step.as_ref().is_some_and(|step| step.is_fine(metres)))
    }

    /// Returns whether a step will be so coarse that the points make no terrain, if one of them is as far out as the extent says, or there
    /// is none.
    pub(crate) fn is_useless(&self) -> bool {
        let is_useless = |(step, metres): (&Option<ChosenStep>, f64)| {
            step.as_ref().is_none_or(|step| !step.lossless && to_float(step.writable) * metres >= USELESS)
        };
        self.steps.iter().zip(self.metres).any(is_useless)
    }

    /// Returns whether a step is coarsened to more than a centimetre.
    pub(crate) fn is_coarse(&self) -> bool {
        let is_coarse = |(step, metres): (&Option<ChosenStep>, f64)| {
            step.as_ref().is_some_and(|s| s.step != s.finest && to_float(s.step) * metres > COARSE)
        };
        self.steps.iter().zip(self.metres).any(is_coarse)
    }

    /// Returns whether the lattice is finer than that of `other` where that one is coarse, or the mesh will let it be, or it holds what that
    /// one does not.
    pub(crate) fn is_better_than(&self, other: &Fineness) -> bool {
        let is_better = |((own, others), metres): ((&Option<ChosenStep>, &Option<ChosenStep>), f64)| match (own, others)
        {
            (Some(own), Some(others)) => {
                let is_finer = own.step < others.step || own.writable < others.writable;
                !others.is_fine(metres) && (is_finer || own.lossless && !others.lossless)
            }
            (own, others) => own.is_some() && others.is_none(),
        };
        self.steps.iter().zip(&other.steps).zip(self.metres).any(is_better)
    }
}

impl ChosenStep {
    fn is_fine(&self, metres: f64) -> bool {
        self.lossless || to_float(self.step) * metres <= MEANINGFUL
    }
}

/// Places a lattice with these steps: its offset is near the middle of the extent in x and y and at its foot in z, and the inputs'
/// own grids meet it.
fn place(sources: &[Source], extent: &Extent, resolution: Decimal, resolution_z: Decimal) -> Result<Lattice> {
    let middle = |axis: usize| (extent.min[axis] + extent.max[axis]) / 2.0;
    let offset = [
        lattice_point_near(middle(0), phase(sources, 0, resolution)?, resolution)?,
        lattice_point_near(middle(1), phase(sources, 1, resolution)?, resolution)?,
        lattice_point_near(extent.min[2].floor(), phase(sources, 2, resolution_z)?, resolution_z)?,
    ];
    Lattice::new(offset, resolution, resolution_z).ok_or_else(|| {
        Error::Config(format!(
            "coordinates in steps of {resolution} (z: {resolution_z}) need more digits than this program has: check the scales of \
             the inputs, or set [input] resolution"
        ))
    })
}

/// Tells whether 64-bit floating point separates coordinates up to `farthest` from those a step away.
fn is_told_apart(farthest: f64, step: f64) -> bool {
    farthest / step < 1.0 / f64::EPSILON
}

/// The length that the longest triangle is expected to have before the mesh is known, as a fraction of the extent. Only a hull edge
/// from one end of the extent to the other is longer.
const LIKELY_SPAN: f64 = 0.8;

/// A step in metres. No scanner measures x and y more finely, so finer steps of a wide extent may be coarsened without asking.
const FINE_ENOUGH: f64 = 0.0099;

/// Returns the step in x and y: the one that the user sets, or else the finest of the inputs with which a triangle across the whole
/// extent can be written. A step of a centimetre or more is not coarsened for that reason; there the mesh itself decides
/// ([`crate::Error::TooFine`]).
fn horizontal_step(sources: &[Source], extent: &Extent, wish: &LatticeRequest) -> Result<ChosenStep> {
    let metres = wish.metres[0];
    let size = extent.size(0).max(extent.size(1));
    let farthest = extent.farthest(0).max(extent.farthest(1));
    let fits =
        |step: Decimal| size < 2.0 * REACH as f64 * 0.99 * to_float(step) && is_told_apart(farthest, to_float(step));
    let is_writable = |step: Decimal| LIKELY_SPAN * size * metres < Frame::longest_at(to_float(step) * metres);
    if let Some(step) = wish.steps[0] {
        return if fits(step) {
            Ok(ChosenStep { step, finest: step, lossless: true, writable: step })
        } else {
            Err(too_fine(step, size, farthest))
        };
    }
    let finest = sources.iter().flat_map(|s| [s.axes[0].scale, s.axes[1].scale]).min().unwrap_or(Decimal::ONE);
    let scales = common_step(sources, |source, axis| source.axes[axis].scale);
    let grids = common_step(sources, |source, axis| source.grid[axis]);
    let lossless = [scales, grids].into_iter().flatten().find(|&step| fits(step) && is_writable(step));
    let finest = lossless.unwrap_or(finest);
    let mut step = finest;
    while !fits(step) || (!is_writable(step) && to_float(step) * metres < FINE_ENOUGH) {
        step = times_power_of_ten(step, 1)?;
    }
    let mut writable = step;
    while !is_writable(writable) {
        writable = times_power_of_ten(writable, 1)?;
    }
    step = times_power_of_ten(step, wish.coarsening.horizontal)?;
    Ok(ChosenStep { step, finest, lossless: lossless.is_some(), writable })
}

fn too_fine(step: Decimal, size: f64, farthest: f64) -> Error {
    Error::Config(format!(
        "[input] resolution = {step} is too fine for an area of {size:.0} units with coordinates up to {farthest:.0}: the area may \
         have at most 2^30 steps, and must lie within 2^52 steps of zero"
    ))
}

/// Returns the step in z: the one that the user sets, or else the finest of the inputs with which all heights between the lowest and
/// the highest can be written.
fn vertical_step(sources: &[Source], extent: &Extent, wish: &LatticeRequest) -> Result<ChosenStep> {
    let metres = wish.metres[1];
    let fits = |step: Decimal| {
        extent.size(2) * metres < Frame::longest_at(to_float(step) * metres)
            && is_told_apart(extent.farthest(2), to_float(step))
    };
    if let Some(step) = wish.steps[1] {
        return if fits(step) {
            Ok(ChosenStep { step, finest: step, lossless: true, writable: step })
        } else {
            Err(Error::Config(format!(
                "[input] resolution_z = {step} is too fine for heights from {} to {}: floating point cannot hold them in such steps; \
                 set a coarser one, or \"auto\"",
                extent.min[2], extent.max[2]
            )))
        };
    }
    let finest = sources.iter().map(|s| s.axes[2].scale).min().unwrap_or(Decimal::ONE);
    let mut step = finest;
    while !fits(step) {
        step = times_power_of_ten(step, 1)?;
    }
    let (lossless, writable) = (step == finest, step);
    step = times_power_of_ten(step, wish.coarsening.vertical)?;
    Ok(ChosenStep { step, finest, lossless, writable })
}

/// Returns the largest step on which the points of all inputs lie, where `step_of` gives the step of one input on one axis: the
/// greatest common divisor of these steps and of the distances between the inputs' offsets. `None` if it takes too many digits.
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

/// Returns the greatest common divisor of two decimals, by Euclid's algorithm.
fn divisor(mut a: Decimal, mut b: Decimal) -> Option<Decimal> {
    while !b.is_zero() {
        (a, b) = (b, a.checked_rem(b)?);
    }
    Some(a)
}

fn times_power_of_ten(step: Decimal, power: u32) -> Result<Decimal> {
    let product = (0..power).try_fold(step, |step, _| step.checked_mul(Decimal::TEN));
    let step = product.ok_or_else(|| {
        Error::Config("the inputs span too much for any terrain: check their coordinates, or set [input] bounds".into())
    })?;
    Ok(step.normalize())
}

/// Returns where between two multiples of the step the lattice lies: the least remainder of the inputs' offsets, so that the order
/// of the files does not matter. Inputs that agree in it lose nothing.
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

/// Returns the whole number nearest to `near`; where the lattice through `phase` does not meet it, the lattice point next to it.
fn lattice_point_near(near: f64, phase: Decimal, step: Decimal) -> Result<Decimal> {
    let out_of_range = || {
        Error::Config(format!(
            "coordinates around {near:e} need more digits than this program has for steps of {step}: check the inputs"
        ))
    };
    let near = shortest_decimal(near.round()).ok_or_else(out_of_range)?;
    let steps = near.checked_sub(phase).and_then(|d| d.checked_div(step)).ok_or_else(out_of_range)?.round();
    let point = steps.checked_mul(step).and_then(|d| d.checked_add(phase)).ok_or_else(out_of_range)?;
    Ok(point.normalize())
}
