//! About how many points contour lines have, by the meshes of some chunks of the inputs.
//!
//! A line has a point where it crosses an edge. On a slope, an edge that is half as long is crossed half as often; among trees, it is crossed
//! as often. So each sample is looked at twice, the second time with a quarter of its points, and what changes then is taken to change
//! in the same way up to the density of all points.

use crate::mesh::selection::error_bound;
use crate::plan::job_plan::Plan;
use crate::preflight::kept_points::KeptPoints;
use crate::preflight::sampled_points::{sampled_points, wanted_of};
use crate::preflight::selection_estimate::selected_points;
use crate::progress::number_text::{grouped, mebibytes, rough};
use crate::publish::contours::check::TerrainLevels;
use delaunay::geometry::Site;
use delaunay::triangulation::canonical;
use points::surface::{MeshOf, Surface};
use rayon::prelude::*;
use serde::Serialize;
use sys::{Error, Result, interrupt};
use tiles::contour_options::{ContourLevels, ContourOptions};

/// Bytes of `contours.gpkg` for a point of a line, with its share of the line and of the spatial index.
const GEOPACKAGE_PER_POINT: u64 = 32;
/// Bytes of `contours.dxf` for a point of a line: two coordinates as text, and what names them.
const DRAWING_PER_POINT: u64 = 77;
/// Bytes of a piece of a line for a point, while pieces wait to be joined.
const WAITING_PER_POINT: u64 = 18;

/// With more points of lines for a vertex than this, the lines show vegetation or noise rather than the ground.
const MANY: u64 = 10;
/// Fewer points of lines than this are no trouble.
const LARGE: u64 = 20_000_000;

/// Triangles that are so many times larger than most lie between the parts of a sample.
const GAP: i128 = 50;

/// About how large the contour lines of a job will be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ContourEstimate {
    /// Points of lines.
    pub points: u64,
    /// Bytes of the files.
    pub bytes: u64,
    /// Vertices of the mesh.
    #[serde(skip)]
    pub(crate) vertices: u64,
}

impl ContourEstimate {
    /// Returns the bytes that the disk must have for the files: some more, since a sample often shows a fifth less than there is, and a third less
    /// where flights overlap over trees.
    pub(crate) fn disk(&self) -> u64 {
        self.bytes / 2 * 3
    }

    /// Returns the bytes of temporary files.
    pub(crate) fn temporary(&self) -> u64 {
        self.points * WAITING_PER_POINT
    }

    /// Returns what is wrong if the lines are far larger than the terrain.
    pub(crate) fn warning(&self, plan: &Plan) -> Option<String> {
        let options = plan.options.output.contours.as_ref()?;
        let times = self.points / self.vertices.max(1);
        if times < MANY || self.points < LARGE {
            return None;
        }
        let interval = match &options.levels {
            ContourLevels::Interval { interval, .. } => {
                let greater = tiles::contour_options::round_up(interval.number() * times as f64 / 2.0);
                format!("[output.contours] interval = {greater:?}")
            }
            ContourLevels::Levels(_) => "fewer [output.contours] levels".into(),
        };
        let surface = match plan.options.input.mesh_of() {
            MeshOf::Surface(Surface::Ground | Surface::BareEarth) => "",
            _ => ", or [input] surface = \"ground\" or \"bare-earth\" if the points show vegetation",
        };
        Some(format!(
            "the contour lines will be large: about {} points, {times} times as many as the terrain has vertices, in {}; fix: {interval}{surface}",
            grouped(rough(self.points)),
            mebibytes(self.bytes)
        ))
    }
}

/// What samples of the points show.
#[derive(Clone, Debug)]
pub(crate) struct ContourSample {
    /// Of the points that were looked at.
    all: MeshFigures,
    /// Of a quarter of them.
    quarter: MeshFigures,
    /// The area of the job in square steps of the lattice.
    area: f64,
    has_drawing: bool,
}

/// The figures of meshes of samples.
#[derive(Clone, Copy, Debug, Default)]
struct MeshFigures {
    points: u64,
    vertices: u64,
    /// Points of lines.
    crossings: u64,
    /// Triangles but those across gaps.
    triangles: u64,
    /// Twice their area in square steps.
    double_area: i128,
}

impl MeshFigures {
    fn add(&mut self, other: MeshFigures) {
        self.points += other.points;
        self.vertices += other.vertices;
        self.crossings += other.crossings;
        self.triangles += other.triangles;
        self.double_area += other.double_area;
    }

    /// Returns how many points of lines there are for a vertex.
    fn crossings_per_vertex(&self) -> f64 {
        self.crossings as f64 / self.vertices.max(1) as f64
    }

    /// Returns the vertices in a square step of the lattice.
    fn density(&self) -> f64 {
        self.triangles as f64 / self.double_area.max(1) as f64
    }
}

impl ContourSample {
    /// Looks at samples of the points; `None` if the job writes no contour lines.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::Config`] if `max_error` has too many digits.
    pub(crate) fn of(plan: &Plan) -> Result<Option<ContourSample>> {
        let Some(options) = &plan.options.output.contours else { return Ok(None) };
        let samples = sampled_points(plan)?;
        let figures = |points: &Vec<[i32; 3]>| -> Result<[MeshFigures; 2]> {
            let quarter: Vec<[i32; 3]> = points.iter().copied().step_by(4).collect();
            Ok([figures_of(plan, options, points)?, figures_of(plan, options, &quarter)?])
        };
        let found = samples.par_iter().map(figures).collect::<Result<Vec<_>>>()?;
        let [mut all, mut quarter] = [MeshFigures::default(); 2];
        for [of_all, of_quarter] in found {
            all.add(of_all);
            quarter.add(of_quarter);
        }
        let [width, height] = [0, 1].map(|axis| plan.extent.extent(axis).max(1) as f64);
        Ok(Some(ContourSample { all, quarter, area: width * height, has_drawing: options.dxf }))
    }

