//! Streams point clouds of any size into one exact Delaunay triangulation and writes it as glTF terrain.
//!
//! Start reading at [`job::run()`], which lists the steps of a job in order; ARCHITECTURE.md follows the data.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

mod address_space;
pub mod breaklines;
mod catch_panic;
pub mod cli;
pub mod completions;
pub mod config;
mod disk;
pub mod error;
mod fault;
pub mod geometry;
pub mod gpu;
pub mod gpu_trial;
pub mod init;
pub mod input;
pub mod interrupt;
pub mod job;
pub mod manual;
pub mod mesh;
pub mod output;
mod path_text;
pub mod positional_io;
pub mod sample;
mod shell_word;
pub mod shortage;
pub mod submit;
pub mod terminal;
pub mod threads;
pub mod triangulation;
pub mod verify;
#[cfg(feature = "viewer")]
pub mod view;
pub mod voronoi;
mod warnings;

pub use error::{Error, Result};
pub use warnings::Warnings;

/// Writes a message to standard error, as a terminal can show it. A closed or full standard error must not end the job, so failures are ignored.
pub fn say(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{}", terminal::harmless(text));
}
