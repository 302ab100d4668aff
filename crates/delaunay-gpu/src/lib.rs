//! Leaves on a GPU, with wgpu: Vulkan, Metal or DX12; and the choice between a GPU and the CPU for each leaf.
//!
//! Without the feature `wgpu` there is no device, and the CPU does every leaf.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

pub mod figures;
#[cfg(not(feature = "wgpu"))]
mod no_device;
#[cfg(feature = "wgpu")]
mod on_device;
pub mod options;
pub mod triangulation_options;
pub mod triangulator;

#[cfg(feature = "wgpu")]
pub use on_device::*;