    /// Returns about how large the lines of a mesh of `kept` points are.
    pub(crate) fn estimate(&self, kept: KeptPoints) -> ContourEstimate {
        let ContourSample { all, quarter, area, has_drawing } = self;
        let vertices = kept.0 as f64 * all.vertices as f64 / all.points.max(1) as f64;
        // The sample may be one of several flights over a place, or have points from all over the terrain.
        let denser = (vertices / area / all.density().max(f64::MIN_POSITIVE)).clamp(1.0, 100.0);
        let coarser = (all.density() / quarter.density().max(f64::MIN_POSITIVE)).max(1.5);
        let fewer = quarter.crossings_per_vertex() / all.crossings_per_vertex().max(f64::MIN_POSITIVE);
        let exponent = (libm::log(fewer.max(1.0)) / libm::log(coarser)).clamp(0.0, 0.5);
        let each = all.crossings_per_vertex() * libm::pow(denser, -exponent);
        let points = (vertices * each).round() as u64;
        let per_point = GEOPACKAGE_PER_POINT + if *has_drawing { DRAWING_PER_POINT } else { 0 };
        ContourEstimate { points, bytes: points * per_point, vertices: vertices.round() as u64 }
    }
}

/// Returns the figures of the mesh that the job would make of some points alone.
fn figures_of(plan: &Plan, options: &ContourOptions, points: &[[i32; 3]]) -> Result<MeshFigures> {
    interrupt::check()?;
    let mut vertices = wanted_of(plan, points.to_vec())?;
    if let Some(bound) = error_bound(plan).map_err(config_error)? {
        vertices = selected_points(&vertices, KeptPoints::by_headers(plan).0, bound)?;
    }
    let of_points = MeshFigures { points: points.len() as u64, ..MeshFigures::default() };
    let heights = vertices.iter().map(|vertex| vertex[2]);
    let (Some(low), Some(high)) = (heights.clone().min(), heights.clone().max()) else { return Ok(of_points) };
    let sites: Vec<Site> = vertices.iter().map(|[x, y, _]| [*x, *y]).collect();
    // Samples that are no mesh, such as points on a line, show nothing.
    let Ok(mesh) = canonical(&sites) else { return Ok(of_points) };
    let levels = TerrainLevels::of(&options.levels, &plan.lattice, [low, high])?.levels.counts(heights);
    let crossings_of = |triangle: &[u32; 3]| -> u64 {
        let [a, b, c] = triangle.map(|v| levels[v as usize]);
        [a.abs_diff(b), b.abs_diff(c), c.abs_diff(a)].map(u64::from).iter().sum()
    };
    let double_area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| sites[v as usize].map(i128::from));
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let mut areas: Vec<i128> = mesh.corners().iter().map(double_area).collect();
    let middle = areas.len() / 2;
    let typical = if areas.is_empty() { 0 } else { *areas.select_nth_unstable(middle).1 };
    let mut figures = MeshFigures { vertices: vertices.len() as u64, ..of_points };
    for triangle in mesh.corners() {
        let area = double_area(triangle);
        if area <= GAP * typical {
            figures.triangles += 1;
            figures.double_area += area;
            figures.crossings += crossings_of(triangle);
        }
    }
    // Two triangles share an edge.
    figures.crossings /= 2;
    Ok(figures)
}

fn config_error(error: crate::Error) -> Error {
    Error::Config(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(crossings: [u64; 2], area: f64) -> ContourSample {
        let figures = |points: u64, crossings: u64| MeshFigures {
            points,
            vertices: points,
            crossings,
            triangles: 2 * points,
            double_area: 2 * 40_000 * 25,
        };
        ContourSample {
            all: figures(40_000, crossings[0]),
            quarter: figures(10_000, crossings[1]),
            area,
            has_drawing: true,
        }
    }

    #[test]
    fn rough_surfaces_have_points_by_their_vertices_and_slopes_by_their_length() {
        let area = 25.0 * 40_000.0;
        // Ten crossings of a vertex whatever the density: the same for sixteen times as many points in the same area.
        let rough = sample([400_000, 100_000], area);
        assert_eq!(rough.estimate(KeptPoints(40_000)).points, 400_000);
        assert_eq!(rough.estimate(KeptPoints(640_000)).points, 6_400_000);
        // Half as many of a vertex where there are four times as many.
        let slope = sample([400_000, 200_000], area);
        assert_eq!(slope.estimate(KeptPoints(640_000)).points, 1_600_000);
        // In a wider area as the sample is.
        let wide = sample([400_000, 200_000], 16.0 * area);
        assert_eq!(wide.estimate(KeptPoints(640_000)).points, 6_400_000);
        assert_eq!(wide.estimate(KeptPoints(640_000)).bytes, 6_400_000 * (GEOPACKAGE_PER_POINT + DRAWING_PER_POINT));
    }
}
