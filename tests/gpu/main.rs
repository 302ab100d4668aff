//! The shaders against their plain Rust twins, number by number, on any adapter. Software Vulkan is sufficient.

mod atlas;
mod atlas_costs;
mod atlas_mesh;
mod clouds;
#[path = "../common/mod.rs"]
mod common;
mod device_mesh;
mod engine;
mod faults;
mod flips;
mod instant;
mod leaves;
mod linked;
mod placed;
mod predicates;
mod random;
mod reference_kernels;
mod rig;
