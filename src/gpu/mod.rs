//! Steps G1 to G6 on a GPU, with wgpu: Vulkan, Metal or DX12.
//!
//! One WGSL file per step in `shaders/`, and for each a plain loop in `twins` that gives the same numbers bit for bit. [`steps`]
//! records which dispatches a step is made of, [`machine`] carries recordings out, [`executor`] does leaf after leaf on a thread
//! of its own. What comes back of a leaf is its discrete VoronoiMethod diagram; `voronoi` makes the mesh of it and proves it.

pub mod buffers;
pub mod clock;
pub mod device;
pub mod executor;
pub mod machine;
pub mod options;
pub mod selftest;
pub mod steps;
pub mod twins;

use crate::gpu::options::VoronoiMethod;
use steps::{Recording, Size};

/// Why a GPU did not do what it was asked to.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// There is no adapter that will do; the text is a sentence.
    #[error("{0}")]
    Absent(String),
    /// It has not enough memory for a texture of this size.
    #[error("the GPU has not enough memory")]
    OutOfMemory,
    /// The device is gone, as after a driver's reset.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// It refused what it was given.
    #[error("the GPU refused: {0}")]
    Refused(String),
}

/// The steps that make the labels of a texture of its sites, each given by its pixel (y << 16 | x): G1, G2 and G3. Exact
/// diagrams have islands too, where thin regions fall apart into pixels.
pub fn labels(size: Size, pixels: Vec<u32>, voronoi: VoronoiMethod) -> Recording {
    let mut recording = Recording::default();
    recording.write_sites(size, pixels);
    recording.voronoi(size, voronoi);
    recording.remove_islands(size);
    recording
}

/// The steps that make the triangles out of the labels, at most `room` of them: G4, G5 and G6.
pub fn triangles(size: Size, room: u32) -> Recording {
    let mut recording = Recording::default();
    recording.find_vertices(size);
    recording.count(size);
    recording.make_triangles(size, room);
    recording
}
