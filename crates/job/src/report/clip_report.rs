//! What the report says of the area of `[input] clip`.

use crate::plan::clip::PlannedClip;
use lattice::Lattice;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The area that points were kept in. How many points it left out is among the counts of points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ClipReport {
    /// The file with the polygons.
    #[serde(with = "sys::path_text")]
    pub file: PathBuf,
    /// The number of polygons.
    pub polygons: u64,
    /// The number of their vertices.
    pub vertices: u64,
    /// The polygons in the CRS of the job, on a lattice a thousand times as fine as that of its points: well-known text (MULTIPOLYGON), whose
    /// numbers are exact.
    pub area: String,
}

impl ClipReport {
    /// Returns the report about the clip of a plan.
    pub(crate) fn of(clip: &PlannedClip, lattice: &Lattice) -> ClipReport {
        let polygons = &clip.polygons;
        ClipReport {
            file: clip.file.clone(),
            polygons: polygons.len() as u64,
            vertices: polygons.iter().flatten().map(|ring| ring.len() as u64).sum(),
            area: lattice.for_places().0.text_of_polygons(polygons),
        }
    }
}
