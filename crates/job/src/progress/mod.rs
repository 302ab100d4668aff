//! How far a job is, and how long it will take. Nothing here knows what a step does.

pub(crate) mod activity;
pub mod clock;
pub mod number_text;
pub mod stage;
pub mod stats;
pub(crate) mod time_left;
