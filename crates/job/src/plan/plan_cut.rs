//! How the plane of a job is cut, where files have come, gone or changed since: as in its first run, so that what has not changed stays as it is.

use delaunay::geometry::Bounds;
use serde::{Deserialize, Serialize};

/// What decides where the parts of a job are cut, besides the points in them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PlanCut {
    /// The box of the inputs on the lattice.
    pub(crate) extent: Bounds<2>,
    /// The number of records in all inputs.
    pub(crate) records: u64,
    /// The inputs.
    pub(crate) inputs: Vec<CutInput>,
}

/// What an input claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CutInput {
    /// The lattice box of its points.
    pub(crate) claimed: Bounds<2>,
    /// The number of records that are decoded.
    pub(crate) records: u64,
}

impl PlanCut {
    /// Returns the number of records that are decoded.
    pub(crate) fn decoded_records(&self) -> u64 {
        self.inputs.iter().map(|input| input.records).sum()
    }
}
