//! The CRS and the units that all inputs of a job have in common.

use crate::plan::distinct_crs::DistinctCrs;
use crs::{ComparableCrs, Crs, CrsChoice, Unit, same_length};
use points::Source;
use points::options::UnitChoice;
use std::borrow::Cow;
use sys::{Error, Result, Warnings, of_inputs};

/// Lengths of units that differ by less are two kinds of foot.
const FEET_APART: f64 = 1e-5;

/// A source and what it says of its coordinates, as far as `[input] unit` does not overrule it.
struct StatedCrs<'a> {
    source: &'a Source,
    crs: Cow<'a, Crs>,
}

impl StatedCrs<'_> {
    /// `[input] unit` says what the columns of a text are in: x and y, and heights in the same unit.
    fn of(source: &Source, unit: UnitChoice) -> StatedCrs<'_> {
        let (chosen, named) = (unit.unit(), source.crs.horizontal.metres_per_unit());
        if !source.format.is_text() || chosen == Unit::Unknown {
            return StatedCrs { source, crs: Cow::Borrowed(&source.crs) };
        }
        let is_followed = |z: f64| Some(z) == named || are_feet(Unit::from_metres(Some(z)), chosen);
        let vertical = source.crs.vertical.filter(|z| !is_followed(*z));
        StatedCrs { source, crs: Cow::Owned(Crs { horizontal: Unit::Unknown, vertical, ..source.crs.clone() }) }
    }

    fn is_text(&self) -> bool {
        self.source.format.is_text()
    }
}

/// Returns the CRS of all sources. What a source does not say, the others say for it; a warning says so.
///
/// # Errors
/// [`Error::Config`] if two sources differ, or cannot be compared, and the user does not say which CRS to take.
pub fn common_crs(sources: &[Source], choice: &CrsChoice, unit: UnitChoice, warnings: &mut Warnings) -> Result<Crs> {
    warn_of_other_units(sources, choice, unit.unit(), warnings);
    let said: Vec<StatedCrs> = sources.iter().map(|source| StatedCrs::of(source, unit)).collect();
    let mut crs = match choice {
        CrsChoice::Auto => {
            let crs = agreed(&said, unit, warnings)?;
            warn_of_depths(&said, &crs, warnings);
            return Ok(crs);
        }
        CrsChoice::None => Crs::default(),
        CrsChoice::First => {
            said.iter().find(|s| s.crs.is_named()).map(|s| s.crs.clone().into_owned()).unwrap_or_default()
        }
        CrsChoice::Given { crs, .. } => {
            let doubts = crs.problems().into_iter().chain(crs.depths());
            doubts.for_each(|doubt| warnings.push(format!("[input] crs ({}): {doubt}", crs.label())));
            (**crs).clone()
        }
    };
    add_units(&mut crs, &said, choice, warnings)?;
    if *choice == CrsChoice::First {
        warn_of_gaps(&said, &crs, unit, warnings);
        warn_of_depths(&said, &crs, warnings);
    }
    if *choice == CrsChoice::None {
        return Ok(crs);
    }
    let overruled: Vec<(&StatedCrs, Vec<String>)> =
        said.iter().map(|s| (s, crs.differences(&s.crs))).filter(|(_, found)| !found.is_empty()).collect();
    if let Some((first, differences)) = overruled.first() {
        warnings.push(format!(
            "{}[input] crs ({}) overrides its CRS: {} differs in {}; fix: leave [input] crs out, if the file is right",
            of_inputs(overruled.len(), sources.len(), &first.source.path),
            if crs.is_named() { crs.label() } else { format!("a plane in {}", crs.horizontal.name()) },
            if first.crs.is_named() { first.crs.label() } else { "it".to_string() },
            differences.join(" and ")
        ));
    }
    Ok(crs)
}

