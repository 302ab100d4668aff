//! What lets a job survive a kill: results that appear only when they are whole, a store of records, and a journal of finished
//! steps. Nothing here knows what a step does; the job says what its records and steps are called ([`store::RecordKey`],
//! [`journal::Journal`]).

pub mod atomic_file;
mod bits;
pub mod cleaning;
pub mod columns;
pub(crate) mod committer;
pub mod directory;
pub mod journal;
pub(crate) mod known_results;
mod listing;
pub mod lock;
pub mod mapped;
pub mod obstacles;
pub mod packing;
mod replacement;
pub mod store;
