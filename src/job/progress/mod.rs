//! How far a job is. It knows no step.

pub mod machine;
pub mod stage;
pub mod time_left;
