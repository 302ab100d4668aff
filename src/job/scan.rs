//! Step 1 of a job: look at every input, and choose the one lattice, unit and CRS that all of them meet on.

use crate::config::{Config, UnitChoice};
use crate::geometry::Site;
use crate::geometry::lattice::{AxisMap, Lattice, REACH, shortest_decimal};
use crate::input::{self, Axis, Crs, Rules, Source, Unit};
use crate::output::frame::Frame;
use crate::{Error, Result};
use rayon::prelude::*;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use std::path::PathBuf;

/// International foot in metres.
const FOOT: f64 = 0.3048;
/// US survey foot in metres.
const US_FOOT: f64 = 1200.0 / 3937.0;
/// A point's number in the job is kept in 40 bits.
const MOST_RECORDS: u64 = 1 << 40;

/// What the job will read and where it will put it.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The inputs, each with the rules for its points.
    pub sources: Vec<(Source, Rules)>,
    /// Records in all of them.
    pub records: u64,
    /// The lattice all sites lie on.
    pub lattice: Lattice,
    /// The lattice points between which the inputs say they lie, within `[input] bounds`.
    pub extent: [Site; 2],
    /// The CRS of the job.
    pub crs: Crs,
    /// How the unit of x and y is called.
    pub unit: &'static str,
    /// The way to glTF.
    pub frame: Frame,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Looks at all inputs of `config`; `coarser` is nothing unless an earlier try failed with [`Error::TooFine`].
///
/// # Errors
/// [`Error::Config`] if there are none, or they do not go together; [`Error::Input`] or [`Error::Io`] if one cannot be used.
pub fn run(config: &Config, coarser: Coarser) -> Result<Plan> {
    let sources = open_all(config)?;
    let mut warnings: Vec<String> = sources
        .iter()
        .flat_map(|source| source.warnings.iter().map(|w| format!("{}: {w}", source.path.display())))
        .collect();
    let records = sources.iter().map(|s| s.records).sum();
    if records >= MOST_RECORDS {
        return Err(Error::Config(format!("{records} records are more than one job can hold (2^40)")));
    }
    enough_is_there(&sources, records, config.input.malformed_share.0)?;
    let crs = common_crs(&sources)?;
    let (unit, metres) = unit_of(config.input.unit, &crs, &mut warnings)?;
    let area = Area::of(&sources, config);
    let metres_z = crs.vertical.unwrap_or(metres);
    let wanted = config.input.resolution.0;
    let step = horizontal_step(&sources, &area, metres, wanted, coarser.horizontal, &mut warnings)?;
    let step_z = vertical_step(&sources, &area, metres_z, coarser.vertical, &mut warnings)?;
    let lattice = choose_lattice(&sources, &area, step, step_z)?;
    if metres_z != metres {
        warnings.push(format!(
            "heights are in another unit than x and y ({metres_z} m and {metres} m): glTF has both in metres, see metres_per_unit_z"
        ));
    }
    let frame = Frame::new(&lattice, metres, metres_z, crs.wkt.clone())?;
    let bounds = config.input.bounds.map(|b| lattice_bounds(&lattice, b.0));
    let extent = extent_of(&lattice, &area, bounds);
    let sources = with_rules(sources, config, &lattice, bounds)?;
    Ok(Plan { sources, records, lattice, extent, crs, unit, frame, warnings })
}

fn open_all(config: &Config) -> Result<Vec<Source>> {
    let paths = expand(&config.input.files)?;
    paths.par_iter().map(|path| input::open(path, &config.input.csv)).collect()
}

/// Stops before the first point if files lack more records than are put up with.
fn enough_is_there(sources: &[Source], records: u64, malformed_share: f64) -> Result<()> {
    let missing: u64 = sources.iter().map(|s| s.missing).sum();
    match sources.iter().find(|s| s.missing > 0) {
        Some(first) if missing as f64 > malformed_share * records as f64 => Err(Error::input(
            &first.path,
            format!(
                "says that it holds {} records, but {} of them are not there: the file is cut off or its header is wrong. Copy it \
                 again, or raise [input] malformed_share to use what is there",
                first.records, first.missing
            ),
        )),
        _ => Ok(()),
    }
}

