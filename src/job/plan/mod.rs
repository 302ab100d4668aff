//! What a job is: its inputs, lattice and frame, and by what it is known again.

pub mod extent;
pub mod fingerprint;
pub mod lattice_choice;
pub mod scan;
