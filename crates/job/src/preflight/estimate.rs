//! Estimates of the disk and the memory that a job needs.

use crate::durable::directory::JobDirectory;
use crate::levels::hierarchy::{BYTES_PER_LEVEL_VERTEX, LevelSizes};
use crate::machine;
use crate::options::JobOptions;
use crate::partition::tree_builder::buffer_bytes;
use crate::plan::budget::{BYTES_PER_LEAF_SITE, network_memory, read_buffer_memory, selection_memory};
use crate::plan::job_plan::{Plan, PlannedInput};
use crate::preflight::contour_estimate::ContourEstimate;
use crate::preflight::kept_points::{KeptPoints, has_filter};
use crate::publish::contours::write_contours::contour_memory;
use crate::publish::exports::export_limits::most_triangles;
use crate::publish::map_tiles::check::planned_map_tiles;
use crate::publish::map_tiles::write_map_tiles::map_tile_memory;
use crate::publish::raster::check::planned_raster;
use crate::publish::raster::write_raster::raster_memory;
use crate::publish::terrain_tiles::write_terrain::terrain_memory;
use crate::tiles::vertex_colors::photo_memory;
use delaunay::geometry::Bounds;
use points::is_url;
use selection::MOST_SWAPPED;
use std::path::{Path, PathBuf};
use tiles::Compression;
use tiles::attributes::AttributeChoice;
use tiles::color::HeightRange;
use tiles::options::{ExportFormat, MaxEdge, MaxError, OutputFormat, OutputOptions};
use tiles::preview::canvas::{Canvas, PreviewPixel, longer_side};
use tiles::raster::options::RasterCompression;
use tiles::raster::products::RasterProduct;

/// Bytes that the packed point file takes for a point; 9 to 10 where points are dense.
const BYTES_PER_POINT: u64 = 12;
/// Bytes that the store takes for a site: its packed position, colour and class, and two packed triangles.
const STORE_PER_SITE: u64 = 9 + 2 * 4;
/// Bytes that the store takes for a site on a tile's frontier, in all records that it is in.
const STORE_PER_BORDER_SITE: u64 = 500;
/// Bytes of the journal and the plan of a small job, and of what the files of the store take to whole blocks of the disk.
const OWN_FILES: u64 = 128 << 10;
/// Bytes of a GLB besides its arrays.
const RESULT_PER_TILE: u64 = 6000;
/// Bytes of a file of a raster besides its cells, and of its entry in the list of files.
const RASTER_FILE: u64 = 2000;
/// Bytes of the preview for a pixel: its colours where neighbours have nothing in common.
const PREVIEW_PER_PIXEL: u64 = 3;
/// Bytes of the page that shows the terrain.
const PAGE: u64 = 1 << 20;
/// Bytes that a process takes before it has done anything.
const PROCESS_MEMORY: u64 = 64 << 20;

/// Bytes that an intensity takes, packed as the values of points are.
const PACKED_INTENSITY: u64 = 2;

/// Returns the bytes of results for a site: position, normal, colour, these attributes and two triangles with 16-bit corners. Quantized
/// positions take 8 bytes, and 12 in wide tiles; normals and colours take 4 or 8 each, and few tiles have all at their widest.
fn result_per_site(compression: Compression, attributes: AttributeChoice) -> u64 {
    let count = u64::from(attributes.classification) + u64::from(attributes.intensity);
    match compression {
        Compression::None => 12 + 12 + 8 + 2 * 6 + count * 4,
        Compression::Quantized => 12 + 8 + 4 + 2 * 6 + count * 4,
        // What it takes for dense clouds, and half as much again for others.
        Compression::Meshopt => 15 + count * 2,
    }
}

/// About how many bytes a job's files take.
pub(crate) struct DiskEstimate {
    /// The point file and the store, as much of them as there is at one time.
    pub(crate) temporary: u64,
    /// The results.
    pub(crate) results: u64,
    /// The least that the disk must have for all together.
    pub(crate) least: u64,
}

