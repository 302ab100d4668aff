//! The counts in `report.json`, which the tiles have to agree with.

use std::path::Path;

use serde::Deserialize;

use crate::output::file_names::OutputFiles;
use crate::{Error, Result};

/// The counts of a report; `None` for those that it lacks.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(super) struct ReportedCounts {
    pub(super) sites: Option<u64>,
    /// The triangles in `tiles/`.
    pub(super) triangles: Option<u64>,
    /// The triangles that were left out.
    pub(super) cut_triangles: Option<u64>,
}

impl ReportedCounts {
    /// Reads the report in the output `directory` of a job; there need not be one.
    pub(super) fn read(directory: &Path) -> Result<ReportedCounts> {
        let path = OutputFiles::new(directory).report();
        if !path.exists() {
            return Ok(ReportedCounts::default());
        }
        let text = std::fs::read(&path).map_err(Error::io("read", &path))?;
        serde_json::from_slice(&text).map_err(|e| Error::input(&path, format!("not a report of this program: {e}")))
    }
}