/// Gives `crs`, which the user chose, the units that the choice does not say: those of the files. Without a CRS, records of one say
/// nothing, but the names of columns do.
///
/// # Errors
/// [`Error::Config`] if the files differ, unless the user wants what the first of them says.
fn add_units(crs: &mut Crs, said: &[StatedCrs], choice: &CrsChoice, warnings: &mut Warnings) -> Result<()> {
    let counts = |s: &&StatedCrs| *choice != CrsChoice::None || s.is_text();
    let is_first = *choice == CrsChoice::First;
    if crs.horizontal == Unit::Unknown {
        let length = |s: &StatedCrs| s.crs.metres_per_unit();
        if let Some((_, metres)) = one_of(said.iter().filter(counts), length, "x and y", is_first)? {
            crs.horizontal = Unit::from_metres(Some(metres));
        }
    }
    if crs.vertical.is_none()
        && let Some((of, metres)) = one_of(said.iter().filter(counts), |s| s.crs.vertical, "heights", is_first)?
    {
        crs.vertical = Some(metres);
        if matches!(choice, CrsChoice::Given { .. }) && crs.metres_per_unit() != crs.vertical {
            warnings.push(format!(
                "[input] crs ({}) has no unit of heights: {} assumed, as in {}; fix: a CRS with a vertical part, such as [input] crs = \
                 \"EPSG:26915+5703\", if that is wrong",
                crs.label(),
                Unit::from_metres(Some(metres)).name(),
                of.source.path.display()
            ));
        }
    }
    Ok(())
}

/// Returns the length that the sources say, and the first that says it.
fn one_of<'a>(
    said: impl Iterator<Item = &'a StatedCrs<'a>>,
    length: impl Fn(&StatedCrs) -> Option<f64>,
    what: &str,
    is_first: bool,
) -> Result<Option<(&'a StatedCrs<'a>, f64)>> {
    let mut lengths = said.filter_map(|s| Some((s, length(s)?)));
    let Some((first, metres)) = lengths.next() else { return Ok(None) };
    let differs = |other: f64| (other - metres).abs() > 1e-8 * metres;
    match lengths.find(|(_, other)| !is_first && differs(*other)) {
        None => Ok(Some((first, metres))),
        Some((other, others)) => Err(Error::Config(format!(
            "{} has {what} in {}, but {} has them in {}, and [input] crs has no unit for them: convert one of them, run two jobs, or \
             set [input] crs = \"first\" if the first is right",
            first.source.path.display(),
            Unit::from_metres(Some(metres)).name(),
            other.source.path.display(),
            Unit::from_metres(Some(others)).name()
        ))),
    }
}

/// Returns the CRS that all sources agree on.
fn agreed(said: &[StatedCrs], unit: UnitChoice, warnings: &mut Warnings) -> Result<Crs> {
    let distinct = DistinctCrs::of(said.iter().map(|s| &*s.crs));
    if let Some((own, other, differences)) = distinct.contradiction()? {
        return Err(two_systems(&said[own], &said[other], &differences));
    }
    // The most complete ones, whatever the order of the files.
    let systems = || distinct.systems.iter().map(|(first, comparable)| (&*said[*first].crs, comparable));
    let is_placed = |crs: &Crs| (crs.wkt.is_some(), crs.epsg.is_some(), crs.name.is_some());
    let is_high = |crs: &Crs| (crs.vertical_system.is_some(), crs.vertical.is_some());
    let text = |crs: &Crs| (crs.label(), crs.wkt.clone());
    let place = systems()
        .max_by_key(|(crs, comparable)| (comparable.datum_name().is_some(), is_placed(crs), is_high(crs), text(crs)));
    let height = systems().max_by_key(|(crs, _)| (is_high(crs), is_placed(crs), text(crs)));
    let (Some((place, comparable)), Some((height, _))) = (place, height) else { return Ok(Crs::default()) };
    let mut crs = place.clone();
    crs.vertical = crs.vertical.or(height.vertical);
    crs.vertical_system = crs.vertical_system.or_else(|| height.vertical_system.clone());
    if crs.horizontal == Unit::Unknown {
        let known = systems().map(|(crs, _)| crs.horizontal).find(|unit| *unit != Unit::Unknown);
        crs.horizontal = known.unwrap_or_default();
    }
    warn_of_gaps(said, &crs, unit, warnings);
    if let Some(datum) = comparable.datum_name() {
        let lacks_datum = |input: &usize| distinct.of_input(*input).is_some_and(ComparableCrs::lacks_datum);
        let without = (0..said.len()).filter(lacks_datum).map(|input| said[input].source).collect();
        warn_of_datums(without, said.len(), datum, warnings);
    }
    Ok(crs)
}

/// Warns about the sources `without` a datum, where others say one.
fn warn_of_datums(without: Vec<&Source>, count: usize, datum: &str, warnings: &mut Warnings) {
    if let Some(first) = without.first() {
        warnings.push(format!(
            "{} of {count} inputs have no datum, such as {}: {datum} assumed, as in the others; fix: [input] crs, if that is wrong",
            without.len(),
            first.path.display()
        ));
    }
}

