//! Streams point clouds of any size into one exact Delaunay triangulation and writes it as glTF terrain.
//!
//! Start reading at [`job::run()`], which lists the steps of a job in order; ARCHITECTURE.md follows the data.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod cli;
pub mod cli_advice;
pub mod cloud_job;
pub mod command_words;
pub mod completions;
pub mod config;
pub mod error;
pub mod exit_code;
#[cfg(feature = "gpu")]
pub mod gpu_trial;
pub mod init;
pub mod manual;
pub mod sample;
mod shell_word;
pub mod step_progress;
pub mod submit;
#[cfg(feature = "viewer")]
pub mod view;
