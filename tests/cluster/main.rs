//! A job done by many tasks, as schedulers of clusters start them, writes the bytes that one process writes.

#[path = "../common/mod.rs"]
mod common;
mod kubernetes;
mod rig;
mod slurm;
mod slurm_daemons;