fn two_systems(own: &StatedCrs, other: &StatedCrs, differences: &[String]) -> Error {
    let is_in = |said: &StatedCrs| {
        let crs = &said.crs;
        let path = said.source.path.display();
        if crs.is_named() {
            return format!("{path} is in {}", crs.label());
        }
        let z = crs.vertical.map(|metres| Unit::from_metres(Some(metres)).name());
        match (crs.horizontal, z) {
            (Unit::Unknown, Some(z)) => format!("{path} has z in {z}"),
            (unit, Some(z)) if z != unit.name() => format!("{path} has its columns in {}, and z in {z}", unit.name()),
            (unit, _) => format!("{path} has its columns in {}", unit.name()),
        }
    };
    let are_units = !own.crs.is_named() || !other.crs.is_named();
    let what_to_do = match are_units {
        true if own.crs.metres_per_unit() != other.crs.metres_per_unit() => {
            "One job takes one unit: convert one of them first, or run two jobs. If the names of columns are wrong, set [input] unit to \
             the unit of x, y and z in all text files"
        }
        true => {
            "One job takes one unit of heights: convert one of them first, or run two jobs. If one is wrong, [input] crs = \"first\" takes \
             that of the first file with a CRS, or of the first file if none has one"
        }
        false => {
            "One job takes one CRS: [input] to_crs = \"utm\" or \"EPSG:...\" transforms all points into one, or run two jobs. If a \
             record is wrong, set [input] crs to the CRS of all files, such as \"EPSG:26915\", or to \"first\" for that of the first file"
        }
    };
    let (own, other, differences) = (is_in(own), is_in(other), differences.join(" and "));
    Error::Config(format!("{own}, but {other}. They differ in {differences}. {what_to_do}"))
}

/// Warns about sources that say less than `crs`, which the others say.
fn warn_of_gaps(said: &[StatedCrs], crs: &Crs, unit: UnitChoice, warnings: &mut Warnings) {
    let count = said.len();
    let nameless: Vec<&StatedCrs> = said.iter().filter(|s| !s.crs.is_named()).collect();
    if let (true, Some(first)) = (crs.is_named(), nameless.first()) {
        warnings.push(format!(
            "{} of {count} inputs have no CRS, such as {}: {} assumed, as in the others; fix: [input] missing_crs, if that is wrong",
            nameless.len(),
            first.source.path.display(),
            crs.label()
        ));
    }
    // Of those without a CRS beside a CRS it has been said.
    let lacks_unit = |s: &&StatedCrs| s.crs.horizontal == Unit::Unknown && (s.crs.is_named() || !crs.is_named());
    let without: Vec<&StatedCrs> = said.iter().filter(lacks_unit).collect();
    if let (UnitChoice::Auto, Some(_), Some(first)) = (unit, crs.metres_per_unit(), without.first()) {
        warnings.push(format!(
            "{} of {count} inputs have no unit of length, such as {}: {} assumed, as in the others; fix: [input] unit, if that is wrong",
            without.len(),
            first.source.path.display(),
            crs.horizontal.name()
        ));
    }
    // Without a unit of height, heights are in the unit of x and y.
    let Some(metres) = crs.vertical.filter(|metres| crs.metres_per_unit() != Some(*metres)) else { return };
    let silent: Vec<&StatedCrs> = said.iter().filter(|s| s.crs.vertical.is_none()).collect();
    if let Some(first) = silent.first() {
        warnings.push(format!(
            "{} of {count} inputs have no unit of heights, such as {}: {} assumed, as in the others; fix: [input] crs with a vertical \
             part, such as \"EPSG:26915+5703\", if that is wrong",
            silent.len(),
            first.source.path.display(),
            Unit::from_metres(Some(metres)).name()
        ));
    }
}

/// Warns about files whose heights count downwards, and about those that do not say which way theirs count beside them. What the user
/// says of the CRS is no news to the user.
fn warn_of_depths(said: &[StatedCrs], crs: &Crs, warnings: &mut Warnings) {
    let count = said.len();
    let downward: Vec<(&StatedCrs, String)> = said.iter().filter_map(|s| Some((s, s.crs.depths()?))).collect();
    let Some((first, doubt)) = downward.first() else { return };
    warnings.push(format!(
        "{}{doubt}, or set [input] crs, if the record is wrong",
        of_inputs(downward.len(), count, &first.source.path)
    ));
    let silent: Vec<&StatedCrs> = said.iter().filter(|s| s.crs.vertical_system.is_none()).collect();
    if let (Some(_), Some(first)) = (crs.depths(), silent.first()) {
        warnings.push(format!(
            "{} of {count} inputs do not state whether z is a height or a depth, such as {}: a depth assumed, as in the others; fix: \
             [input] crs, if that is wrong",
            silent.len(),
            first.source.path.display()
        ));
    }
}

