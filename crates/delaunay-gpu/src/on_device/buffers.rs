//! Sets of GPU buffers. Every atlas in flight has a set of its own. Sets are reused, and their buffers only ever grow.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::device::Device;
use crate::on_device::error::GpuError;
use crate::on_device::recording::ProgramKey;
use crate::on_device::timestamps::GpuTimestamps;
use crate::on_device::upload::UploadBuffer;
use std::collections::HashMap;

/// What tells a bind group from all others: its program, the buffers that are bound, and the number of the dispatch, which has parameters
/// of its own.
pub(super) type BindGroupKey = (ProgramKey, &'static [(u32, BufferId)], u64);

/// One buffer of each kind, created when it is first needed.
#[derive(Default)]
pub struct BufferSet {
    buffers: [Option<wgpu::Buffer>; BufferId::COUNT],
    /// How shaders see the buffers.
    pub(super) bind_groups: HashMap<BindGroupKey, wgpu::BindGroup>,
    pub(super) timestamps: Option<GpuTimestamps>,
    pub(super) upload: Option<UploadBuffer>,
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
        let most = device.limits.max_buffer_size.min(device.limits.max_storage_buffer_binding_size);
        if bytes > most {
            return Err(GpuError::OutOfMemory);
        }
        // Free the old buffer first, so that both need not fit at once.
        self.bind_groups.clear();
        if let Some(old) = slot.take() {
            old.destroy();
        }
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: rounded(bytes).min(most & !3).max(bytes.next_multiple_of(4)),
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

    /// Takes buffer `id` out of the set.
    pub(super) fn take(&mut self, id: BufferId) -> Option<wgpu::Buffer> {
        self.buffers[id as usize].take()
    }

    /// If there is no buffer `id`, makes it the one that `other` returns, if any.
    pub(super) fn fill_gap(&mut self, id: BufferId, other: impl FnOnce() -> Option<wgpu::Buffer>) {
        let slot = &mut self.buffers[id as usize];
        if slot.is_none() {
            *slot = other();
        }
    }

    /// Frees all buffers.
    pub fn clear(&mut self) {
        *self = BufferSet::default();
    }
}

/// Returns a size for a buffer that must hold `bytes` bytes: up to a quarter more, so that it need not grow for every atlas that is a
/// little larger.
fn rounded(bytes: u64) -> u64 {
    bytes.max(16).next_multiple_of((bytes.max(16).next_power_of_two() / 8).max(4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_is_at_most_a_quarter_too_large() {
        for bytes in (0..2000).chain([1 << 30, (1 << 30) + 1, (1 << 31) - 1]) {
            let size = rounded(bytes);
            assert!(
                size >= bytes && size.is_multiple_of(4) && (bytes < 64 || 4 * size <= 5 * bytes),
                "{bytes}: {size}"
            );
        }
    }
}
