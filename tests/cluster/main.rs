//! A job done by many tasks, as schedulers of clusters start them, writes the bytes that one process writes.

#[path = "../common/mod.rs"]
mod common;
mod kubernetes;
mod rig;
// Slurm is a program of Linux.
#[cfg(target_os = "linux")]
mod slurm;
#[cfg(target_os = "linux")]
mod slurm_daemons;
