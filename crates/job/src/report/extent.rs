//! How large a terrain is.

use crate::plan::job_plan::Plan;
use crs::unit::Unit;
use delaunay::geometry::Bounds;
use rust_decimal::prelude::ToPrimitive;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The box around the vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extent {
    /// The sides in x and y.
    pub size: [f64; 2],
    /// The name of the unit of x and y.
    pub unit: String,
    /// Its length in metres.
    pub metres_per_unit: f64,
    /// The heights of the lowest and the highest vertex.
    pub heights: [f64; 2],
    /// The name of the unit of heights.
    pub height_unit: String,
    /// Its length in metres.
    pub metres_per_height_unit: f64,
}

impl Extent {
    /// Returns the extent of vertices within `bounds`, in lattice steps.
    pub(crate) fn of(plan: &Plan, Bounds { min, max }: Bounds<3>) -> Extent {
        let extras = plan.frame.extras();
        let step = plan.lattice.resolution.to_f64().unwrap_or(f64::NAN);
        let (metres_per_unit, metres_per_height_unit) = (extras.metres_per_unit, extras.metres_per_unit_z);
        let height_unit = match metres_per_height_unit == metres_per_unit {
            true => plan.unit.clone(),
            false => Unit::from_metres(Some(metres_per_height_unit)).name(),
        };
        Extent {
            size: [0, 1].map(|axis| (f64::from(max[axis]) - f64::from(min[axis])) * step),
            unit: plan.unit.clone(),
            metres_per_unit,
            heights: [min[2], max[2]].map(|z| plan.lattice.world(2, z)),
            height_unit,
            metres_per_height_unit,
        }
    }
}

impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Extent { size: [width, length], unit, metres_per_unit, heights: [low, high], height_unit, .. } = self;
        // Sides of ten units or more are shown in whole units.
        let decimals = if width.min(*length) < 10.0 { 2 } else { 0 };
        write!(f, "{width:.decimals$} x {length:.decimals$} {unit}")?;
        if *metres_per_unit != 1.0 {
            write!(f, " ({:.decimals$} x {:.decimals$} m)", width * metres_per_unit, length * metres_per_unit)?;
        }
        write!(f, ", heights {low:.2} to {high:.2} {height_unit}")?;
        if self.metres_per_height_unit != 1.0 {
            write!(f, " ({:.2} to {:.2} m)", low * self.metres_per_height_unit, high * self.metres_per_height_unit)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_are_no_metres_are_told_in_metres_too() {
        let metres = Extent {
            size: [285.7, 4_000.2],
            unit: "metre".into(),
            metres_per_unit: 1.0,
            heights: [788.993, 829.758],
            height_unit: "metre".into(),
            metres_per_height_unit: 1.0,
        };
        assert_eq!(metres.to_string(), "286 x 4000 metre, heights 788.99 to 829.76 metre");
        let feet = |metres| ("foot".to_string(), metres);
        let (height_unit, metres_per_height_unit) = feet(0.3048);
        let mixed = Extent { height_unit, metres_per_height_unit, ..metres.clone() };
        assert_eq!(mixed.to_string(), "286 x 4000 metre, heights 788.99 to 829.76 foot (240.49 to 252.91 m)");
        let (unit, metres_per_unit) = feet(0.3048);
        let small = Extent { size: [1.0, 20.0], unit, metres_per_unit, ..mixed };
        assert_eq!(
            small.to_string(),
            "1.00 x 20.00 foot (0.30 x 6.10 m), heights 788.99 to 829.76 foot (240.49 to 252.91 m)"
        );
    }
}
