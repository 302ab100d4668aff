//! `georeference.json`: how to get from the scene back to the source's coordinates, for people and programs.

use serde::Serialize;

use crate::geometry::lattice::Lattice;
use crate::output::frame::{Extras, Frame};

/// The content of `georeference.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Georeference {
    /// Offset, resolution, metres in a unit and WKT, as in the tiles.
    #[serde(flatten)]
    pub extras: Extras,
    /// Name of the source unit of x and y.
    pub unit: String,
    /// EPSG code of the coordinate reference system, where it is known.
    pub epsg: Option<u32>,
    /// Least and greatest x, y, z of all sites in source units.
    pub bounds: [[f64; 3]; 2],
    /// The rule in words.
    pub rule: &'static str,
}

impl Georeference {
    /// For a job whose sites have these least and greatest lattice integers x, y, z.
    pub fn new(
        frame: &Frame,
        lattice: &Lattice,
        bounds: [[i32; 3]; 2],
        unit: impl Into<String>,
        epsg: Option<u32>,
    ) -> Georeference {
        Georeference {
            extras: frame.extras().clone(),
            unit: unit.into(),
            epsg,
            bounds: bounds.map(|corner| [0, 1, 2].map(|axis| lattice.world(axis, corner[axis]))),
            rule: "With (gx, gy, gz) a position in metres after the node transforms: x = offset[0] + gx / \
                   metres_per_unit, y = offset[1] - gz / metres_per_unit, z = offset[2] + gy / metres_per_unit_z.",
        }
    }

    /// The text of the file; `globe` is where the terrain lies on the globe, if that is known.
    pub fn to_json(&self, globe: Option<impl Serialize>) -> String {
        let whole = serde_json::to_value(self).and_then(|mut whole| {
            whole["globe"] = serde_json::to_value(globe)?;
            serde_json::to_string_pretty(&whole)
        });
        let mut text = whole.expect("numbers and strings always serialize");
        text.push('\n');
        text
    }
}
