//! Making the plan: looking at every input, and choosing the lattice, unit and CRS that all of them share.

use crate::options::JobOptions;
use crate::plan::area_check::{CommonPlace, check_places};
use crate::plan::area_hint::AreaHint;
use crate::plan::breaklines::line_files::LineFiles;
use crate::plan::breaklines::{CloudOfPlan, PlannedBreaklines};
use crate::plan::budget::network_memory;
use crate::plan::clip::{ClipFile, PlannedClip};
use crate::plan::common_crs::{common_crs, horizontal_unit};
use crate::plan::extent::{Extent, SourceBox, to_float};
use crate::plan::far_points::{extent_without_outliers, farthest_file};
use crate::plan::flat_points::flat_points;
use crate::plan::geocentric_inputs::{refuse_geocentric, warn_of_degrees, warn_of_geocentric};
use crate::plan::ground_cells::{GroundCells, KnownCloud};
use crate::plan::ground_triangles::GroundTriangles;
use crate::plan::height_range::HeightSample;
use crate::plan::inputs::{check_missing_records, named_inputs, open_all};
use crate::plan::job_plan::{Claims, Plan, PlannedInput, SkippedInput, decoded_records};
use crate::plan::lattice_choice::{LatticeCoarsening, LatticeRequest, choose_lattice, fineness};
use crate::plan::measured_inputs::measured_claims;
use crate::plan::other_unit::{refuse_other_unit, warn_of_dropped_units};
use crate::plan::stray_heights::JobHeights;
use crate::plan::suspect_heights::check_suspect_heights;
use crate::plan::terrain_crowd::TerrainCrowd;
use crate::plan::terrain_sample::SampledCloud;
use crate::plan::text_inputs::{
    check_malformed_rows, check_malformed_sample, farthest_row, refuse_degrees, refuse_missing_classes,
    refuse_missing_returns, row_choice, wanted_fields,
};
use crate::plan::zero_points::refuse_zero_points;
use crs::CrsChoice;
use crs::DatumRule;
use delaunay::geometry::Bounds;
use delaunay::geometry::REACH;
use ground::MetricLattice;
use lattice::{AxisMap, Lattice, shortest_decimal};
use points::lines::line_crs::SystemOfPoints;
use points::lines::options::LineHeights;
use points::options::{OnBadFile, UnitChoice};
use points::surface_warnings::no_ground;
use points::transform_sources::transform_sources;
use points::{Axis, FileFormat, PointCounts, PointRules, Source, set_network_memory};
use rayon::prelude::*;
use rust_decimal::prelude::ToPrimitive;
use sys::{Error, Result, Warnings};
use tiles::color::HeightRange;
use tiles::frame::Frame;
use tiles::options::MaxEdge;

/// A point's number in the job is kept in 40 bits.
const MAX_RECORDS: u64 = 1 << 40;

/// More warnings than this, one for each of thousands of files, would hide the others.
const MAX_WARNINGS: usize = 50;

/// Makes the plan of the job with these `options`. `coarsening` tells what earlier attempts have shown.
///
/// # Errors
/// [`Error::Config`] if there are no inputs or they do not fit together; [`Error::Input`] if one is bad and must not be left
/// out; [`crate::Error::NoTerrain`] if none is left; [`Error::Io`] if one cannot be read.
pub fn make_plan(options: &JobOptions, coarsening: LatticeCoarsening) -> crate::Result<Plan> {
    make_plan_on(None, options, coarsening)
}

/// As [`make_plan`], on the lattice `known` if that has the points as the lattice would that is chosen without it.
///
/// # Errors
/// As [`make_plan`].
pub(crate) fn make_plan_on(
    known: Option<&Lattice>,
    options: &JobOptions,
    coarsening: LatticeCoarsening,
) -> crate::Result<Plan> {
    refuse_contradicting_options(options)?;
    set_network_memory(network_memory(options));
    let named = named_inputs(&options.input)?;
    let (sources, mut skipped) = open_all(&named.paths, &options.input, &row_choice(options))?;
    skipped.extend(named.skipped);
    let mut plan = plan_sources(sources, skipped, options, (coarsening, known))?;
    let mut notes = Warnings::default();
    notes.extend(named.notes);
    notes.shorten(MAX_WARNINGS);
    plan.warnings.extend(notes);
    Ok(plan)
}

