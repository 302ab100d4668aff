//! Whether a job fits.

pub mod check;
