//! The buffer through which numbers go up to a device. It stays mapped while its slot is at rest, so that an atlas costs one copy, and no new
//! memory.

use crate::on_device::device::Device;
use crate::on_device::error::GpuError;
use std::sync::{Arc, OnceLock};
use wgpu::{Buffer, BufferUsages, BufferViewMut, MapMode};

/// A buffer that the CPU writes and the device copies from.
pub(super) struct UploadBuffer {
    buffer: Buffer,
    /// Whether the CPU may write, once that is known.
    mapped: Arc<OnceLock<bool>>,
}

impl UploadBuffer {
    /// Returns `old` if it is mapped and has room for `bytes` bytes, else a new buffer.
    ///
    /// # Errors
    /// [`GpuError`] if there is no memory for it.
    pub(super) fn with_room(old: Option<UploadBuffer>, device: &Device, bytes: u64) -> Result<UploadBuffer, GpuError> {
        let fits = |old: &UploadBuffer| old.buffer.size() >= bytes && old.mapped.get() == Some(&true);
        if let Some(old) = old.filter(fits) {
            return Ok(old);
        }
        let descriptor = wgpu::BufferDescriptor {
            label: None,
            size: bytes.next_power_of_two().min(device.limits.max_buffer_size & !7).max(bytes),
            usage: BufferUsages::MAP_WRITE | BufferUsages::COPY_SRC,
            mapped_at_creation: true,
        };
        let buffer = device.guard(|| device.device.create_buffer(&descriptor))?;
        Ok(UploadBuffer { buffer, mapped: Arc::new(OnceLock::from(true)) })
    }

    /// Writes `parts` one after the other; returns the buffer, which is no longer mapped, and the byte at which each part begins.
    ///
    /// # Errors
    /// [`GpuError::Lost`] if the buffer is not mapped.
    pub(super) fn write(&mut self, parts: &[&[u8]]) -> Result<(Buffer, Vec<u64>), GpuError> {
        let lost = |error: wgpu::MapRangeError| GpuError::Lost(error.to_string());
        let mut view = self.buffer.slice(..).get_mapped_range_mut().map_err(lost)?;
        let (mut at, mut starts) = (0, Vec::with_capacity(parts.len()));
        for part in parts {
            starts.push(at as u64);
            write_at(&mut view, at, part);
            at += part.len().next_multiple_of(8);
        }
        drop(view);
        self.buffer.unmap();
        self.mapped = Arc::default();
        Ok((self.buffer.clone(), starts))
    }

    /// Lets the CPU write again once the device has done what was submitted so far.
    pub(super) fn map_again(&self) {
        let on_mapped = self.mapped.clone();
        self.buffer.slice(..).map_async(MapMode::Write, move |result| {
            on_mapped.get_or_init(|| result.is_ok());
        });
    }
}

fn write_at(view: &mut BufferViewMut, at: usize, part: &[u8]) {
    view.slice(at..at + part.len()).copy_from_slice(part);
}

/// Returns how many bytes `parts` take in the buffer.
pub(super) fn room_for(parts: &[&[u8]]) -> u64 {
    parts.iter().map(|part| part.len().next_multiple_of(8) as u64).sum::<u64>().max(8)
}