impl DiskEstimate {
    /// Returns the estimate for the job of `plan` with at most `kept` points. A `terrain.glb` is written for up to `max_one_file`
    /// triangles.
    pub(crate) fn of(
        plan: &Plan,
        kept: KeptPoints,
        max_one_file: u64,
        contours: Option<&ContourEstimate>,
    ) -> DiskEstimate {
        let (points, tiles) = (kept.0, tiles(plan, kept));
        let options = &plan.options;
        let intensity = if options.output.attributes.intensity { PACKED_INTENSITY } else { 0 };
        let (point_file, leaves) = (points * (BYTES_PER_POINT + intensity), points * (STORE_PER_SITE + intensity));
        let per_tile = most_per_tile(plan);
        let pixels = preview_pixels(plan);
        let border = border_bytes(points, per_tile, tiles) + pixels * size_of::<PreviewPixel>() as u64 + OWN_FILES;
        let store = leaves + border;
        let (raster, map_tiles) = (raster_bytes(plan), map_tile_bytes(plan));
        let in_tiles = tile_bytes(points, tiles, &options.output, max_one_file, points > per_tile);
        let page = if options.output.page { PAGE } else { 0 };
        let (exports, mesh) = export_bytes(points, &options.output);
        let in_contours = contours.map_or(0, ContourEstimate::disk);
        let terrain = terrain(points, &options.output);
        let terrain_temporary = terrain.map_or(0, |_| points * WAITING_PER_POINT);
        let results = in_tiles
            + pixels * PREVIEW_PER_PIXEL
            + page
            + raster
            + map_tiles
            + exports
            + in_contours
            + terrain.unwrap_or(0);
        // The raster goes together before the map tiles, these before the mesh is numbered, that is done before contour lines are traced, and terrain tiles
        // come last.
        let beside =
            raster.max(map_tiles).max(mesh).max(contours.map_or(0, ContourEstimate::temporary)).max(terrain_temporary);
        // Leaves go while the results grow, unless all stay.
        let keeps_leaves = options.output.max_edge == MaxEdge::Auto || plan.keeps_mesh();
        let most = if keeps_leaves { store } else { border + waiting_leaves(plan, points, leaves, tiles) };
        // The points of a part stay until it is meshed; those of all others are gone by the last.
        let of_last = point_file / points.max(1) * points.min(plan.points_per_part());
        let in_selection = point_file + selection_bytes(points, options);
        let temporary = in_selection.max(most + of_last.max(beside));
        DiskEstimate { temporary, results, least: in_selection.max(most + results + of_last.max(beside)) }
    }
}

/// Returns the most bytes that a selection from so many points has in its file.
fn selection_bytes(points: u64, options: &JobOptions) -> u64 {
    // Of blocks whose points are all selected, with room to grow. Selected points are there for their region, and for the whole.
    const PER_POINT: u64 = 600;
    const PER_SELECTED: u64 = 24;
    const PER_POINT_IN_MEMORY: u64 = 330;
    let fits = points * PER_POINT_IN_MEMORY <= selection_memory(options);
    if options.output.max_error == MaxError::None || fits {
        0
    } else {
        (points * PER_POINT).min(MOST_SWAPPED) + points * PER_SELECTED
    }
}

/// Bytes of the files in which terrain tiles wait, for a point: 8 a vertex of a piece and of a tile, 6 a triangle, and more along borders.
const WAITING_PER_POINT: u64 = 56;

/// Returns about how many bytes the terrain tiles of a mesh of so many points take; `None` if there are to be none.
pub(crate) fn terrain(points: u64, output: &OutputOptions) -> Option<u64> {
    // Measured on autzen.laz: 18 bytes a point for all zooms.
    const PER_POINT: u64 = 24;
    output.terrain.map(|_| points * PER_POINT)
}

