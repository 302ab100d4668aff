//! A written terrain, read back from the output directory of a finished job: its tiles as whole numbers on its lattice, and what the job said
//! of it. The proof of a terrain (`verify`) and comparisons of terrains (`survey`) begin here.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod error;
mod finished;
mod source_grid;
mod system;

pub use error::{Error, Result};
pub use finished::{FinishedTerrain, LatticePart, refuse_unfinished};
pub use source_grid::{SourceGrid, SourceGridError};
pub use system::{TerrainSystem, same_system};
