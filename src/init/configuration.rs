//! The text of a configuration: what was found, what is needed, and what may be changed.

use crate::init::draft::{Draft, NeededLine, quoted};
use crate::init::findings::{Findings, NO_UNIT_OF_HEIGHTS, rectangle, unit_of_heights};
use crate::init::offered_options::OfferedOptions;
use crate::init::page::Page;
use crate::init::required_options::Runnable;
use crs::Unit;
use job::plan::job_plan::Plan;
use job::preflight::check::Preflight;
use job::preflight::selection_estimate::estimated_vertices;
use job::progress::number_text::grouped;
use points::Source;
use tiles::page::is_built_in;

/// What every configuration begins with that `init` writes.
pub(crate) const FIRST_WORDS: &str = "A job for gdt-batch";

/// Returns the text of the configuration. `name` is that of its file for a shell, if it has one; `notes` are about files that are left out.
pub(crate) fn text_of(runnable: &Runnable, name: Option<&str>, notes: &[String]) -> String {
    let Runnable { draft, preflight, plan, obstacle, offers, .. } = runnable;
    let sources: Vec<&Source> = plan.inputs.iter().map(|input| &input.source).collect();
    let findings = Findings::of(draft, preflight, plan);
    let mut page = Page::default();
    head(&mut page, name);
    page.blank();
    page.set("[input]");
    findings.points.iter().for_each(|sentence| page.say(sentence));
    notes.iter().for_each(|note| page.say(&format!("Note: {note}.")));
    page.set(&files(&draft.files));
    page.need(draft.lines_of("input"));
    page.choose(draft.choices.iter());
    let warnings: Vec<&str> = preflight.warnings.iter().collect();
    if !warnings.is_empty() {
        page.blank();
        warnings.iter().for_each(|warning| page.say(&format!("Warning: {warning}.")));
    }
    about_surface(&mut page, &findings, draft, &sources, *offers);
    about_coordinates(&mut page, &findings, draft, (plan.crs.is_named(), offers.utm));
    if !draft.sets("bounds") {
        about_area(&mut page, &sources);
    }
    about_output(&mut page, draft, preflight, plan);
    page.blank();
    page.set("[limits]");
    page.say(&findings.memory);
    if let Some(obstacle) = obstacle {
        page.say(&format!("It does not fit this machine: {obstacle}."));
    }
    page.need(draft.lines_of("limits"));
    page.offer("memory = \"4 GiB\"", "peak memory of the job; this is the default");
    if !draft.sets("threads") {
        page.offer(&format!("threads = {}", preflight.threads), "fewer leave room for other work");
    }
    about_breaklines(&mut page);
    page.into_text()
}

fn head(page: &mut Page, name: Option<&str>) {
    page.say(&format!("{FIRST_WORDS}, written by the program."));
    if let Some(name) = name {
        page.show(&format!("gdt-batch check {name}"), "shows what it would do");
        page.show(&format!("gdt-batch {name}"), "runs it");
    }
    page.say("To enable an option, delete the # in front of it.");
    page.say("options.md in the manual explains all options, and full.toml has them with comments: configs/ in sources and archives, \
              share/doc/gdt-batch/ in installed packages.");
}

fn files(patterns: &[String]) -> String {
    match patterns {
        [one] => format!("files = [{}]", quoted(one)),
        many => {
            let lines: String = many.iter().map(|pattern| format!("  {},\n", quoted(pattern))).collect();
            format!("files = [\n{lines}]")
        }
    }
}

fn about_surface(page: &mut Page, findings: &Findings, draft: &Draft, sources: &[&Source], offers: OfferedOptions) {
    page.blank();
    page.say(&findings.classes);
    page.say(&findings.surface);
    if offers.ground {
        page.offer("surface = \"ground\"", "bare earth: only points on the ground and on water");
    }
    if offers.bare_earth {
        offer_unset(page, draft, "surface = \"bare-earth\"", "bare earth: a ground filter, which ignores the classes");
    }
    if sources.iter().any(|source| source.by_return.iter().skip(1).any(|count| *count > 0)) {
        offer_unset(page, draft, "surface = \"first\"", "roofs and tree tops: only first returns");
    }
}

fn about_coordinates(page: &mut Page, findings: &Findings, draft: &Draft, (is_named, utm): (bool, bool)) {
    page.blank();
    page.say(&findings.unit);
    // What is transformed takes its unit from its system, and no other unit may contradict that of a CRS.
    let is_of_crs = draft.sets("to_crs") || is_named && !findings.unit_is_unknown;
    if !is_of_crs && !draft.sets("unit") {
        let unit = if findings.unit_is_unknown { "us-foot" } else { "metre" };
        page.offer(&format!("unit = \"{unit}\""), "or \"metre\", \"foot\", \"us-foot\": overrides the files");
    }
    page.blank();
    page.say(&findings.crs);
    let what = if is_named { "the CRS of all files, if that is wrong" } else { "what all files are in" };
    if !draft.sets("crs") && !draft.sets("missing_crs") {
        page.offer("crs = \"EPSG:26915\"", what);
    }
    if utm {
        page.offer("to_crs = \"utm\"", "or a code: transforms all points into another CRS");
    }
}

