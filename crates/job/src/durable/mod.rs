//! What lets a job survive a kill: results that appear only when they are whole, a store of records, and a journal of complete
//! phases. Nothing here knows what a phase does; the job says what its records and phases are called ([`store::RecordKey`],
//! [`journal::Journal`]).

pub mod atomic_file;
mod bits;
pub mod cleaning;
pub mod columns;
pub mod directory;
pub mod journal;
pub(crate) mod known_results;
pub(crate) mod listing;
pub mod lock;
pub mod mapped;
pub mod obstacles;
pub mod packing;
mod replacement;
pub mod store;
pub(crate) mod waiting_file;