/// Returns the bytes of leaves whose tiles are not written yet, at most at one time. Tiles along the borders of large parts of the
/// tree wait until these parts are joined.
fn waiting_leaves(plan: &Plan, points: u64, leaves: u64, tiles: u64) -> u64 {
    if points > plan.points_per_part() {
        // All tiles along the border of a part wait, a fifth of some hundred.
        return leaves / 4;
    }
    const SHARE: u64 = 20;
    leaves / tiles.isqrt().max(SHARE) * SHARE
}

/// Returns about how many tiles there will be: tiles come out between half full and full.
pub(crate) fn tiles(plan: &Plan, kept: KeptPoints) -> u64 {
    (kept.0 * 4).div_ceil(most_per_tile(plan) * 3)
}

/// Returns the most points that a tile may have.
fn most_per_tile(plan: &Plan) -> u64 {
    plan.options.triangulation.max_points_per_tile.0.min(plan.points_per_part())
}

/// Returns the bytes of the records that stay until the job is done.
fn border_bytes(points: u64, per_tile: u64, tiles: u64) -> u64 {
    // A tile of n sites has about 2.2 sqrt(n) on its frontier, and more where points lie in rows.
    let border_sites = (2.5 * (per_tile.min(points) as f64).sqrt()) as u64 * tiles;
    border_sites * STORE_PER_BORDER_SITE
}

/// Returns the most pixels of the preview: those of the box in the headers. What a filter leaves of the points may have any other.
fn preview_pixels(plan: &Plan) -> u64 {
    if has_filter(plan) {
        return longer_side() * longer_side();
    }
    let [[xmin, ymin], [xmax, ymax]] = [plan.extent.min, plan.extent.max];
    let bounds = plan.with_lines(Bounds { min: [xmin, ymin, 0], max: [xmax, ymax, 0] });
    let size = Canvas::new(&plan.frame, bounds, HeightRange { low: 0, high: 0 }, longer_side()).size();
    size.map(u64::from).iter().product()
}

/// Returns the bytes of the tiles, the coarser ones and `terrain.glb`. `has_levels` tells whether there are coarser tiles.
fn tile_bytes(points: u64, tiles: u64, output: &OutputOptions, max_one_file: u64, has_levels: bool) -> u64 {
    let (compression, attributes) = (output.packing(), output.attributes);
    let in_tiles = points * result_per_site(compression, attributes) + tiles * RESULT_PER_TILE;
    let in_levels = if has_levels && output.levels { in_tiles / 3 } else { 0 };
    // terrain.glb is never packed with meshopt.
    let unpacked = if compression == Compression::None { Compression::None } else { Compression::Quantized };
    let has_one_file = output.format != OutputFormat::Tiles3d && 2 * points <= max_one_file;
    let in_one_file = if has_one_file { points * result_per_site(unpacked, attributes) } else { 0 };
    in_tiles + in_levels + in_one_file
}

/// Returns the bytes of the raster. While it is put together, its blocks take as many once more. All files of a grid of files count, because
/// the headers of the inputs do not tell which will have no height.
fn raster_bytes(plan: &Plan) -> u64 {
    let Some((options, grid)) = plan.options.output.raster.zip(planned_raster(plan)) else { return 0 };
    let files = grid.files(options.cells_per_file);
    let stored: u64 = files.iter().map(|cells| grid.part(*cells).stored_cells()).sum();
    let heads = files.len() as u64 * RASTER_FILE;
    let of_product = |product: RasterProduct| match options.compression {
        RasterCompression::None => stored * u64::from(product.bits() / 8) + heads,
        // Three bytes for a cell of rough terrain, and a third more for overviews. Cells without a height take a thousandth.
        RasterCompression::Deflate => grid.cells() * u64::from(product.bits() / 8) + stored / 200 + heads,
    };
    options.products.iter().map(of_product).sum()
}

/// Returns the bytes of the map tiles. While the archive is put together, its tiles take as many once more.
fn map_tile_bytes(plan: &Plan) -> u64 {
    // Two bytes for a pixel of rough terrain, and a third more for coarser zooms.
    planned_map_tiles(plan).map_or(0, |(_, pixels)| pixels * 8 / 3)
}

