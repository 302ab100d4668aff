//! Step 1 of a job: look at every input, and choose the one lattice, unit and CRS that all of them meet on.

use crate::geometry::lattice::{AxisMap, Lattice, REACH, shortest_decimal};
use crate::geometry::{Bounds, Site};
use crate::input::options::{OnBadFile, UnitChoice};
use crate::input::{self, Axis, Crs, PointRules, Source, Unit};
use crate::job::options::JobOptions;
use crate::job::partition::read::Skipped;
use crate::job::plan::extent::Area;
use crate::job::plan::lattice_choice::{self, Coarser};
use crate::output::frame::Frame;
use crate::{Error, Result};
use rayon::prelude::*;
use rust_decimal::prelude::ToPrimitive;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// A point's number in the job is kept in 40 bits.
const MOST_RECORDS: u64 = 1 << 40;

/// What the job will read and where it will put it.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The inputs, each with the rules for its points.
    pub sources: Vec<(Source, PointRules)>,
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
    /// The inputs that are left out because they are bad.
    pub skipped: Vec<Skipped>,
}

/// Looks at all inputs of `config`; `coarser` is nothing unless an earlier try failed with [`Error::TooFine`].
///
/// # Errors
/// [`Error::Config`] if there are none, or they do not go together; [`Error::Input`] if one cannot be used and bad ones are
/// not to be left out, or none is left; [`Error::Io`] if one cannot be read.
pub fn run(config: &JobOptions, coarser: Coarser) -> Result<Plan> {
    let (sources, skipped) = open_all(config)?;
    settle(sources, skipped, config, coarser)
}

/// The plan that [`run`] would have made without the inputs that step 2 has `skipped`.
///
/// # Errors
/// As [`run`].
pub fn without(plan: Plan, skipped: &[Skipped], config: &JobOptions, coarser: Coarser) -> Result<Plan> {
    let is_bad = |source: &Source| skipped.iter().any(|bad| bad.file == source.path);
    let sources = plan.sources.into_iter().map(|(source, _)| source).filter(|source| !is_bad(source));
    let is_new = |bad: &&Skipped| !plan.skipped.contains(bad);
    let all = plan.skipped.iter().chain(skipped.iter().filter(is_new)).cloned();
    settle(sources.collect(), all.collect(), config, coarser)
}

/// Makes the plan, without those of `sources` that stand in its way if bad files are to be left out.
fn settle(mut sources: Vec<Source>, mut skipped: Vec<Skipped>, config: &JobOptions, coarser: Coarser) -> Result<Plan> {
    loop {
        if let (true, Some(first)) = (sources.is_empty(), skipped.first()) {
            return Err(Error::NoTerrain(format!(
                "no input is left: all {} are bad and left out, the first of them {}: {}",
                skipped.len(),
                first.file.display(),
                first.why
            )));
        }
        match make_plan(&sources, config, coarser) {
            Err(Error::Input { path, what })
                if config.input.on_bad_file == OnBadFile::Skip && sources.iter().any(|s| s.path == path) =>
            {
                sources.retain(|source| source.path != path);
                skipped.push(Skipped { file: path, why: what });
            }
            planned => {
                let (plan, rules) = planned?;
                return Ok(Plan { sources: sources.into_iter().zip(rules).collect(), skipped, ..plan });
            }
        }
    }
}

/// A plan that does not hold the sources yet, and the rules for their points.
fn make_plan(sources: &[Source], config: &JobOptions, coarser: Coarser) -> Result<(Plan, Vec<PointRules>)> {
    let mut warnings = unreadable_names(&config.input.files);
    let of_sources = sources.iter().flat_map(|s| s.warnings.iter().map(|w| format!("{}: {w}", s.path.display())));
    warnings.extend(of_sources);
    shorten(&mut warnings);
    let records = sources.iter().map(|s| s.records).sum();
    if records >= MOST_RECORDS {
        return Err(Error::Config(format!("{records} records are more than one job can hold (2^40)")));
    }
    enough_is_there(sources, records, config)?;
    let crs = common_crs(sources)?;
    let (unit, metres) = unit_of(config.input.unit, &crs, &mut warnings)?;
    let area = Area::of(sources, config, metres)?;
    let metres_z = crs.vertical.unwrap_or(metres);
    let wanted = config.input.resolution.step();
    let lattice = lattice_choice::lattice(sources, &area, [metres, metres_z], wanted, coarser, &mut warnings)?;
    if metres_z != metres {
        warnings.push(format!(
            "heights are in another unit than x and y ({metres_z} m and {metres} m): glTF has both in metres, see metres_per_unit_z"
        ));
    }
    let frame = Frame::new(&lattice, metres, metres_z, crs.wkt.clone())?;
    let bounds = config.input.bounds.map(|b| lattice_bounds(&lattice, b.0));
    let extent = extent_of(&lattice, &area, bounds);
    let rules = rules(sources, config, &lattice, bounds)?;
    let (sources, skipped) = (Vec::new(), Vec::new());
    Ok((Plan { sources, records, lattice, extent, crs, unit, frame, warnings, skipped }, rules))
}

/// The files that `config` names, in their order, each once.
///
/// # Errors
/// [`Error::Config`] if a pattern names none.
pub fn inputs(config: &JobOptions) -> Result<Vec<PathBuf>> {
    expand(&config.input.files)
}