/// The files that the patterns name, in their order, each once.
fn expand(patterns: &[String]) -> Result<Vec<PathBuf>> {
    let mut paths: Vec<PathBuf> = Vec::new();
    for pattern in patterns {
        let found = glob::glob(pattern).map_err(|e| Error::Config(format!("[input] files: {pattern}: {e}")))?;
        let before = paths.len();
        for path in found {
            let path = path.map_err(|e| Error::io("read", e.path().to_path_buf())(e.into()))?;
            if path.is_file() && !paths.contains(&path) {
                paths.push(path);
            }
        }
        // A name with brackets may be meant literally.
        let literal = PathBuf::from(pattern);
        if paths.len() == before && literal.is_file() && !paths.contains(&literal) {
            paths.push(literal);
        } else if paths.len() == before && !paths.iter().any(|p| glob_matches(pattern, p)) {
            let what =
                if literal.is_dir() { "is a directory; name the files in it, for example" } else { "is no file" };
            let hint =
                if literal.is_dir() { format!(" {}/*.laz", pattern.trim_end_matches('/')) } else { String::new() };
            return Err(Error::Config(format!("[input] files: {pattern} {what}{hint}")));
        }
    }
    Ok(paths)
}

fn glob_matches(pattern: &str, path: &std::path::Path) -> bool {
    glob::Pattern::new(pattern).is_ok_and(|p| p.matches_path(path))
}

/// The CRS of all sources; those without one agree with any.
fn common_crs(sources: &[Source]) -> Result<Crs> {
    let known = |s: &&Source| s.crs != Crs::default();
    let Some(first) = sources.iter().find(known) else { return Ok(Crs::default()) };
    for other in sources.iter().filter(known) {
        if !first.crs.same_as(&other.crs) {
            let name = |s: &Source| s.crs.name.clone().unwrap_or_else(|| "an unnamed CRS".into());
            return Err(Error::Config(format!(
                "{} is in {}, but {} is in {}: one job takes one CRS, so transform one of them first or run two jobs",
                first.path.display(),
                name(first),
                other.path.display(),
                name(other),
            )));
        }
    }
    Ok(first.crs.clone())
}

/// The name and the length in metres of the unit of x and y.
fn unit_of(choice: UnitChoice, crs: &Crs, warnings: &mut Vec<String>) -> Result<(&'static str, f64)> {
    match (choice, crs.horizontal) {
        (UnitChoice::Metre, _) | (UnitChoice::Auto, Unit::Metre) => Ok(("metre", 1.0)),
        (UnitChoice::Foot, _) | (UnitChoice::Auto, Unit::Foot) => Ok(("foot", FOOT)),
        (UnitChoice::UsFoot, _) | (UnitChoice::Auto, Unit::UsFoot) => Ok(("us-foot", US_FOOT)),
        (UnitChoice::Auto, Unit::Other(metres)) => Ok(("other", metres)),
        (UnitChoice::Auto, Unit::Unknown) => {
            warnings.push(
                "no input says the unit of its coordinates; taken as metres (set [input] unit to say otherwise)".into(),
            );
            Ok(("metre", 1.0))
        }
        (UnitChoice::Auto, Unit::Degree) => Err(Error::Config(format!(
            "the coordinates are in degrees ({}), and a Delaunay triangulation in degrees is distorted: transform the points to a \
             projected CRS first, for example with `pdal translate --writers.las.scale_x=0.01 --writers.las.scale_y=0.01 in.laz out.laz \
             reprojection --filters.reprojection.out_srs=EPSG:...`; if the CRS record is wrong, set [input] unit = \"metre\"",
            crs.name.as_deref().unwrap_or("geographic CRS"),
        ))),
    }
}

/// The box around all inputs in source units, as far as their headers can be believed.
struct Area {
    min: [f64; 3],
    max: [f64; 3],
}