/// OfferedOptions the middle of the area, to try things on.
fn about_area(page: &mut Page, sources: &[&Source]) {
    let Some([min, max]) = rectangle(sources) else { return };
    let within = |axis: usize, share: f64| min[axis] + (max[axis] - min[axis]) * share;
    let sides = [within(0, 0.25), within(1, 0.25), within(0, 0.75), within(1, 0.75)];
    let least = (sides[2] - sides[0]).min(sides[3] - sides[1]);
    let decimals = if least > 100.0 { 1 } else { 4 };
    if least > 0.001 {
        let [xmin, ymin, xmax, ymax] = sides.map(|side| format!("{side:.decimals$}"));
        page.blank();
        page.offer(
            &format!("bounds = [{xmin}, {ymin}, {xmax}, {ymax}]"),
            "for a trial: a quarter of the area, in its middle",
        );
    }
}

fn about_output(page: &mut Page, draft: &Draft, preflight: &Preflight, plan: &Plan) {
    page.blank();
    page.set("[output]");
    if preflight.disk_earlier > 0 {
        page.say("This folder has the results of an earlier job. They are kept until those of this job are complete.");
    }
    page.set(&format!("directory = {}", quoted(&draft.directory)));
    page.need(draft.lines_of("output"));
    let cell = cell(preflight);
    let raster = format!("raster = {{ resolution = {cell} }}");
    let mut offer = |option: &str, what: &str| offer_unset(page, draft, option, what);
    offer("format = \"glb\"", "one file, as for Blender; \"3dtiles\" writes tiles for the web alone");
    offer("compression = \"none\"", "plain glTF, larger: QGIS needs it");
    if let Some((option, what)) = max_error(preflight, plan) {
        offer(&option, &what);
    }
    offer("max_edge = \"auto\"", "leaves long triangles out, as over water; or a length such as 30.0");
    offer(&raster, "also writes the heights as terrain.tif, with cells of this side");
    offer("export = [\"landxml\"]", "also writes terrain.xml for CAD; \"dxf\", \"obj\" and \"ply\" for other programs");
    offer("height_offset = \"egm96\"", "if heights are above sea level: corrects them on the globe");
    offer("copyright = \"(c) whose data\"", "copyright notice in every file, shown by viewers");
    if is_built_in() {
        offer("page = true", "also writes a viewer for any web server");
    }
}

/// Offers an option, unless the job sets it.
fn offer_unset(page: &mut Page, draft: &Draft, option: &str, what: &str) {
    let key = option.split(' ').next().unwrap_or(option);
    if !draft.sets(key) {
        page.offer(option, what);
    }
}

/// Returns a bound on the error of the mesh with what it and two others lead to, if a sample of the points tells.
fn max_error(preflight: &Preflight, plan: &Plan) -> Option<(String, String)> {
    let bounds = if plan.frame.extras().metres_per_unit_z > 0.5 { [0.1, 0.3, 1.0] } else { [0.3, 1.0, 3.0] };
    let vertices = estimated_vertices(plan, preflight.kept, &bounds).ok()?;
    let triangles = |vertices: u64| grouped(2 * vertices);
    let [first, second, third] = vertices[..] else { return None };
    let what = format!(
        "fewer triangles, all points within this height of the mesh: about {} instead of {}; {}: {}, {}: {}",
        triangles(first),
        triangles(preflight.kept),
        bounds[1],
        triangles(second),
        bounds[2],
        triangles(third)
    );
    Some((format!("max_error = {}", bounds[0]), what))
}

fn about_breaklines(page: &mut Page) {
    page.blank();
    page.say("Lines that become edges of the mesh, and lakes that become flat. The three lines go together.");
    page.set("#[[breaklines]]");
    page.offer("files = [\"lines.gpkg\"]", "Shapefiles, GeoPackages or GeoJSON");
    page.offer("kind = \"line\"", "or \"river\", \"lake\"");
}

/// Returns a round side of cells, about as wide as the points are apart, and at least a lattice step.
fn cell(preflight: &Preflight) -> f64 {
    let [width, height] = preflight.size;
    let apart = (width * height / preflight.kept.max(1) as f64).sqrt();
    if !apart.is_finite() || apart < 0.001 {
        return 1.0;
    }
    let power = 10f64.powi(apart.log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|step| step * power >= apart).unwrap_or(10.0);
    // A decimal of few digits.
    format!("{:.3}", step * power).parse().unwrap_or(1.0)
}

/// Returns what the summary says of lines that are needed.
pub(crate) fn summary_of(line: &NeededLine) -> String {
    format!("{} = {}: {}", line.key, line.value, line.why)
}

/// Returns what the summary says of lines on which the user decides.
pub(crate) fn choice_of(line: &NeededLine) -> String {
    format!("#{} = {}: {}", line.key, line.value, line.why)
}

/// Returns what the summary says of the units of a job.
pub(crate) fn units_of(preflight: &Preflight, plan: &Plan) -> String {
    match plan.crs.horizontal {
        Unit::Unknown => format!("{} (not stated by the files)", preflight.unit),
        unit => match unit_of_heights(plan) {
            Some(z) => format!("{} in x and y, {} in z", unit.name(), z.name()),
            None => format!("{} in x and y; {NO_UNIT_OF_HEIGHTS}", unit.name()),
        },
    }
}
