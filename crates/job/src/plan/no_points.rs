//! The messages for jobs without a terrain. If no point is left, it says what became of the points, and where they lie if not within the
//! bounds.

use crate::plan::height_range::may_reach;
use crate::plan::job_plan::Plan;
use crate::plan::job_plan::decoded_records;
use crate::plan::text_inputs::count;
use points::surface_warnings::no_ground;
use points::{PointCounts, Source};
use sys::Result;

/// A rectangle [xmin, ymin, xmax, ymax] in source units.
type Rectangle = [f64; 4];

/// Returns the error for a job of which no point is left.
pub fn no_point_is_left(plan: &Plan, counts: &PointCounts) -> crate::Error {
    if plan.records == 0 {
        return crate::Error::NoTerrain(format!(
            "{}no point is left to triangulate, because none is there",
            first_file(plan)
        ));
    }
    let remedy = match plan.options.input.bounds.zip(box_of_inputs(plan)) {
        _ if plan.clip.is_some() && counts.out_of_bounds + counts.outside_clip > 0 && counts.classes.is_empty() => {
            outside_clip(plan)
        }
        Some((bounds, inputs)) if counts.out_of_bounds > 0 && counts.classes.is_empty() => {
            compare(bounds.0, inputs, are_from_headers(plan))
        }
        None if counts.out_of_bounds > 0 && counts.classes.is_empty() => {
            "no height lies between those of [input] heights: correct them, in the unit of the files".into()
        }
        _ if counts.at_breaklines > 0 => {
            "all that [input] leaves lie in lakes or at lines of [[breaklines]]: leave this area out, or correct \
                                          the lakes"
                .into()
        }
        _ if counts.nodata > 0 => {
            "all heights that [input] leaves stand for nodata: name other files, or keep them with [input] nodata = \"none\"".into()
        }
        _ => no_ground(&plan.options.input, counts)
            .unwrap_or("check [input] surface, returns, classes and bounds".into()),
    };
    let other_returns = match counts.other_return {
        0 => String::new(),
        count => format!(", {count} of other returns"),
    };
    let nodata = match counts.nodata {
        0 => String::new(),
        count => format!(", {count} nodata"),
    };
    let at_breaklines = match counts.at_breaklines {
        0 => String::new(),
        dropped => format!(", {dropped} at breaklines or in lakes"),
    };
    let outside_clip = match counts.outside_clip {
        0 => String::new(),
        count => format!(", {count} outside the clip"),
    };
    crate::Error::NoTerrain(format!(
        "no point is left to triangulate: of {} read, {} are malformed, {} withheld, {} of other classes{other_returns}{nodata}, {} outside the bounds{outside_clip}{at_breaklines}; \
         {remedy}",
        counts.read, counts.malformed, counts.withheld, counts.other_class, counts.out_of_bounds
    ))
}

/// Returns the error for a job whose points make no triangle.
pub fn no_triangle(plan: &Plan) -> crate::Error {
    crate::Error::NoTerrain(format!(
        "{}the points{} make no triangle in steps of {}: a triangle takes three different places in x and y that are not on one line",
        first_file(plan),
        if plan.options.input.finds_ground() { " that bare-earth finds on the ground" } else { "" },
        plan.lattice.resolution
    ))
}

/// Names the input, or the first of them, at the beginning of a message.
fn first_file(plan: &Plan) -> String {
    let first = plan.inputs.first().map(|input| input.source.path.display());
    match (first, plan.inputs.len()) {
        (None, _) => String::new(),
        (Some(first), 1) => format!("{first}: "),
        (Some(first), count) => format!("{first} and {} more: ", count - 1),
    }
}

/// Returns the rectangle of all inputs, as far as their headers can be believed.
fn box_of_inputs(plan: &Plan) -> Option<Rectangle> {
    let sources = plan.inputs.iter().map(|input| &input.source).filter(|source| source.records > 0);
    let boxes = sources.filter_map(Source::claimed_rectangle).map(|[min, max]| [min[0], min[1], max[0], max[1]]);
    boxes.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
}

