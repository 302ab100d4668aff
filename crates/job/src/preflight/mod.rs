//! Preflight: what a job would read and need, found out without writing anything.

pub mod check;
pub(crate) mod contour_estimate;
pub mod estimate;
pub(crate) mod input_places;
pub(crate) mod kept_points;
pub(crate) mod sampled_points;
pub mod selection_estimate;
pub(crate) mod stage_costs;
