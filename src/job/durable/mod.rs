//! What makes a job survive a kill: it knows no step.

pub mod columns;
pub mod committer;
pub mod directory;
pub mod journal;
pub mod store;
