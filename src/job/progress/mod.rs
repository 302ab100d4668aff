//! How far a job is, how long it will take, and what the machine has left. Nothing here knows what a step does.

pub(crate) mod activity;
pub mod clock;
pub mod machine;
pub mod stage;
pub mod stats;
pub mod text;
pub(crate) mod time_left;
