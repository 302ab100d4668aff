//! The time that each step takes on the GPU itself: timestamps at its first and last dispatch, on adapters that have them.

use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::gpu::steps::{GpuCommand, GpuStep, Recording};
use wgpu::{BufferUsages, CommandEncoder, ComputePassTimestampWrites, Features, QuerySet, QueryType};

/// The nanoseconds that each [`GpuStep`] took, in the order of the steps; 0 for steps that did not run.
pub type StepNanoseconds = [u64; GpuStep::ALL.len()];

/// Two timestamps per step.
const STAMPS: u32 = 2 * GpuStep::ALL.len() as u32;
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

    /// Returns the timestamps that a dispatch with these `marks` writes.
    pub(super) fn writes(&self, marks: DispatchMarks) -> Option<ComputePassTimestampWrites<'_>> {
        let DispatchMarks { begin, end } = marks;
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

/// The indices of the timestamps that a dispatch writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct DispatchMarks {
    begin: Option<u32>,
    end: Option<u32>,
}

/// Returns the marks of every dispatch of `recording`, and the steps that have dispatches.
pub(super) fn marks(recording: &Recording) -> (Vec<DispatchMarks>, Vec<GpuStep>) {
    let (mut marks, mut steps): (Vec<DispatchMarks>, Vec<GpuStep>) = (Vec::new(), Vec::new());
    let mut current = None;
    let end = |marks: &mut Vec<DispatchMarks>, step: GpuStep| {
        if let Some(last) = marks.last_mut() {
            last.end = Some(2 * step as u32 + 1);
        }
    };
    for command in &recording.commands {
        match command {
            GpuCommand::Step(step) => current = Some(*step),
            GpuCommand::Run(..) => {
                let before = steps.last().copied();
                let begins = current.filter(|&step| before != Some(step));
                if let Some(step) = begins {
                    before.into_iter().for_each(|before| end(&mut marks, before));
                    steps.push(step);
                }
                marks.push(DispatchMarks { begin: begins.map(|step| 2 * step as u32), end: None });
            }
            _ => {}
        }
    }
    steps.last().copied().into_iter().for_each(|last| end(&mut marks, last));
    (marks, steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::atlas::Atlas;
    use crate::gpu::options::VoronoiMethod;
    use crate::voronoi::texture_request::TextureRequest;

    #[test]
    fn every_step_begins_and_ends_once() {
        let (mut atlas, sites) = (Atlas::default(), [[0, 0], [9, 0], [0, 9], [i32::MIN, 0]]);
        assert!(atlas.add(&sites[..3], &TextureRequest::default(), 1 << 20));
        let recording = Recording::mesh(&atlas, &sites, VoronoiMethod::Jfa);
        let (marks, steps) = marks(&recording);
        assert_eq!(steps, GpuStep::ALL);
        let begins: Vec<u32> = marks.iter().filter_map(|m| m.begin).collect();
        let ends: Vec<u32> = marks.iter().filter_map(|m| m.end).collect();
        let stamps = 0..STAMPS;
        assert!(begins.into_iter().eq(stamps.clone().step_by(2)) && ends.into_iter().eq(stamps.skip(1).step_by(2)));
        assert_eq!((marks[0].begin, marks.last().unwrap().end), (Some(0), Some(STAMPS - 1)));
    }
}