/// Warns about texts whose columns, and about files without a CRS whose records, state another unit than the user.
fn warn_of_other_units(sources: &[Source], choice: &CrsChoice, chosen: Unit, warnings: &mut Warnings) {
    let is_other = |source: &&Source| {
        let own = source.crs.horizontal;
        let is_text = source.format.is_text();
        let lengths = own.metres_per_unit().zip(chosen.metres_per_unit());
        // What a choice of no CRS leaves aside is named elsewhere.
        (is_text || *choice != CrsChoice::None && !source.crs.is_named())
            && lengths.is_some_and(|(own, chosen)| !same_length(own, chosen))
            && !(is_text && are_feet(own, chosen))
    };
    let others: Vec<&Source> = sources.iter().filter(is_other).collect();
    if let Some(first) = others.first() {
        warnings.push(format!(
            "{}[input] unit ({}) overrides the unit of its {} ({})",
            of_inputs(others.len(), sources.len(), &first.path),
            chosen.name(),
            if first.format.is_text() { "columns" } else { "records" },
            first.crs.horizontal.name()
        ));
    }
}

/// Returns whether both are a foot, of which a text does not say which.
fn are_feet(own: Unit, other: Unit) -> bool {
    let is_foot = |unit: Unit| unit.metres_per_unit().is_some_and(|metres| (metres - Unit::FOOT).abs() < FEET_APART);
    is_foot(own) && is_foot(other)
}

/// What to do about coordinates that are not on a map.
pub(super) const TRANSFORM: &str = "Transform the points to a projected CRS first, for example with `pdal translate \
    --writers.las.scale_x=0.01 --writers.las.scale_y=0.01 in.laz out.laz reprojection --filters.reprojection.out_srs=EPSG:...`";

/// Returns the name of the unit of x and y and its length in metres.
///
/// # Errors
/// [`Error::Config`] if the coordinates are in degrees.
pub fn horizontal_unit(
    sources: &[Source],
    choice: UnitChoice,
    chosen: &CrsChoice,
    crs: &Crs,
    warnings: &mut Warnings,
) -> Result<(&'static str, f64)> {
    // The first file that says so; none if the user does.
    let named = |is_meant: &dyn Fn(&Crs) -> bool| match sources.iter().find(|source| is_meant(&source.crs)) {
        Some(source) if !matches!(chosen, CrsChoice::Given { .. }) => format!("{}: ", source.path.display()),
        _ => String::new(),
    };
    // What the user says is no record of a file.
    let what_to_do = match chosen {
        CrsChoice::Given { .. } => "if the files are in another CRS than [input] crs, name that one",
        _ => "if the CRS record is wrong, set [input] crs to the right one",
    };
    let unit = if choice == UnitChoice::Auto { crs.horizontal } else { choice.unit() };
    if let Some(metres) = unit.metres_per_unit() {
        return Ok((key_of(unit), metres));
    }
    match unit {
        Unit::Unknown => {
            let why = match chosen {
                CrsChoice::None => {
                    "[input] crs = \"none\" ignores the units that records of coordinate systems state, and no column states one"
                }
                _ => "no input states a known unit of length",
            };
            warnings.push(format!("{why}: metres assumed; fix: set [input] unit if they are not"));
            Ok((key_of(Unit::Metre), 1.0))
        }
        _ => Err(Error::Config(format!(
            "{}the coordinates are in degrees ({}), and a Delaunay triangulation in degrees is distorted: [input] to_crs = \"utm\" or \
             \"EPSG:...\" transforms them; {what_to_do}, or set [input] crs = \"none\" and unit = \"metre\"",
            named(&|crs| crs.horizontal == Unit::Degree),
            crs.name.as_deref().unwrap_or("geographic CRS"),
        ))),
    }
}

/// Returns the name that the configuration and the report use for a unit.
fn key_of(unit: Unit) -> &'static str {
    match unit {
        Unit::Metre => "metre",
        Unit::Foot => "foot",
        Unit::UsFoot => "us-foot",
        Unit::Degree | Unit::Unknown | Unit::Other(_) => "other",
    }
}
