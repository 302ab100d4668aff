//! How long steps take on the GPU itself: timestamps at their first and last dispatch, where the adapter has them.

use crate::gpu::Fault;
use crate::gpu::device::Device;
use crate::gpu::steps::{Command, Recording, Step};
use wgpu::{BufferUsages, CommandEncoder, ComputePassTimestampWrites, Features, QuerySet, QueryType};

/// Nanoseconds that each [`Step`] took, in their order; 0 for those that did not run.
pub type StepTimes = [u64; Step::ALL.len()];

/// Two timestamps a step.
const STAMPS: u32 = 2 * Step::ALL.len() as u32;
/// Bytes of all timestamps.
pub(super) const STAMP_BYTES: u64 = 8 * STAMPS as u64;

/// The timestamps of one leaf in flight.
pub(super) struct Clock {
    stamps: QuerySet,
    resolved: wgpu::Buffer,
    /// Nanoseconds in a tick.
    period: f64,
}

impl Clock {
    /// A clock, if `device` has timestamps.
    pub(super) fn new(device: &Device) -> Result<Option<Clock>, Fault> {
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
            Some(Clock { stamps, resolved, period })
        })
    }

    /// The timestamps that a dispatch with these `marks` writes.
    pub(super) fn writes(&self, marks: Marks) -> Option<ComputePassTimestampWrites<'_>> {
        let Marks { begin, end } = marks;
        let write = || ComputePassTimestampWrites {
            query_set: &self.stamps,
            beginning_of_pass_write_index: begin,
            end_of_pass_write_index: end,
        };
        (begin.is_some() || end.is_some()).then(write)
    }

    /// Records the way of the timestamps of `steps` into `staging`, from byte `at` on.
    pub(super) fn resolve(&self, encoder: &mut CommandEncoder, steps: &[Step], staging: &wgpu::Buffer, at: u64) {
        for &step in steps {
            let first = 2 * step as u32;
            // Offsets of what is resolved have to be multiples of 256: one after the other.
            encoder.resolve_query_set(&self.stamps, first..first + 2, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, at + 8 * u64::from(first), 16);
        }
    }

    /// The times of `steps` from their timestamps.
    pub(super) fn times(&self, stamps: &[u64], steps: &[Step]) -> StepTimes {
        let mut times = [0; Step::ALL.len()];
        for &step in steps {
            let first = 2 * step as usize;
            times[step as usize] = (stamps[first + 1].saturating_sub(stamps[first]) as f64 * self.period) as u64;
        }
        times
    }
}

/// Which timestamps a dispatch writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Marks {
    begin: Option<u32>,
    end: Option<u32>,
}

/// The marks of every dispatch of `recording`, and the steps that have dispatches.
pub(super) fn marks(recording: &Recording) -> (Vec<Marks>, Vec<Step>) {
    let (mut marks, mut steps): (Vec<Marks>, Vec<Step>) = (Vec::new(), Vec::new());
    let mut current = None;
    let end = |marks: &mut Vec<Marks>, step: Step| {
        if let Some(last) = marks.last_mut() {
            last.end = Some(2 * step as u32 + 1);
        }
    };
    for command in &recording.commands {
        match command {
            Command::Step(step) => current = Some(*step),
            Command::Run(..) => {
                let before = steps.last().copied();
                let begins = current.filter(|&step| before != Some(step));
                if let Some(step) = begins {
                    before.into_iter().for_each(|before| end(&mut marks, before));
                    steps.push(step);
                }
                marks.push(Marks { begin: begins.map(|step| 2 * step as u32), end: None });
            }
            _ => {}
        }
    }
    steps.last().copied().into_iter().for_each(|last| end(&mut marks, last));
    (marks, steps)
}

#[cfg(test)]
mod tests {
    use super::super::steps::Size;
    use super::*;
    use crate::gpu::options::VoronoiMethod;

    #[test]
    fn every_step_begins_and_ends_once() {
        let recording = crate::gpu::labels(Size { width: 700, height: 500 }, vec![0, 5, 9], VoronoiMethod::Jfa);
        let (marks, steps) = marks(&recording);
        assert_eq!(steps, [Step::WriteSites, Step::Voronoi, Step::Islands]);
        let begins: Vec<u32> = marks.iter().filter_map(|m| m.begin).collect();
        let ends: Vec<u32> = marks.iter().filter_map(|m| m.end).collect();
        assert_eq!((begins, ends), (vec![0, 2, 4], vec![1, 3, 5]));
        assert_eq!(marks[0], Marks { begin: Some(0), end: Some(1) });
        assert_eq!(marks.last().unwrap().end, Some(5));
    }
}
