//! The shaders against their plain Rust twins, number by number, on whatever adapter there is: software Vulkan will do.

mod faults;
mod leaves;
mod random;
mod rig;
mod twins;
