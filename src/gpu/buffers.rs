//! The buffers that the steps share, by name, and what they hold. Every leaf in flight has a set of its own; sets are used again
//! and only ever grow.

use crate::gpu::Fault;
use crate::gpu::clock::Clock;
use crate::gpu::device::Device;
use wgpu::BufferUsages;

/// A buffer of the pipeline. One number (`u32`) a pixel unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Name {
    /// The parameters of all dispatches, [`Set::STRIDE`] bytes apart.
    Params,
    /// The pixel (y << 16 | x) of every site.
    Pixels,
    /// The complement of the number of the site in a pixel, or 0.
    Texture,
    /// Which of the 32 rows of a band have a site: one number a column and band.
    Words,
    /// The nearest row with a site south of a band: one number a column and band.
    South,
    /// The same north of it.
    North,
    /// The label of a pixel: the pixel (y << 16 | x) of its nearest site.
    Labels,
    /// Labels too, while jump flooding goes to and fro.
    Flood,
    /// How many pixels are islands, then each with its new label.
    Islands,
    /// Workgroups of the next dispatches of step G3.
    Workgroups,
    /// Voronoi vertices: two words for 32 corners.
    Vertices,
    /// Numbers of triangles, all levels of the prefix sums.
    Counts,
    /// Triples of site numbers.
    Triangles,
    /// What comes back.
    Staging,
}

impl Name {
    const COUNT: usize = Name::Staging as usize + 1;

    fn usage(self) -> BufferUsages {
        match self {
            Name::Params => BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            Name::Staging => BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            Name::Workgroups => BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::INDIRECT,
            _ => BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        }
    }
}

/// One set of buffers, each made when it is first needed.
#[derive(Default)]
pub struct Set {
    buffers: [Option<wgpu::Buffer>; Name::COUNT],
    pub(super) clock: Option<Clock>,
}

impl Set {
    /// Bytes from the parameters of one dispatch to those of the next: the alignment that every adapter accepts.
    pub const STRIDE: u64 = 256;

    /// Makes sure that buffer `name` has at least `bytes` bytes. What it held is lost if it grows.
    ///
    /// # Errors
    /// [`Fault::OutOfMemory`] if it cannot, or if no shader could see that much.
    pub fn need(&mut self, device: &Device, name: Name, bytes: u64) -> Result<(), Fault> {
        let slot = &mut self.buffers[name as usize];
        if slot.as_ref().is_some_and(|buffer| buffer.size() >= bytes) {
            return Ok(());
        }
        if bytes > device.limits.max_buffer_size.min(device.limits.max_storage_buffer_binding_size) {
            return Err(Fault::OutOfMemory);
        }
        // The old one first, so that both need not fit at once.
        if let Some(old) = slot.take() {
            old.destroy();
        }
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: bytes.next_multiple_of(4).max(16),
            usage: name.usage(),
            mapped_at_creation: false,
        };
        *slot = Some(device.guard(|| device.device.create_buffer(&descriptor))?);
        Ok(())
    }

    /// Buffer `name`.
    ///
    /// # Errors
    /// [`Fault::Refused`] if it was never asked for.
    pub fn get(&self, name: Name) -> Result<&wgpu::Buffer, Fault> {
        self.buffers[name as usize].as_ref().ok_or_else(|| Fault::Refused(format!("there is no buffer {name:?}")))
    }

    /// Frees all buffers.
    pub fn clear(&mut self) {
        *self = Set::default();
    }
}
