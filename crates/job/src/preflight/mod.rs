//! Preflight: what a job would read and need, found out without writing anything.

pub mod check;
pub mod estimate;
pub(crate) mod input_places;
pub(crate) mod kept_points;
pub mod selection_estimate;
