//! What the stages of a job usually cost, for the estimate of the time left.

use crate::plan::job_plan::Plan;
use crate::preflight::contour_estimate::ContourEstimate;
use crate::publish::map_tiles::check::planned_map_tiles;
use crate::publish::raster::check::planned_raster;
use points::FileFormat;

/// Nanoseconds of one processor for each point, measured on autzen.laz (see BENCHMARKS.md). Only their ratios matter.
const MESH: f64 = 740.0;
/// Of finding the ground.
const GROUND: f64 = 300.0;
/// Of selecting vertices: it depends on how many they are.
const SELECT: f64 = 1500.0;
const LEVELS: f64 = 900.0;
const PUBLISH: f64 = 8.0;
/// Of numbering the mesh for exports, and of writing one.
const NUMBER: f64 = 400.0;
const EXPORT: f64 = 400.0;

/// The same for each cell of a raster, and for each that is stored: with those of overviews, and those that only fill blocks.
const RASTER: f64 = 170.0;
const RASTER_STORED: f64 = 60.0;

/// The same for each pixel of map tiles of the finest zoom.
const MAP_TILES: f64 = 130.0;

/// The same for each point of contour lines, for each that is drawn for CAD programs too, and for each point of the terrain where they are
/// traced.
const CONTOURS: f64 = 200.0;
const DRAWN: f64 = 450.0;
const TRACE: f64 = 50.0;

/// Of terrain tiles.
const TERRAIN: f64 = 1500.0;

fn cost_of_reading(format: FileFormat) -> f64 {
    match format {
        FileFormat::Las => 130.0,
        FileFormat::Laz | FileFormat::Ept => 370.0,
        FileFormat::Text => 250.0,
    }
}

/// Returns the stages of the job in their order, by name, with the expected cost of each.
/// `contours` are those that the job is expected to write.
pub(crate) fn stage_costs(plan: &Plan, contours: Option<&ContourEstimate>) -> Vec<(&'static str, f64)> {
    let sources = plan.inputs.iter().map(|input| &input.source);
    let reading = sources.map(|source| source.records as f64 * cost_of_reading(source.format)).sum();
    let points = plan.records as f64;
    let raster = planned_raster(plan);
    let raster = raster.map_or(0.0, |grid| grid.cells() as f64 * RASTER + grid.stored_cells() as f64 * RASTER_STORED);
    let map_tiles = planned_map_tiles(plan).map_or(0.0, |(_, pixels)| pixels as f64 * MAP_TILES);
    let exports = match plan.options.output.export.formats().count() {
        0 => 0.0,
        formats => NUMBER + formats as f64 * EXPORT,
    };
    let ground = if plan.options.input.finds_ground() { GROUND } else { 0.0 };
    let selecting = if plan.options.output.selects() { SELECT } else { 0.0 };
    let is_drawn = plan.options.output.contours.as_ref().is_some_and(|options| options.dxf);
    let of_line_point = CONTOURS + if is_drawn { DRAWN } else { 0.0 };
    let contours = contours.map_or(0.0, |lines| lines.points as f64 * of_line_point + points * TRACE);
    let terrain = if plan.options.output.terrain.is_some() { TERRAIN } else { 0.0 };
    vec![
        ("read", reading),
        ("select", points * (ground + selecting)),
        ("mesh", points * MESH),
        ("levels", points * LEVELS),
        ("raster", raster),
        ("map tiles", map_tiles),
        ("export", points * exports),
        ("contours", contours),
        ("terrain", points * terrain),
        ("publish", points * PUBLISH),
    ]
}

/// Returns how much of the stage "mesh" is done for a tile of `points` points that is triangulated but not written.
pub(crate) fn triangulated_share(points: u64) -> u64 {
    points * 3 / 5
}