/// Opens all inputs; those that are bad apart if they are to be left out.
fn open_all(config: &JobOptions) -> Result<(Vec<Source>, Vec<Skipped>)> {
    let paths = inputs(config)?;
    let opened: Vec<Result<Source>> = paths.par_iter().map(|path| input::open(path, &config.input.csv)).collect();
    let (mut sources, mut skipped) = (Vec::with_capacity(opened.len()), Vec::new());
    for source in opened {
        match source {
            Err(Error::Input { path, what }) if config.input.on_bad_file == OnBadFile::Skip => {
                skipped.push(Skipped { file: path, why: what });
            }
            // What the system cannot read may be sound: leaving it out is not for this program to decide.
            source => sources.push(source?),
        }
    }
    Ok((sources, skipped))
}

/// Patterns find only names in UTF-8: says what else lies beside what they find.
fn unreadable_names(patterns: &[String]) -> Vec<String> {
    let folders: HashSet<&Path> = patterns.iter().filter_map(|p| Path::new(p).parent()).collect();
    let entries = folders.into_iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let mut names: Vec<PathBuf> = entries.map(|e| e.path()).filter(|p| p.to_str().is_none() && p.is_file()).collect();
    names.sort_unstable();
    let warning = |name: PathBuf| format!("{}: left out, because its name is not UTF-8; rename it", name.display());
    names.into_iter().map(warning).collect()
}

/// More warnings than this, one for each of thousands of files, would hide the others.
const MOST_WARNINGS: usize = 50;

fn shorten(warnings: &mut Vec<String>) {
    if warnings.len() > MOST_WARNINGS {
        let more = warnings.len() - MOST_WARNINGS;
        warnings.truncate(MOST_WARNINGS);
        warnings.push(format!("... and {more} more of the inputs"));
    }
}

/// Stops before the first point if files lack more records than are put up with: all together, or where bad ones are left
/// out, each by itself.
fn enough_is_there(sources: &[Source], records: u64, config: &JobOptions) -> Result<()> {
    let is_too_much =
        |missing: u64, records: u64| missing as f64 > config.input.max_malformed_fraction.0 * records as f64;
    let lacking = match config.input.on_bad_file {
        OnBadFile::Skip => sources.iter().find(|s| is_too_much(s.missing, s.records)),
        OnBadFile::Stop if is_too_much(sources.iter().map(|s| s.missing).sum(), records) => {
            sources.iter().find(|s| s.missing > 0)
        }
        OnBadFile::Stop => None,
    };
    match lacking {
        Some(first) => Err(Error::input(
            &first.path,
            format!(
                "says that it holds {} records, but {} of them are not there: the file is cut off or its header is wrong. Copy it \
                 again, or raise [input] max_malformed_fraction to use what is there",
                first.records, first.missing
            ),
        )),
        None => Ok(()),
    }
}

/// The files that the patterns name, in their order, each once.
fn expand(patterns: &[String]) -> Result<Vec<PathBuf>> {
    let (mut paths, mut known) = (Vec::new(), HashSet::new());
    for pattern in patterns {
        let found = files_of(pattern)?;
        if found.is_empty() {
            return Err(Error::Config(format!("[input] files: {}", nothing_at(pattern))));
        }
        paths.extend(found.into_iter().filter(|path| known.insert(path.clone())));
    }
    Ok(paths)
}

/// The files that a pattern names; one that names none may be a file's name that only looks like a pattern.
fn files_of(pattern: &str) -> Result<Vec<PathBuf>> {
    let found = glob::glob(pattern).map_err(|e| Error::Config(format!("[input] files: {pattern}: {e}")))?;
    let mut files = Vec::new();
    for path in found {
        files.push(path.map_err(|e| Error::io("read", e.path().to_path_buf())(e.into()))?);
    }
    files.retain(|path| path.is_file());
    if files.is_empty() && Path::new(pattern).is_file() {
        files.push(pattern.into());
    }
    Ok(files)
}

fn nothing_at(pattern: &str) -> String {
    if Path::new(pattern).is_dir() {
        let folder = pattern.trim_end_matches('/');
        format!("{pattern} is a directory; name the files in it, for example {folder}/*.laz")
    } else {
        format!("there is no file {pattern}")
    }
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
        (UnitChoice::Foot, _) | (UnitChoice::Auto, Unit::Foot) => Ok(("foot", Unit::FOOT)),
        (UnitChoice::UsFoot, _) | (UnitChoice::Auto, Unit::UsFoot) => Ok(("us-foot", Unit::US_FOOT)),
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

fn rules(
    sources: &[Source],
    config: &JobOptions,
    lattice: &Lattice,
    bounds: Option<[i32; 4]>,
) -> Result<Vec<PointRules>> {
    let rgb = matches!(
        config.output.color,
        crate::output::options::ColorChoice::Auto | crate::output::options::ColorChoice::Rgb
    );
    let bounds = bounds.map(|[west, south, east, north]| Bounds { min: [west, south], max: [east, north] });
    let mut first_order = 0;
    let mut rules = Vec::with_capacity(sources.len());
    for source in sources {
        let maps = [axis_map(source, 0, lattice)?, axis_map(source, 1, lattice)?, axis_map(source, 2, lattice)?];
        rules.push(PointRules { maps, classes: config.input.kept_classes(), bounds, first_order, rgb });
        first_order += source.records;
    }
    Ok(rules)
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
