//! The Delaunay triangulation of the sites of one tile, whoever computes it.

pub mod flip;
pub mod mesh;
pub mod reference;

use crate::Result;
use crate::config::Backend;
use crate::geometry::Site;
use mesh::Mesh;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// How leaves were triangulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// Leaves that `spade` triangulated.
    pub reference: u64,
}

impl AddAssign for Outcome {
    fn add_assign(&mut self, other: Outcome) {
        self.reference += other.reference;
    }
}

/// The canonical Delaunay triangulation of distinct `sites`, the same whichever `backend` computes it.
///
/// # Errors
/// [`crate::Error::Broken`] if even the reference triangulation fails.
pub fn triangulate(sites: &[Site], backend: Backend) -> Result<(Mesh, Outcome)> {
    match backend {
        Backend::Auto | Backend::Cpu | Backend::Gpu | Backend::Reference => {
            Ok((reference::triangulate(sites)?, Outcome { reference: 1 }))
        }
    }
}