/// Tells whether points lie so far from all others that they are mistakes, though no header claims them: whether a plan that looks at all
/// points leaves out more of them than the usual one, or a file with them.
///
/// # Errors
/// As [`make_plan`], if there are too many of them.
pub(crate) fn are_there_far_points(options: &JobOptions, coarsening: LatticeCoarsening) -> crate::Result<bool> {
    let left_out = |plan: &Plan| {
        let points = plan.inputs.iter().map(|input| input.source.outliers()).sum::<u64>();
        (points, plan.skipped.len())
    };
    let (points, files) = left_out(&make_plan(options, LatticeCoarsening { far_points: true, ..coarsening })?);
    let leaves_files_out = options.input.on_bad_file == OnBadFile::Skip && files > 0;
    if points == 0 && !leaves_files_out {
        return Ok(false);
    }
    // The usual plan may have left out the same.
    let (known_points, known_files) = left_out(&make_plan(options, coarsening)?);
    Ok(points > known_points || files > known_files)
}

/// Plans a job of `sources`. If bad files are to be left out, this leaves out those that no plan can use.
fn plan_sources(
    mut sources: Vec<Source>,
    mut skipped: Vec<SkippedInput>,
    options: &JobOptions,
    wish: (LatticeCoarsening, Option<&Lattice>),
) -> crate::Result<Plan> {
    loop {
        if let (true, Some(first)) = (sources.is_empty(), skipped.first()) {
            return Err(crate::Error::NoTerrain(format!(
                "no input is left: all {} are bad and left out, the first of them {}: {}",
                skipped.len(),
                first.file.display(),
                first.why
            )));
        }
        match try_plan(&mut sources, options, wish) {
            Err(crate::Error::System(Error::Input { path, what }))
                if options.input.on_bad_file == OnBadFile::Skip && sources.iter().any(|s| s.path == path) =>
            {
                sources.retain(|source| source.path != path);
                skipped.push(SkippedInput { file: path, why: what });
            }
            Err(crate::Error::BadInputs(bad)) => {
                sources.retain(|source| bad.iter().all(|(file, _)| *file != source.path));
                skipped.extend(bad.into_iter().map(|(file, why)| SkippedInput { file, why }));
            }
            planned => {
                let (plan, rules) = planned?;
                let planned_input = |(source, (rules, claimed))| PlannedInput { source, rules, claimed, key: 0 };
                let inputs = sources.into_iter().zip(rules).map(planned_input).collect();
                return Ok(Plan { inputs, skipped, ..plan });
            }
        }
    }
}

