//! Between which heights a terrain lies.

use crate::plan::job_plan::Plan;
use crs::unit::Unit;
use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The heights of the vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeightSpan {
    /// The lowest one, in the unit.
    pub low: f64,
    /// The highest one.
    pub high: f64,
    /// The name of the unit.
    pub unit: String,
    /// Its length in metres.
    pub metres_per_unit: f64,
}

impl HeightSpan {
    /// Returns the span of vertices within `bounds`, in lattice steps.
    pub(crate) fn of(plan: &Plan, bounds: &Bounds<3>) -> HeightSpan {
        let extras = plan.frame.extras();
        let [low, high] = [bounds.min[2], bounds.max[2]].map(|z| plan.lattice.world(2, z));
        let metres_per_unit = extras.metres_per_unit_z;
        let unit = match metres_per_unit == extras.metres_per_unit {
            true => plan.unit.clone(),
            false => Unit::from_metres(Some(metres_per_unit)).name(),
        };
        HeightSpan { low, high, unit, metres_per_unit }
    }
}

impl fmt::Display for HeightSpan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let HeightSpan { low, high, unit, metres_per_unit } = self;
        write!(f, "{low:.2} to {high:.2} {unit}")?;
        if *metres_per_unit != 1.0 {
            write!(f, " ({:.2} to {:.2} m)", low * metres_per_unit, high * metres_per_unit)?;
        }
        Ok(())
    }
}