impl Area {
    fn of(sources: &[Source], config: &Config) -> Area {
        let mut area = Area { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
        for source in sources.iter().filter(|s| s.records > 0) {
            for axis in 0..3 {
                area.min[axis] = area.min[axis].min(source.min[axis]);
                area.max[axis] = area.max[axis].max(source.max[axis]);
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

    fn size(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }
}

/// How many tens coarser than it would be the lattice is to be, because it proved too fine for the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coarser {
    /// In x and y.
    pub horizontal: u32,
    /// In z.
    pub vertical: u32,
}

/// The steps as [`horizontal_step`] and [`vertical_step`] choose them; the offset near the middle of the area in x and y and at its
/// foot in z, such that the inputs' own grids meet the lattice.
fn choose_lattice(sources: &[Source], area: &Area, resolution: Decimal, resolution_z: Decimal) -> Result<Lattice> {
    let middle = |axis: usize| (area.min[axis] + area.max[axis]) / 2.0;
    let offset = [
        lattice_point_near(middle(0), phase(sources, 0, resolution)?, resolution)?,
        lattice_point_near(middle(1), phase(sources, 1, resolution)?, resolution)?,
        lattice_point_near(area.min[2].floor(), phase(sources, 2, resolution_z)?, resolution_z)?,
    ];
    Ok(Lattice { offset, resolution, resolution_z })
}

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
    let fits = |step: Decimal| size < 2.0 * REACH as f64 * 0.99 * float(step);
    let is_writable = |step: Decimal| size * metres < Frame::longest_at(float(step) * metres);
    if let Some(step) = wanted {
        return if fits(step) { Ok(step) } else { Err(too_fine(step, size)) };
    }
    let finest = sources.iter().flat_map(|s| [s.axes[0].scale, s.axes[1].scale]).min().unwrap_or(Decimal::ONE);
    let first = if is_writable(finest) { finest } else { common_grid(sources).unwrap_or(finest) };
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

fn too_fine(step: Decimal, size: f64) -> Error {
    Error::Config(format!(
        "[input] resolution = {step} is too fine for an area of {size:.0} units: it may have at most 2^30 steps"
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
    while area.size(2) * metres >= Frame::longest_at(float(step) * metres) {
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

/// A step on which the points of all inputs lie, if the coarsest grids of each have one in common.
fn common_grid(sources: &[Source]) -> Option<Decimal> {
    let grids = || sources.iter().flat_map(|s| s.grid);
    let step = grids().min()?;
    grids().all(|grid| grid.checked_rem(step).is_some_and(|rest| rest.is_zero())).then_some(step.normalize())
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

/// Lattice integers xmin, ymin, xmax, ymax of the points within `bounds`, borders included.
fn lattice_bounds(lattice: &Lattice, bounds: [f64; 4]) -> [i32; 4] {
    std::array::from_fn(|i| {
        let steps = shortest_decimal(bounds[i])
            .and_then(|b| b.checked_sub(lattice.offset[i % 2])?.checked_div(lattice.resolution));
        let steps = steps.map(|s| if i < 2 { s.ceil() } else { s.floor() }).and_then(|s| s.to_i64());
        // Beyond every number: as far out as sites can lie.
        let far = if bounds[i] < 0.0 { -(REACH as i64) } else { REACH as i64 };
        steps.unwrap_or(far).clamp(-(REACH as i64), REACH as i64) as i32
    })
}

fn extent_of(lattice: &Lattice, area: &Area, bounds: Option<[i32; 4]>) -> [Site; 2] {
    let steps = |value: f64, axis: usize| {
        let offset = lattice.offset[axis].to_f64().unwrap_or(0.0);
        ((value - offset) / lattice.resolution.to_f64().unwrap_or(1.0)).clamp(-(REACH as f64), REACH as f64) as i32
    };
    let mut extent = [area.min, area.max].map(|corner| [steps(corner[0], 0), steps(corner[1], 1)]);
    if let Some(b) = bounds {
        for axis in 0..2 {
            extent[0][axis] = extent[0][axis].max(b[axis]).min(b[axis + 2]);
            extent[1][axis] = extent[1][axis].min(b[axis + 2]).max(extent[0][axis]);
        }
    }
    extent
}

fn with_rules(
    sources: Vec<Source>,
    config: &Config,
    lattice: &Lattice,
    bounds: Option<[i32; 4]>,
) -> Result<Vec<(Source, Rules)>> {
    let rgb = matches!(config.output.color, crate::config::ColorChoice::Auto | crate::config::ColorChoice::Rgb);
    let mut first_order = 0;
    let mut ruled = Vec::with_capacity(sources.len());
    for source in sources {
        let maps = [axis_map(&source, 0, lattice)?, axis_map(&source, 1, lattice)?, axis_map(&source, 2, lattice)?];
        let rules = Rules { maps, classes: config.kept_classes(), bounds, first_order, rgb };
        first_order += source.records;
        ruled.push((source, rules));
    }
    Ok(ruled)
}

fn axis_map(source: &Source, axis: usize, lattice: &Lattice) -> Result<AxisMap> {
    let Axis { offset, scale } = source.axes[axis];
    AxisMap::new(offset, scale, lattice.offset[axis], lattice.step(axis)).ok_or_else(|| {
        let name = ["x", "y", "z"][axis];
        Error::input(
            &source.path,
            format!("the {name} scale {scale} and offset {offset} have too many digits to meet the lattice exactly; rewrite the file with a decimal scale such as 0.01"),
        )
    })
}