/// Returns the bytes of the exports of a mesh of so many points, and those of the numbered mesh that they are written from. A format that
/// has too many triangles is not written.
fn export_bytes(points: u64, output: &OutputOptions) -> (u64, u64) {
    /// A vertex and two triangles, each of three numbers.
    const NUMBERED: u64 = 3 * 12;
    let bytes: u64 = exports(points, output).map(|(_, bytes)| bytes).sum();
    (bytes, if bytes > 0 { points * NUMBERED } else { 0 })
}

/// Returns the formats that a mesh of so many points is written in, each with about how many bytes it takes.
pub(crate) fn exports(points: u64, output: &OutputOptions) -> impl Iterator<Item = (ExportFormat, u64)> {
    let formats = output.export.formats().filter(move |format| 2 * points <= most_triangles(*format));
    formats.map(move |format| (format, points * export_per_point(format)))
}

/// Returns the bytes of an export for a point with its two triangles.
fn export_per_point(format: ExportFormat) -> u64 {
    match format {
        // Coordinates have some ten digits, and numbers of vertices eight.
        ExportFormat::Landxml => 120,
        ExportFormat::Dxf => 400,
        ExportFormat::Obj => 85,
        ExportFormat::Ply => 3 * 8 + 3 + 2 * 13,
    }
}

/// Returns about how many bytes of memory the job of `plan` takes on `threads` threads.
pub(crate) fn memory(plan: &Plan, kept: KeptPoints, threads: usize) -> u64 {
    let (options, points) = (&plan.options, kept.0);
    let per_tile = options.triangulation.max_points_per_tile.0;
    let leaves = per_tile.min(points) * BYTES_PER_LEAF_SITE * threads as u64;
    let levels = level_memory(options, points, threads);
    let buffers = buffer_bytes(points, per_tile, read_buffer_memory(options));
    let is_remote = |input: &PlannedInput| input.source.path.to_str().is_some_and(is_url);
    let buffers = if plan.inputs.iter().any(is_remote) { buffers + network_memory(options) } else { buffers };
    PROCESS_MEMORY
        + photo_memory(options)
        + leaves
            .max(levels)
            .max(buffers)
            .max(raster_memory(plan, threads))
            .max(map_tile_memory(plan, threads))
            .max(contour_memory(plan, threads))
            .max(terrain_memory(plan, threads))
            .max(plan.ground_cells.map_or(0, |cells| cells.bytes(options)))
}

fn level_memory(options: &JobOptions, points: u64, threads: usize) -> u64 {
    let sizes = LevelSizes::new(options.output.max_points_per_level_tile.0, options.limits.memory.0);
    let one = (4 * sizes.sites).min(points) * BYTES_PER_LEVEL_VERTEX;
    if options.output.levels { (one * threads as u64).min(sizes.memory) } else { 0 }
}

/// Returns the bytes of the files that an interrupted run left and that this one takes over or replaces.
pub(crate) fn own_bytes(plan: &Plan) -> u64 {
    let directory = JobDirectory::new(&plan.options.output.directory);
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let parts = [entries(&directory.parts()), entries(&directory.points_by_part())].concat();
    let files =
        parts.iter().map(|part| entries(part)).chain([entries(directory.job()), entries(directory.join().job())]);
    bytes_of(files.flatten()) + bytes_of(directory.waiting_results())
}

/// Returns the bytes of the results of an earlier job, which stay until those of this one are whole.
pub(crate) fn earlier_bytes(plan: &Plan) -> u64 {
    bytes_of(JobDirectory::new(&plan.options.output.directory).earlier_results())
}

/// Returns the bytes of those of `paths` that are files.
fn bytes_of(paths: impl IntoIterator<Item = PathBuf>) -> u64 {
    let data = paths.into_iter().filter_map(|path| path.metadata().ok());
    data.filter(|data| data.is_file()).map(|data| data.len().min(machine::allocated(&data))).sum()
}
