//! What was found about the clouds, in sentences for a configuration.

use crate::init::draft::Draft;
use crs::{Crs, Unit};
use job::plan::job_plan::Plan;
use job::preflight::check::Preflight;
use job::progress::number_text::{grouped, mebibytes};
use points::Source;
use points::surface_warnings::listed;

/// The most systems that a sentence names.
const MOST_NAMED: usize = 3;

/// What is said of the unit of z where no file says it, and no name of a column.
pub(crate) const NO_UNIT_OF_HEIGHTS: &str = "the unit of z is unknown: that of x and y is assumed";

/// A map of a zone is badly distorted over areas that are wider, in metres.
const WIDE: f64 = 1e6;

/// What was found.
pub(crate) struct Findings {
    /// How many files and points there are, and where they lie.
    pub(crate) points: Vec<String>,
    /// The unit of coordinates, and who says it.
    pub(crate) unit: String,
    /// Whether nobody says the unit.
    pub(crate) unit_is_unknown: bool,
    /// The coordinate reference system, and who says it.
    pub(crate) crs: String,
    /// The classes of a sample.
    pub(crate) classes: String,
    /// What the mesh will be.
    pub(crate) surface: String,
    /// What the job takes, and what this machine has.
    pub(crate) memory: String,
}

impl Findings {
    /// Says what was found of the clouds of `plan`.
    pub(crate) fn of(draft: &Draft, preflight: &Preflight, plan: &Plan) -> Findings {
        let sources: Vec<&Source> = plan.inputs.iter().map(|input| &input.source).collect();
        let unit_is_unknown = plan.crs.horizontal == Unit::Unknown && !draft.sets("unit");
        Findings {
            points: points(draft, &sources, preflight, plan),
            unit: unit(draft, &sources, plan, unit_is_unknown),
            unit_is_unknown,
            crs: crs(draft, &sources, plan),
            classes: classes(&sources, plan),
            surface: match &preflight.surface {
                Some(surface) => format!("Surface: {surface}."),
                None => "Surface: unknown from a sample of the points.".into(),
            },
            memory: memory(preflight),
        }
    }
}

fn points(draft: &Draft, sources: &[&Source], preflight: &Preflight, plan: &Plan) -> Vec<String> {
    let files = if sources.len() == 1 { "1 file".into() } else { format!("{} files", grouped(sources.len() as u64)) };
    let mut formats: Vec<String> = sources.iter().map(|source| format(source)).collect();
    formats.sort();
    formats.dedup();
    let unit = &preflight.unit;
    let mut said = vec![format!("{files} ({}) with {} points.", formats.join(", "), grouped(preflight.records))];
    if let Some([min, max]) = rectangle(sources) {
        let along = |axis: usize| format!("{:.2} to {:.2}", min[axis], max[axis]);
        let [width, height] = [0, 1].map(|axis| max[axis] - min[axis]);
        said.push(format!("Area: x {}, y {}: {width:.1} x {height:.1} {unit}.", along(0), along(1)));
        if draft.sets("to_crs") && width.max(height) * plan.crs.metres_per_unit().unwrap_or(1.0) > WIDE {
            said.push("Note: one map of this width is distorted at its ends: better run a job for each region.".into());
        }
    }
    said
}

fn format(source: &Source) -> String {
    let name = source.format.name();
    source.version.map_or(name.into(), |[major, minor]| format!("{name} {major}.{minor}"))
}

/// Returns the rectangle of all points as headers claim it, in the coordinates of the job.
pub(crate) fn rectangle(sources: &[&Source]) -> Option<[[f64; 2]; 2]> {
    let boxes = sources.iter().filter(|source| source.records > 0).filter_map(|source| source.claimed_rectangle());
    boxes.reduce(|[low, high], [min, max]| {
        [[low[0].min(min[0]), low[1].min(min[1])], [high[0].max(max[0]), high[1].max(max[1])]]
    })
}

