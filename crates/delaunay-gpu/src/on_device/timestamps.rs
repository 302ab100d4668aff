//! The time that each step takes on the GPU itself: timestamps where its first pass begins and its last one ends, on adapters that have them.

use crate::on_device::device::Device;
use crate::on_device::error::GpuError;
use crate::on_device::recording::GpuStep;
use wgpu::{BufferUsages, CommandEncoder, ComputePassTimestampWrites, Features, QuerySet, QueryType};

/// The nanoseconds that each [`GpuStep`] took, in the order of the steps; 0 for steps that did not run.
pub type StepNanoseconds = [u64; GpuStep::ALL.len()];

/// Two timestamps per step.
pub(super) const STAMPS: u32 = 2 * GpuStep::ALL.len() as u32;
/// Bytes of all timestamps.
pub(super) const STAMP_BYTES: u64 = 8 * STAMPS as u64;

/// The timestamps of one atlas in flight.
pub(super) struct GpuTimestamps {
    stamps: QuerySet,
    resolved: wgpu::Buffer,
    /// Nanoseconds per tick.
    period: f64,
}

impl GpuTimestamps {
    /// Creates the timestamps, or returns `None` if `device` does not support them.
    pub(super) fn new(device: &Device) -> Result<Option<GpuTimestamps>, GpuError> {
        if !device.device.features().contains(Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let stamps = wgpu::QuerySetDescriptor { label: None, ty: QueryType::Timestamp, count: STAMPS };
        let resolved = wgpu::BufferDescriptor {
            label: None,
            size: STAMP_BYTES,
            usage: BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        };
        let period = f64::from(device.queue.get_timestamp_period());
        device.guard(|| {
            let (stamps, resolved) = (device.device.create_query_set(&stamps), device.device.create_buffer(&resolved));
            Some(GpuTimestamps { stamps, resolved, period })
        })
    }

    /// Returns the timestamps that a pass with these `marks` writes.
    pub(super) fn writes(&self, marks: PassMarks) -> Option<ComputePassTimestampWrites<'_>> {
        let PassMarks { begin, end } = marks;
        let write = || ComputePassTimestampWrites {
            query_set: &self.stamps,
            beginning_of_pass_write_index: begin,
            end_of_pass_write_index: end,
        };
        (begin.is_some() || end.is_some()).then(write)
    }

    /// Records the copy of the timestamps of `steps` into `staging`, from byte `at` on.
    pub(super) fn resolve(&self, encoder: &mut CommandEncoder, steps: &[GpuStep], staging: &wgpu::Buffer, at: u64) {
        for &step in steps {
            let first = 2 * step as u32;
            // The offset of a resolved query must be a multiple of 256, so the steps are resolved one by one.
            encoder.resolve_query_set(&self.stamps, first..first + 2, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, at + 8 * u64::from(first), 16);
        }
    }

    /// Computes the times of `steps` from their timestamps.
    pub(super) fn nanoseconds(&self, stamps: &[u64], steps: &[GpuStep]) -> StepNanoseconds {
        let mut times = [0; GpuStep::ALL.len()];
        for &step in steps {
            let first = 2 * step as usize;
            times[step as usize] = (stamps[first + 1].saturating_sub(stamps[first]) as f64 * self.period) as u64;
        }
        times
    }
}

/// The indices of the timestamps that a pass writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PassMarks {
    pub(super) begin: Option<u32>,
    pub(super) end: Option<u32>,
}

impl PassMarks {
    /// Marks the pass as the first one of `step`.
    pub(super) fn begin(&mut self, step: GpuStep) {
        self.begin = Some(2 * step as u32);
    }

    /// Marks the pass as the last one of `step`.
    pub(super) fn end(&mut self, step: GpuStep) {
        self.end = Some(2 * step as u32 + 1);
    }
}