/// Returns whether the rectangle of all inputs is what headers say. Of texts it is that of their rows.
fn are_from_headers(plan: &Plan) -> bool {
    plan.inputs.iter().any(|input| !input.source.format.is_text())
}

/// The most records of which a preflight reads all, only to know whether a point is left.
const MOST_RECORDS: u64 = 1 << 24;

/// Returns the error of a job that is bound to end without a point, if that is sure before it begins: no header reaches the bounds, or a
/// sample has no point that the job keeps, and neither have all records.
///
/// # Errors
/// Those of reading.
pub(crate) fn nothing_will_be_left(plan: &Plan) -> Result<Option<crate::Error>> {
    if plan.sample.kept > 0 {
        return Ok(None);
    }
    let inputs = || plan.inputs.iter().map(|input| (&input.source, &input.rules));
    let bounds = plan.rectangle();
    let (within, beyond): (Vec<_>, Vec<_>) = inputs().partition(|(source, _)| may_reach(source, bounds));
    if within.iter().map(|(source, rules)| decoded_records(source, rules)).sum::<u64>() > MOST_RECORDS {
        return Ok(None);
    }
    let out_of_bounds = beyond.iter().map(|(source, _)| source.records).sum();
    let mut counts = PointCounts { read: out_of_bounds, out_of_bounds, ..PointCounts::default() };
    for (source, rules) in within {
        counts += count(source, rules)?;
    }
    Ok((counts.kept == 0).then(|| no_point_is_left(plan, &counts)))
}

/// Returns a sentence about the area of the clip, and where the points are.
fn outside_clip(plan: &Plan) -> String {
    let Some((clip, inputs)) = plan.clip.as_ref().zip(box_of_inputs(plan)) else {
        return "no point lies within the polygons of [input] clip".into();
    };
    let crs = match plan.crs.is_named() {
        true => format!(" in {}", plan.crs.label()),
        false => String::new(),
    };
    let by_headers = if are_from_headers(plan) { " by their headers" } else { "" };
    let (area, rectangle) = (rounded(clip.area_box), rounded(inputs));
    let bounds = match plan.options.input.bounds {
        Some(bounds) => format!(", [input] bounds are {:?}", bounds.0),
        None => String::new(),
    };
    format!(
        "the polygons of [input] clip ({}) lie in {area}{crs}{bounds}, and{by_headers} the inputs lie in {rectangle}{}",
        clip.file.display(),
        hint_of_exchange(clip.area_box, inputs, "the polygons have x before y in their file")
    )
}

/// Returns a hint if rectangles meet only with x and y exchanged, for which there is a `rule`.
fn hint_of_exchange(wanted: Rectangle, inputs: Rectangle, rule: &str) -> String {
    let exchanged = [inputs[1], inputs[0], inputs[3], inputs[2]];
    match meet(wanted, exchanged) && !meet(wanted, inputs) {
        true => format!("; x and y look exchanged: {rule}"),
        false => String::new(),
    }
}

/// Returns a rectangle as a text, rounded outwards, so that it can be copied.
fn rounded(rectangle: Rectangle) -> String {
    let [xmin, ymin] = [rectangle[0], rectangle[1]].map(|low| (low * 100.0).floor() / 100.0);
    let [xmax, ymax] = [rectangle[2], rectangle[3]].map(|high| (high * 100.0).ceil() / 100.0);
    format!("[{xmin:.2}, {ymin:.2}, {xmax:.2}, {ymax:.2}]")
}

fn compare(bounds: Rectangle, inputs: Rectangle, from_headers: bool) -> String {
    let hint = hint_of_exchange(bounds, inputs, "bounds are [xmin, ymin, xmax, ymax]");
    let by_headers = if from_headers { " by their headers" } else { "" };
    let fix = if hint.is_empty() { "; fix: [input] bounds that meet this area" } else { "" };
    format!("[input] bounds are {bounds:?}, and{by_headers} the inputs lie in {}{hint}{fix}", rounded(inputs))
}

fn meet(a: Rectangle, b: Rectangle) -> bool {
    (0..2).all(|axis| a[axis] <= b[axis + 2] && b[axis] <= a[axis + 2])
}
