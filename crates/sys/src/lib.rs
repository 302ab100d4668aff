//! What every crate asks of the system: errors, files and how they change, threads, signals, and faults for tests.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod address_space;
pub mod bytes;
pub mod catch_panic;
pub mod disk;
pub mod error;
pub mod fault;
pub mod interrupt;
pub mod path_text;
pub mod positional_io;
pub mod shortage;
pub mod terminal;
pub mod threads;
mod warnings;

pub use error::{Error, ErrorKind, Result};
pub use warnings::{ShownWarning, Warnings, of_inputs, with_remedy_below};

/// Writes a message to standard error, as a terminal can show it. A closed or full standard error must not end the job, so failures are ignored.
pub fn say(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{}", terminal::escape_controls(text));
}
