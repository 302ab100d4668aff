//! Whole jobs, run as a user runs them: the program on a configuration file, and the proof from what it has written.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/las_file.rs"]
mod las_file;
#[path = "../common/random.rs"]
mod random;
#[path = "../common/scattered.rs"]
mod scattered;
#[path = "../common/validator.rs"]
mod validator;

mod clouds;
mod program;
mod tileset;

mod bad_files;
mod broken;
mod choices;
mod configuration;
mod cutting;
mod globe;
mod khronos;
mod levels;
mod limits;
mod messages;
mod preflight;
mod real;
mod same_mesh;
mod steps;
mod viewers;
mod woven;
mod written;