/// Returns a plan that does not hold the inputs yet, and the rules for the points of each, and the box that each claims.
fn try_plan(
    sources: &mut [Source],
    options: &JobOptions,
    (coarsening, known): (LatticeCoarsening, Option<&Lattice>),
) -> crate::Result<(Plan, Vec<(PointRules, Bounds<2>)>)> {
    let mut warnings = Warnings::default();
    sources.iter().for_each(|source| warnings.extend_from_file(&source.path, &source.warnings));
    warnings.shorten(MAX_WARNINGS);
    let records = sources.iter().map(|s| s.records).sum();
    if records >= MAX_RECORDS {
        return Err(Error::Config(format!("{records} records are more than one job can hold (2^40)")).into());
    }
    check_missing_records(sources, &options.input)?;
    refuse_other_unit(sources, &options.input)?;
    refuse_geocentric(sources, &options.input)?;
    transform_sources(sources, &options.input, &mut warnings)?;
    refuse_degrees(sources, &options.input)?;
    refuse_missing_classes(sources, &options.input)?;
    refuse_missing_returns(sources, &options.input)?;
    let (choice, unit_choice) = said_of_sources(options);
    let crs = common_crs(sources, &choice, unit_choice, &mut warnings)?;
    let (unit, metres) = horizontal_unit(sources, unit_choice, &choice, &crs, &mut warnings)?;
    let metres_z = crs.vertical.unwrap_or(metres);
    warn_of_geocentric(sources, &options.input, &mut warnings);
    warn_of_degrees(sources, &options.input, &mut warnings);
    warn_of_dropped_units(sources, &options.input, [metres, metres_z], &mut warnings);
    let wish = LatticeRequest {
        metres: [metres, metres_z],
        steps: [options.input.resolution.step(), options.input.resolution_z.step()],
        coarsening,
    };
    let is_known = crs.metres_per_unit().or(unit_choice.metres()).is_some();
    let height_metres = crs.vertical.or(is_known.then_some(metres));
    let system = SystemOfPoints { crs: &crs, height_metres, datums: options.input.datums };
    let lines = LineFiles::read(options, &system, &mut warnings)?;
    warnings.extend(heights_above_ground(options));
    // The outline of an area is seldom as exact as a datum, and moves no point.
    let clip = ClipFile::read(options, &SystemOfPoints { datums: DatumRule::Close, ..system }, &mut warnings)?;
    let wanted = &mut options.clone();
    let options = within_clip(wanted, clip.as_ref().map(ClipFile::area_box));
    clip.as_ref().map_or(Ok(()), |clip| clip.leave_files_aside(sources, &options.input))?;
    let mut extent = extent_without_outliers(sources, options, &wish)?;
    lines.extend_heights(&mut extent)?;
    let lattice = choose_lattice(sources, &extent, &wish, &mut warnings)?;
    let lattice = known.filter(|known| known.has_points_of(&lattice)).cloned().unwrap_or(lattice);
    let planned_clip = clip.map(|clip| clip.on_lattice(&lattice)).transpose()?;
    let wanted = &mut options.clone();
    let options = within_clip(wanted, planned_clip.as_ref().map(|clip| clip.reach));
    if fineness(sources, &extent, &wish).is_coarse() {
        let row = farthest_row(sources, options, &extent)?;
        warnings.extend(row.or_else(|| farthest_file(sources, &extent)));
    }
    if metres_z != metres && options.input.height_unit == UnitChoice::Auto {
        let other = match unit_choice {
            UnitChoice::Auto => "",
            _ => "; fix: [input] height_unit, if the unit of heights is wrong: [input] unit sets that of x and y alone",
        };
        warnings.push(format!(
            "heights are in another unit than x and y ({metres_z} m and {metres} m): the tiles have all in metres{other}"
        ));
    }
    let frame = Frame::new(&lattice, metres, metres_z, crs.wkt.clone())?;
    let within = options.input.rectangle().map(|rectangle| lattice_clip(&lattice, rectangle));
    let rules = point_rules(sources, options, &lattice, planned_clip.as_ref())?;
    check_malformed_rows(sources, &rules, options)?;
    let (clipped, claimed_area) =
        (lattice_extent(&lattice, &extent, within), claimed_area(&lattice, sources, &extent, within.is_some()));
    let sample = HeightSample::take(sources, &rules, options.input.rectangle())?;
    let hint = AreaHint { sources, options, extent: &extent, clipped, lattice: &lattice, wish: &wish };
    if hint.shows_far_points(&sample) {
        return try_plan(sources, options, (LatticeCoarsening { far_points: true, ..coarsening }, known));
    }
    check_malformed_sample(sources, &sample, &options.input)?;
    refuse_zero_points(sources, &extent, &sample, &lattice)?;
    warnings.extend(check_suspect_heights(sources, &sample, &lattice, options, metres_z)?);
    warnings.extend(flat_points(sources, &extent, &sample, &lattice));
    let heights = JobHeights {
        sources,
        rules: &rules,
        options,
        lattice: &lattice,
        extent: &extent,
        sample: &sample,
        metres: metres_z,
    };
    warnings.extend(heights.warnings()?);
    let place = CommonPlace { crs: &crs, metres, lattice: &lattice, extent: &extent, sample: &sample };
    check_places(sources, &place, &options.input, &mut warnings)?;
    let stretch = hint.stretch(&sample)?;
    warnings.extend(stretch.clone());
    let cloud = CloudOfPlan {
        sources,
        rules: &rules,
        lattice: &lattice,
        extent: &extent,
        clipped,
        area: claimed_area,
        sample: &sample.points,
        metres: wish.metres,
    };
    let breaklines = PlannedBreaklines::of(&lines, options, &cloud, &mut warnings)?;
    let decoded: u64 = sources.iter().zip(&rules).map(|(source, rules)| decoded_records(source, rules)).sum();
    let has_parts = decoded > options.triangulation.max_points_per_part.most_in_one_part();
    let (claimed, claims) = match coarsening.measured {
        true => measured_claims(sources, &rules, &lattice, options, clipped)?,
        false => (
            extent.boxes.iter().map(|claim| claimed_box(&lattice, claim, clipped)).collect::<Vec<_>>(),
            has_parts.then(|| claims(sources, &rules, &lattice, &extent, clipped)).transpose()?,
        ),
    };
    let lines_at = breaklines.as_ref().and_then(|lines| lines.bounds);
    let claims = claims.map(|claims| claims.with_lines(lines_at));
    let [low, high] = claimed_heights(&lattice, &extent).map(|z| z.round() as i32);
    let [horizontal, vertical] = frame.resolution_metres();
    let metric = MetricLattice { horizontal, vertical, offset: lattice.steps_from_zero() };
    let (sample, ground_cells) = match options.input.finds_ground() {
        true => {
            let cells = known_cells(&sample, metric, decoded, &claimed, clipped);
            cells.too_many(options).map_or(Ok(()), |why| Err(Error::Config(why)))?;
            (sample.on_ground(metric, options.input.bare_earth)?, Some(cells))
        }
        false => (sample, None),
    };
    let crowd = SampledCloud {
        crs: &crs,
        frame: &frame,
        extent: clipped,
        sample: &sample.points,
        of_place: sample.points_of_place(),
        records: decoded,
        seen: sample.seen(),
    };
    let terrain_crowd = TerrainCrowd::of(&crowd, options);
    terrain_crowd.and_then(|crowd| crowd.too_many(options)).map_or(Ok(()), |why| Err(Error::Config(why)))?;
    let heights = sample.range_within(HeightRange { low, high });
    let plan = Plan {
        claims,
        ground_cells,
        terrain_crowd,
        on_ground: GroundTriangles::default(),
        options: options.clone(),
        inputs: Vec::new(),
        skipped: Vec::new(),
        records,
        coarsening,
        extent: clipped,
        lattice,
        heights,
        sample: PointCounts {
            examples: Vec::new(),
            notes: files_without_ground(&sample, options).into_iter().collect(),
            ..sample.counts
        },
        crs,
        unit: unit.into(),
        claimed_area,
        cut: None,
        frame,
        curvature: None,
        breaklines,
        clip: planned_clip,
        stretch,
        warnings,
    };
    Ok((plan, rules.into_iter().zip(claimed).collect()))
}

