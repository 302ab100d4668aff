//! The shaders against their plain Rust twins, number by number, on any adapter. Software Vulkan is sufficient.

mod faults;
mod leaves;
mod predicates;
mod random;
mod rig;
mod twins;
