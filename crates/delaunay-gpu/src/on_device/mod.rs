//! Steps G1 to G6 on a device.
//!
//! `shaders/` has one WGSL file per step, and [`reference_kernels`] has a plain loop for each that gives the same numbers bit for bit.
//! [`steps`] records which dispatches a step consists of, [`engine`] runs such a [`recording`] on a device, and [`executor`] gets
//! the meshes of leaves from a thread of its own, many leaves at a time. The crate `delaunay` completes these meshes and proves them.

pub mod atlas;
mod benefit;
pub mod buffer_id;
pub mod buffers;
pub mod device;
pub mod engine;
pub mod error;
pub mod executor;
mod fake_engine;
pub mod filled_atlas;
pub mod flip_marks;
mod gpu_thread;
pub mod landed;
pub mod leaf_flags;
pub mod mesh_engine;
pub mod mesh_steps;
mod passes;
pub mod recording;
pub mod reference_kernels;
pub mod returned;
pub mod selftest;
mod staging;
pub mod steps;
pub mod texture_size;
pub mod timestamps;
mod upload;
