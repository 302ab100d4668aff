//! The report of a finished job, for people and for machines.

pub mod breakline_report;
pub mod change_counts;
pub mod clip_report;
mod covered_share;
pub mod extent;
pub mod job_report;
pub mod job_status;
pub mod selection_report;
pub mod skipped_inputs;
pub mod summary;
mod table;
pub mod task_outcome;