fn unit(draft: &Draft, sources: &[&Source], plan: &Plan, is_unknown: bool) -> String {
    if is_unknown {
        return "Unit: no file states it, so metres are assumed. If the coordinates are in feet, set it here:".into();
    }
    let by = match sources.iter().any(|source| source.own_crs().is_named()) || plan.crs.is_named() {
        true => "from the CRS",
        false if draft.sets("unit") => "as this configuration sets it",
        false => "from the column names",
    };
    let xy = plan.crs.horizontal.name();
    match unit_of_heights(plan) {
        Some(z) => format!("Unit: {xy} in x and y, {} in z, {by}.", z.name()),
        None => format!("Unit: {xy} in x and y, {by}; {NO_UNIT_OF_HEIGHTS}."),
    }
}

/// Returns the unit of z, if a file or the configuration states it. Points that are transformed get one in any case.
pub(crate) fn unit_of_heights(plan: &Plan) -> Option<Unit> {
    let is_chosen = plan.options.input.height_unit.metres().is_some();
    let is_said = is_chosen || plan.inputs.iter().any(|input| input.source.own_crs().vertical.is_some());
    plan.crs.vertical.filter(|_| is_said).map(|metres| Unit::from_metres(Some(metres)))
}

fn crs(draft: &Draft, sources: &[&Source], plan: &Plan) -> String {
    let named: Vec<&&Source> = sources.iter().filter(|source| source.own_crs().is_named()).collect();
    if draft.chooses("crs") && !draft.sets("to_crs") {
        return format!("CRS: {}, as this configuration sets it.", plan.crs.label());
    }
    if draft.sets("crs") && !draft.sets("to_crs") {
        return "CRS: none, because the coordinates contradict that of the files.".into();
    }
    if draft.sets("to_crs") {
        return format!("CRS: {}. {}", plan.crs.label(), transformed(sources));
    }
    let (true, Some(first)) = (plan.crs.is_named(), named.first()) else {
        return "CRS: no file names one, so viewers cannot show the terrain on the globe. If you know it, set it here:"
            .into();
    };
    let heights = plan.crs.vertical_name().map_or(String::new(), |name| format!(" Heights: {name}."));
    let others = match (named.len(), sources.len()) {
        (_, 1) => String::new(),
        (some, all) if some == all => format!(" of {} and the others", first.path.display()),
        (some, all) => format!(" of {some} of {all} files, such as {}", first.path.display()),
    };
    format!("CRS: {}, from {}{others}.{heights}", plan.crs.label(), record(first))
}

/// Names the record of a file that says its system.
fn record(source: &Source) -> &'static str {
    match source.crs_is_text() {
        Ok(true) => "the well-known text (WKT)",
        Ok(false) => "the GeoTIFF keys",
        // The job will say that the file cannot be read any more.
        Err(_) => "a record",
    }
}

/// Says what is transformed.
fn transformed(sources: &[&Source]) -> String {
    let name = |crs: &Crs| if crs.is_named() { crs.label() } else { "longitude and latitude".into() };
    let mut systems: Vec<String> = sources.iter().map(|source| name(source.own_crs())).collect();
    systems.sort();
    systems.dedup();
    let more = systems.len().saturating_sub(MOST_NAMED);
    systems.truncate(MOST_NAMED);
    let more = if more > 0 { format!("; and {more} more") } else { String::new() };
    format!("The files are in {}{more}.", systems.join("; "))
}

fn classes(sources: &[&Source], plan: &Plan) -> String {
    if sources.iter().all(|source| !source.has_class) {
        return "Classes: the points have none.".into();
    }
    let of = if plan.sample.read < plan.records { " in a sample of the points" } else { "" };
    format!("Classes{of}: {}.", listed(&plan.sample))
}

fn memory(preflight: &Preflight) -> String {
    let free = |bytes: Option<u64>| bytes.map_or("unknown".into(), mebibytes);
    format!(
        "The job takes about {} of memory ({} are free on this machine), and about {} of disk while it runs ({} are free). The results: \
         about {} in about {} tile{}.",
        mebibytes(preflight.memory),
        free(preflight.memory_free),
        mebibytes(preflight.disk),
        free(preflight.disk_free),
        mebibytes(preflight.results),
        grouped(preflight.tiles),
        if preflight.tiles == 1 { "" } else { "s" }
    )
}
