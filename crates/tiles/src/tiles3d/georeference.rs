//! `georeference.json`: the way from the scene back to the source's coordinates, for people and programs.

use serde::Serialize;

use crate::frame::{Extras, Frame};
use delaunay::geometry::Bounds;
use lattice::Lattice;
use sys::{Error, Result};

/// The content of `georeference.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Georeference {
    /// The offset, resolution, metres in a unit and WKT, as in the tiles.
    #[serde(flatten)]
    pub extras: Extras,
    /// The name of the source unit of x and y.
    pub unit: String,
    /// The EPSG code of the coordinate reference system, if it is known.
    pub epsg: Option<u32>,
    /// The least and greatest x, y, z of all sites in source units.
    pub bounds: [[f64; 3]; 2],
    /// The rule in words.
    pub rule: &'static str,
}

impl Georeference {
    /// Returns the content for a job whose sites have these bounds.
    pub fn new(
        frame: &Frame,
        lattice: &Lattice,
        bounds: Bounds<3>,
        unit: impl Into<String>,
        epsg: Option<u32>,
    ) -> Georeference {
        Georeference {
            extras: frame.extras().clone(),
            unit: unit.into(),
            epsg,
            bounds: [bounds.min, bounds.max].map(|corner| [0, 1, 2].map(|axis| lattice.world(axis, corner[axis]))),
            rule: "With (gx, gy, gz) a position in metres after the node transforms: x = offset[0] + gx / \
                   metres_per_unit, y = offset[1] - gz / metres_per_unit, z = offset[2] + gy / metres_per_unit_z. If there is a \
                   curvature, subtract its displacement first.",
        }
    }

    /// Returns the text of the file. `globe` says where the terrain lies on the globe, if that is known.
    ///
    /// # Errors
    /// [`Error::Broken`] if `globe` cannot be written as JSON.
    pub fn to_json(&self, globe: Option<impl Serialize>) -> Result<String> {
        let whole = serde_json::to_value(self).and_then(|mut whole| {
            whole["globe"] = serde_json::to_value(globe)?;
            serde_json::to_string_pretty(&whole)
        });
        let mut text = whole.map_err(|e| Error::Broken(format!("the georeference cannot be written: {e}")))?;
        text.push('\n');
        Ok(text)
    }
}
