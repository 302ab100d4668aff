//! What selecting vertices has come to, for the report.

use crate::plan::job_plan::Plan;
use rust_decimal::prelude::ToPrimitive;
use selection::{Figures, VerticalError};
use serde::{Deserialize, Serialize};

/// How the vertices of a mesh were selected: `[output] max_error`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SelectionReport {
    /// The bound on the vertical distance of points from the mesh, in source units of height.
    pub max_error: f64,
    /// The points that vertices were selected from.
    pub points: u64,
    /// The selected ones.
    pub vertices: u64,
    /// The rounds that it took.
    pub rounds: u32,
    /// The greatest distance of a point, in source units.
    pub greatest_error: f64,
    /// The source coordinates of the point with that distance; `None` if all points are vertices.
    pub greatest_error_at: Option<[f64; 3]>,
    /// The mean distance of all points, in source units.
    pub mean_error: f64,
}

impl SelectionReport {
    pub(crate) fn new(plan: &Plan, max_error: f64, figures: &Figures) -> SelectionReport {
        let step = plan.lattice.resolution_z.to_f64().unwrap_or(f64::NAN);
        let units = |fixed: u64| fixed as f64 / (1u64 << VerticalError::FRACTION_BITS) as f64 * step;
        let world = |point: [i32; 3]| [0, 1, 2].map(|axis| plan.lattice.world(axis, point[axis]));
        SelectionReport {
            max_error,
            points: figures.points,
            vertices: figures.selected,
            rounds: figures.rounds,
            greatest_error: units(figures.greatest),
            greatest_error_at: figures.worst.map(world),
            mean_error: figures.mean * step,
        }
    }
}
