//! The lines on a lattice that is finer than that of the terrain.

use crate::common_lattice::nearest;
use overlay::{Point, Segment};
use points::lines::{LineFeature, LineShape};
use std::path::Path;
use sys::Error;
use terrain::FinishedTerrain;

/// The vertices of lines are moved to the nearest of so many places in a lattice step.
pub(super) const PARTS_OF_STEP: i64 = 1 << 8;

/// A line in source coordinates.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) vertices: Vec<[f64; 2]>,
}

/// A segment of a line on the fine lattice.
pub(super) struct LineSegment {
    pub(super) line: usize,
    /// The number of the vertex where it begins.
    pub(super) vertex: usize,
    pub(super) ends: Segment,
}

/// Returns the lines of a feature, or the outlines of an area.
pub(super) fn lines_of(feature: &LineFeature) -> Vec<Line> {
    let is_area = matches!(feature.shape, LineShape::Area(_));
    let name = feature.name.clone().unwrap_or_else(|| feature.number.to_string());
    let line = |outline: &Vec<[f64; 3]>| {
        let closing = outline.first().filter(|_| is_area);
        let vertices = outline.iter().chain(closing).map(|[x, y, _]| [*x, *y]).collect();
        Line { name: name.clone(), vertices }
    };
    feature.shape.outlines().iter().map(line).collect()
}

/// The lattice of a terrain with finer steps in x and y.
pub(super) struct FineLattice {
    pub(super) offset: [f64; 3],
    /// In x and y, and in z.
    pub(super) steps: [f64; 2],
}

impl FineLattice {
    pub(super) fn of(terrain: &FinishedTerrain) -> FineLattice {
        let lattice = terrain.lattice();
        let steps = [nearest(lattice.resolution) / PARTS_OF_STEP as f64, nearest(lattice.resolution_z)];
        FineLattice { offset: lattice.offset.map(nearest), steps }
    }

    pub(super) fn point(point: [i32; 3]) -> Point {
        let [x, y, z] = point.map(i64::from);
        [x * PARTS_OF_STEP, y * PARTS_OF_STEP, z]
    }

    pub(super) fn place(&self, [x, y, _]: [f64; 3]) -> [f64; 2] {
        [self.offset[0] + x * self.steps[0], self.offset[1] + y * self.steps[0]]
    }

    pub(super) fn height(&self, [.., z]: [f64; 3]) -> f64 {
        self.offset[2] + z * self.steps[1]
    }

    pub(super) fn segments(&self, lines: &[Line], path: &Path) -> sys::Result<Vec<LineSegment>> {
        let mut segments = Vec::new();
        for (number, line) in lines.iter().enumerate() {
            let place = |vertex: &[f64; 2]| {
                let steps = [0, 1].map(|axis| ((vertex[axis] - self.offset[axis]) / self.steps[0]).round());
                let is_near = steps.iter().all(|steps| steps.abs() <= overlay::REACH as f64);
                let far = || {
                    let what = format!(
                        "line {} lies far outside of the terrain: correct its coordinates or its CRS",
                        line.name
                    );
                    Error::input(path, what)
                };
                is_near.then(|| steps.map(|steps| steps as i64)).ok_or_else(far)
            };
            let places = line.vertices.iter().map(place).collect::<sys::Result<Vec<_>>>()?;
            let ends = places.windows(2).map(|pair| [pair[0], pair[1]]).enumerate();
            let ends = ends.filter(|(_, ends)| ends[0] != ends[1]);
            segments.extend(ends.map(|(vertex, ends)| LineSegment { line: number, vertex, ends }));
        }
        Ok(segments)
    }
}
