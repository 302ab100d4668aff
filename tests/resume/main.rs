//! Jobs that are killed, interrupted, changed, or run out of disk space. Run again, they end with the same bytes as an undisturbed
//! job.
//!
//! The program must be built with `--features fault-injection`: CONTRIBUTING.md explains it. `GDT_KILLS=n` sets the number of kills
//! of each test that kills at random moments.
#![cfg(unix)]

mod disk_model;
#[path = "../common/random.rs"]
mod random;
mod rig;
#[path = "../common/scattered.rs"]
mod scattered;

mod changes;
mod contours;
mod damaged_tasks;
mod disk;
mod earlier_results;
mod failing_disk;
mod freeing;
mod kills;
mod lock;
mod many_tiles;
mod places;
mod power;
mod raster;
mod read_errors;
mod signals;
mod tasks;
mod terrain_tiles;
mod updates;
