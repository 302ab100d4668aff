//! Jobs that are killed, interrupted, filled up and changed on their way: run again, they end with the same bytes as a job
//! that nobody has disturbed.
//!
//! `GDT_KILLS=n` makes the tests at random moments kill so many times each. CONTRIBUTING.md tells of the faults on purpose.
#![cfg(unix)]

#[path = "../common/random.rs"]
mod random;
mod rig;
#[path = "../common/scattered.rs"]
mod scattered;

mod changes;
mod disk;
mod kills;
mod lock;
mod signals;