/// # Errors
/// [`Error::Config`] for options that cannot be had together.
fn refuse_contradicting_options(options: &JobOptions) -> Result<()> {
    if options.output.classified && !options.input.finds_ground() {
        return Err(Error::Config(
            "[output] classified = true writes the ground that surface = \"bare-earth\" finds: set that under [input], or leave classified out"
                .into(),
        ));
    }
    if options.output.selects() && options.output.max_edge == MaxEdge::Auto {
        return Err(Error::Config(
            "[output] max_edge = \"auto\" depends on the spacing of points, and with max_error flat ground has few vertices: give \
             max_edge a \
             length such as 30.0, or leave it out"
                .into(),
        ));
    }
    Ok(())
}

/// Returns what the user should know about breaklines with heights from the points, where the mesh has those on the ground alone: they are found
/// later.
fn heights_above_ground(options: &JobOptions) -> Option<String> {
    let takes_points = options.breaklines.iter().any(|lines| lines.heights == LineHeights::Points);
    (takes_points && options.input.finds_ground()).then(|| {
        "[[breaklines]] heights = \"points\" takes the nearest points, which may be on trees and roofs, though surface = \"bare-earth\" leaves \
         those out; fix: lines with heights of their own, or classified points with surface = \"ground\""
            .into()
    })
}

/// Returns what the user says of the coordinates of the sources. Of those that are transformed, the target says all.
fn said_of_sources(options: &JobOptions) -> (CrsChoice, UnitChoice) {
    let mut choice = options.input.crs.clone();
    if let CrsChoice::Given { crs, .. } = &mut choice {
        crs.vertical = crs.vertical.or(options.input.height_unit.metres());
    }
    match options.input.to_crs {
        Some(_) => (CrsChoice::Auto, UnitChoice::Auto),
        None => (choice, options.input.unit),
    }
}

