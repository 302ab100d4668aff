//! Step 1: the plan says what a job is. It is made from the options, the inputs' headers and samples of their points. It can be
//! written down and read back, so that every later step is a function of the plan, an index and the store.

pub(crate) mod area_check;
pub(crate) mod area_cure;
pub(crate) mod area_hint;
pub mod breaklines;
pub mod budget;
pub mod clip;
pub mod common_crs;
pub(crate) mod distinct_crs;
pub mod extent;
pub(crate) mod far_points;
pub mod fingerprint;
pub(crate) mod flat_points;
pub mod folder_files;
pub(crate) mod geocentric_inputs;
pub(crate) mod globe_system;
pub mod ground_triangles;
mod height_groups;
pub(crate) mod height_range;
pub mod input_identity;
pub mod inputs;
pub mod job_plan;
pub mod lattice_choice;
pub(crate) mod listed_inputs;
pub mod make_plan;
pub(crate) mod measured_inputs;
mod missing_attributes;
pub mod named_files;
pub mod no_points;
mod other_unit;
pub(crate) mod point_survey;
pub(crate) mod rounded_box;
pub(crate) mod stray_heights;
pub(crate) mod stretch;
pub(crate) mod suspect_heights;
pub mod text_inputs;
mod zero_points;
