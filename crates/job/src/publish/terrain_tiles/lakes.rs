//! The lakes of breaklines on the grid of the finest zoom.

use crate::plan::job_plan::Plan;
use crate::publish::terrain_tiles::globe_grid::GlobeGrid;
use delaunay::geometry::Site;
use quantized_mesh::Shore;
use sys::Result;

/// About how many bytes the shores of lakes take for a site of a breakline: an edge, and where it crosses rows of cells.
const BYTES_PER_SITE: u64 = 160;

/// Returns about how many bytes the shores of the lakes of a job take.
pub(super) fn shore_memory(plan: &Plan) -> u64 {
    plan.breaklines.as_ref().map_or(0, |lines| lines.findings.sites) * BYTES_PER_SITE
}

/// Returns the shores of all lakes; `None` if the job has no lake.
///
/// # Errors
/// Those of [`Plan::built_breaklines`] and of [`GlobeGrid::points`].
pub(super) fn shores_of(plan: &Plan, grid: &GlobeGrid) -> Result<Option<Vec<Shore>>> {
    let Some(lines) = plan.built_breaklines()? else { return Ok(None) };
    let (lakes, ends): (Vec<u32>, Vec<[Site; 2]>) = lines.shores().unzip();
    let positions: Vec<[i32; 3]> = ends.as_flattened().iter().map(|[x, y]| [*x, *y, 0]).collect();
    let places: Vec<[i64; 2]> = grid.points(&positions)?.iter().map(|point| [point.x, point.y]).collect();
    let shores = lakes.into_iter().zip(places.as_chunks::<2>().0).map(|(lake, ends)| Shore { lake, ends: *ends });
    let shores: Vec<Shore> = shores.collect();
    Ok((!shores.is_empty()).then_some(shores))
}