/// Returns the lattice box of a source that claims the box `claim`, within `extent`. A source that claims nothing may have points
/// everywhere.
fn claimed_box(lattice: &Lattice, claim: &Option<SourceBox>, extent: Bounds<2>) -> Bounds<2> {
    let Some([min, max]) = claim else { return extent };
    let claim = Extent { min: *min, max: *max, boxes: Vec::new() };
    let Bounds { min, max } = lattice_extent(lattice, &claim, Some(extent));
    // Rounding may be off by a step on either side.
    let [min, max] = [(min, -1), (max, 1)].map(|(corner, step)| corner.map(|value| value + step));
    let within = |corner: [i32; 2]| [0, 1].map(|axis| corner[axis].clamp(extent.min[axis], extent.max[axis]));
    Bounds { min: within(min), max: within(max) }
}

/// Returns what the sources claim of all points.
fn claims(
    sources: &[Source],
    rules: &[PointRules],
    lattice: &Lattice,
    extent: &Extent,
    clipped: Bounds<2>,
) -> Result<Claims> {
    let [low, high] = claimed_heights(lattice, extent);
    let [low, high] = [low.floor() - 1.0, high.ceil() + 1.0].map(|z| z as i32);
    let bounds = Bounds {
        min: [clipped.min[0].saturating_sub(1), clipped.min[1].saturating_sub(1), low],
        max: [clipped.max[0].saturating_add(1), clipped.max[1].saturating_add(1), high],
    };
    let first_colors = |(source, rules): (&Source, &PointRules)| {
        let chunks = source.decoded_chunks(rules.bounds.as_ref());
        if chunks.is_empty() || !rules.fields.rgb || !source.has_rgb {
            return Ok(0);
        }
        source.decode(chunks.chunk(0), rules, &mut |_| Ok(())).map(|counts| counts.max_rgb)
    };
    let max_rgb = sources.par_iter().zip(rules).map(first_colors).try_reduce(|| 0, |a, b| Ok(a.max(b)))?;
    Ok(Claims { bounds, max_rgb })
}

/// Returns a sentence about the files whose sample has no ground, if the job wants only that, and others have some.
fn files_without_ground(sample: &HeightSample, options: &JobOptions) -> Option<String> {
    let lacks_ground = |counts: &PointCounts| no_ground(&options.input, counts);
    let mut without = sample.by_file.iter().filter_map(|(path, found)| Some((path, lacks_ground(&found.counts)?)));
    let (path, what) = without.next().filter(|_| lacks_ground(&sample.counts).is_none())?;
    let others = match without.count() {
        0 => String::new(),
        count => format!(" (and so for {count} other files)"),
    };
    Some(format!("{}: no point of it is used{others}: {what}", path.display()))
}

/// Returns the least and the greatest height that the sources claim, in steps of the lattice.
fn claimed_heights(lattice: &Lattice, extent: &Extent) -> [f64; 2] {
    let offset = lattice.offset[2].to_f64().unwrap_or(0.0);
    [extent.min[2], extent.max[2]].map(|z| (z - offset) / to_float(lattice.step(2)))
}

/// Returns the lattice box of `bounds`, for the size of the job. Which points lie within them, their raw integers decide. It is inside out
/// if no lattice point is.
fn lattice_clip(lattice: &Lattice, bounds: [f64; 4]) -> Bounds<2> {
    let [xmin, ymin, xmax, ymax] = std::array::from_fn(|i| {
        let steps = shortest_decimal(bounds[i])
            .and_then(|b| b.checked_sub(lattice.offset[i % 2])?.checked_div(lattice.resolution));
        let steps = steps.map(|s| if i < 2 { s.ceil() } else { s.floor() }).and_then(|s| s.to_i64());
        // A bound beyond all numbers is as far out as sites can lie.
        let far = if bounds[i] < 0.0 { -(REACH as i64) } else { REACH as i64 };
        steps.unwrap_or(far).clamp(-(REACH as i64), REACH as i64) as i32
    });
    Bounds { min: [xmin, ymin], max: [xmax, ymax] }
}

