//! Sets of GPU buffers. Every atlas in flight has a set of its own. Sets are reused, and their buffers only ever grow.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::gpu::timestamps::GpuTimestamps;

/// One buffer of each kind, created when it is first needed.
#[derive(Default)]
pub struct BufferSet {
    buffers: [Option<wgpu::Buffer>; BufferId::COUNT],
    pub(super) timestamps: Option<GpuTimestamps>,
}

impl BufferSet {
    /// Bytes from the parameters of one dispatch to those of the next: an alignment that every adapter accepts.
    pub const STRIDE: u64 = 256;

    /// Makes sure that buffer `id` has at least `bytes` bytes. Its contents are lost if it grows.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] if the buffer does not fit, or if no shader could bind that many bytes.
    pub fn reserve(&mut self, device: &Device, id: BufferId, bytes: u64) -> Result<(), GpuError> {
        let slot = &mut self.buffers[id as usize];
        if slot.as_ref().is_some_and(|buffer| buffer.size() >= bytes) {
            return Ok(());
        }
        if bytes > device.limits.max_buffer_size.min(device.limits.max_storage_buffer_binding_size) {
            return Err(GpuError::OutOfMemory);
        }
        // Free the old buffer first, so that both need not fit at once.
        if let Some(old) = slot.take() {
            old.destroy();
        }
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: bytes.next_multiple_of(4).max(16),
            usage: id.usage(),
            mapped_at_creation: false,
        };
        *slot = Some(device.guard(|| device.device.create_buffer(&descriptor))?);
        Ok(())
    }

    /// Returns buffer `id`.
    ///
    /// # Errors
    /// [`GpuError::Refused`] if the buffer was never reserved.
    pub fn get(&self, id: BufferId) -> Result<&wgpu::Buffer, GpuError> {
        self.buffers[id as usize].as_ref().ok_or_else(|| GpuError::Refused(format!("there is no buffer {id:?}")))
    }

    /// Frees all buffers.
    pub fn clear(&mut self) {
        *self = BufferSet::default();
    }
}