/// Returns what is known of the cells of the ground: by a sample of the `records`, and the boxes that inputs have claimed within the `extent`.
fn known_cells(
    sample: &HeightSample,
    lattice: MetricLattice,
    records: u64,
    claimed: &[Bounds<2>],
    extent: Bounds<2>,
) -> GroundCells {
    let sides = |bounds: &Bounds<2>| [0, 1].map(|axis| bounds.extent(axis) as f64 * lattice.horizontal);
    let boxes: Vec<[f64; 2]> = claimed.iter().map(sides).collect();
    GroundCells::of(KnownCloud {
        lattice,
        boxes: &boxes,
        extent: sides(&extent),
        records,
        seen: sample.seen(),
        sample: &mut sample.points.iter().map(|([x, y], z)| [*x, *y, *z]),
    })
}

/// Returns the area of the box around all records in square lattice steps, whatever part of it the user wants.
fn claimed_area(lattice: &Lattice, sources: &[Source], extent: &Extent, has_bounds: bool) -> u64 {
    let step = lattice.resolution.to_f64().unwrap_or(1.0);
    // The box of a text is that of the wanted rows, but its numbers are known of all.
    let of_all = |(source, claim): (&Source, &Option<SourceBox>)| match source.format {
        FileFormat::Text if has_bounds && source.records > 0 => Some([source.min, source.max]),
        _ => *claim,
    };
    let boxes: Vec<SourceBox> = sources.iter().zip(&extent.boxes).filter_map(of_all).collect();
    let side = |axis: usize| {
        let low = boxes.iter().map(|[min, _]| min[axis]).fold(f64::INFINITY, f64::min);
        let high = boxes.iter().map(|[_, max]| max[axis]).fold(f64::NEG_INFINITY, f64::max);
        ((high - low).max(0.0) / step).round() + 1.0
    };
    (side(0) * side(1)) as u64
}

fn lattice_extent(lattice: &Lattice, extent: &Extent, clip: Option<Bounds<2>>) -> Bounds<2> {
    let steps = |value: f64, axis: usize| {
        let offset = lattice.offset[axis].to_f64().unwrap_or(0.0);
        ((value - offset) / lattice.resolution.to_f64().unwrap_or(1.0)).clamp(-(REACH as f64), REACH as f64) as i32
    };
    let [mut min, mut max] = [extent.min, extent.max].map(|corner| [steps(corner[0], 0), steps(corner[1], 1)]);
    if let Some(clip) = clip {
        for axis in 0..2 {
            min[axis] = min[axis].max(clip.min[axis]).min(clip.max[axis]);
            max[axis] = max[axis].min(clip.max[axis]).max(min[axis]);
        }
    }
    Bounds { min, max }
}

/// Returns the options with the box of the area that points are kept in, if there is one.
fn within_clip(options: &mut JobOptions, clip_box: Option<[f64; 4]>) -> &JobOptions {
    options.input.clip_box = clip_box;
    options
}

fn point_rules(
    sources: &[Source],
    options: &JobOptions,
    lattice: &Lattice,
    clip: Option<&PlannedClip>,
) -> Result<Vec<PointRules>> {
    let clip = clip.map(PlannedClip::area);
    let fields = wanted_fields(options);
    let (classes, returns) = (options.input.kept_classes(), options.input.kept_returns());
    let numbered = options.input.needs_numbers();
    let mut first_order = 0;
    let mut rules = Vec::with_capacity(sources.len());
    for source in sources {
        let maps = [axis_map(source, 0, lattice)?, axis_map(source, 1, lattice)?, axis_map(source, 2, lattice)?];
        let of_text = options.input.clip_box.map(|clip_box| source.raw_rectangle(clip_box));
        let bounds = options.input.rectangle().and_then(|rectangle| source.raw_bounds(rectangle)).or(of_text);
        let clip = clip.clone();
        rules.push(PointRules { maps, classes, returns, bounds, clip, first_order, numbered, fields });
        first_order += source.records;
    }
    Ok(rules)
}

fn axis_map(source: &Source, axis: usize, lattice: &Lattice) -> Result<AxisMap> {
    let Axis { offset, scale } = source.axes[axis];
    AxisMap::new(offset, scale, lattice.offset[axis], lattice.step(axis)).ok_or_else(|| {
        let name = ["x", "y", "z"][axis];
        let what = format!(
            "the {name} scale {scale} and offset {offset} have too many digits to meet the lattice exactly; rewrite the file with a \
             decimal scale such as 0.01"
        );
        Error::input(&source.path, what)
    })
}
