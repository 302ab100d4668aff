//! Runs recordings on a device.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffers::{BindGroupKey, BufferSet};
use crate::on_device::device::Device;
use crate::on_device::error::GpuError;
use crate::on_device::landed::Landed;
use crate::on_device::passes::{Dispatch, Part, Pass, parts};
use crate::on_device::recording::{GpuCommand, GpuStep, ProgramKey, Recording, ShaderProgram};
use crate::on_device::staging::{LentNumbers, StagingPool};
use crate::on_device::timestamps::{GpuTimestamps, STAMP_BYTES, StepNanoseconds};
use crate::on_device::upload::{UploadBuffer, room_for};
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};
use wgpu::{BindGroupEntry, BindingResource, BufferBinding, BufferView, CommandEncoder, ComputePipeline, MapMode};

/// A device with its compiled shaders.
pub struct GpuEngine {
    device: Device,
    pipelines: HashMap<ProgramKey, ComputePipeline>,
}

/// A recording that is running, and whose result will be read back.
pub struct PendingReadback {
    submission: wgpu::SubmissionIndex,
    bytes: u64,
    /// The steps whose timestamps are read back too.
    timed: Vec<GpuStep>,
    /// Whether the result can be read, once that is known.
    mapped: Arc<OnceLock<bool>>,
}

impl GpuEngine {
    /// Creates an engine on an open device.
    pub fn new(device: Device) -> GpuEngine {
        GpuEngine { device, pipelines: HashMap::new() }
    }

    /// Returns the device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Starts `recording` on `buffers`.
    ///
    /// # Errors
    /// [`GpuError`] if the device refuses. The caller need not wait for anything then.
    pub fn start(&mut self, buffers: &mut BufferSet, recording: &Recording) -> Result<wgpu::SubmissionIndex, GpuError> {
        self.prepare(buffers, recording)?;
        Ok(self.device.guard(|| self.submit_all(buffers, recording))??.0)
    }

    /// Starts `recording`, then the readback of the first `bytes` bytes of buffer `id` and of the steps' times.
    ///
    /// # Errors
    /// As [`GpuEngine::start`].
    pub fn start_and_fetch(
        &mut self,
        buffers: &mut BufferSet,
        recording: &Recording,
        id: BufferId,
        bytes: u64,
    ) -> Result<PendingReadback, GpuError> {
        buffers.reserve(&self.device, BufferId::Staging, bytes.next_multiple_of(8) + STAMP_BYTES)?;
        self.prepare(buffers, recording)?;
        if buffers.timestamps.is_none() {
            buffers.timestamps = GpuTimestamps::new(&self.device)?;
        }
        let (_, steps) = self.device.guard(|| self.submit_all(buffers, recording))??;
        let timed = if buffers.timestamps.is_some() { steps } else { Vec::new() };
        self.fetch_timed(buffers, id, 0, bytes, timed)
    }

    /// Starts the readback of `bytes` bytes of buffer `id`, from byte `first` on.
    ///
    /// # Errors
    /// As [`GpuEngine::start`].
    pub fn fetch(
        &self,
        buffers: &mut BufferSet,
        id: BufferId,
        first: u64,
        bytes: u64,
    ) -> Result<PendingReadback, GpuError> {
        buffers.reserve(&self.device, BufferId::Staging, bytes)?;
        self.fetch_timed(buffers, id, first, bytes, Vec::new())
    }

    fn fetch_timed(
        &self,
        buffers: &BufferSet,
        id: BufferId,
        first: u64,
        bytes: u64,
        timed: Vec<GpuStep>,
    ) -> Result<PendingReadback, GpuError> {
        let (from, staging) = (buffers.get(id)?, buffers.get(BufferId::Staging)?);
        let stamps = bytes.next_multiple_of(8);
        let all = if timed.is_empty() { bytes } else { stamps + STAMP_BYTES };
        let mapped = Arc::<OnceLock<bool>>::default();
        let on_mapped = mapped.clone();
        let submission = self.device.guard(|| {
            let mut encoder = self.encoder();
            encoder.copy_buffer_to_buffer(from, first, staging, 0, bytes);
            if let Some(timestamps) = &buffers.timestamps {
                timestamps.resolve(&mut encoder, &timed, staging, stamps);
            }
            let submission = self.device.queue.submit([encoder.finish()]);
            let done = move |result: Result<(), _>| {
                on_mapped.get_or_init(|| result.is_ok());
            };
            staging.slice(..all).map_async(MapMode::Read, done);
            submission
        })?;
        Ok(PendingReadback { submission, bytes, timed, mapped })
    }

    /// Returns whether `readback` need not be waited for any more.
    pub(super) fn is_finished(&self, readback: &PendingReadback) -> bool {
        self.device.look();
        readback.mapped.get().is_some()
    }

    /// Waits for `readback`; returns the numbers, and the times of the steps that were timed.
    ///
    /// # Errors
    /// [`GpuError::Lost`] if the result never arrives.
    pub fn finish(
        &self,
        buffers: &BufferSet,
        readback: PendingReadback,
    ) -> Result<(Vec<u32>, StepNanoseconds), GpuError> {
        self.arrive(&readback)?;
        let staging = buffers.get(BufferId::Staging)?;
        let times = step_times(buffers, staging, &readback)?;
        let numbers = bytemuck::pod_collect_to_vec(&mapped(staging, 0..readback.bytes)?);
        self.device.guard(|| staging.unmap())?;
        Ok((numbers, times))
    }

    /// As [`GpuEngine::finish`], but the numbers stay where the device has written them, in a buffer that `pool` lends.
    ///
    /// # Errors
    /// As [`GpuEngine::finish`].
    pub(super) fn finish_shared(
        &self,
        buffers: &mut BufferSet,
        readback: PendingReadback,
        pool: &Arc<StagingPool>,
    ) -> Result<Landed, GpuError> {
        self.arrive(&readback)?;
        let times = step_times(buffers, buffers.get(BufferId::Staging)?, &readback)?;
        let view = mapped(buffers.get(BufferId::Staging)?, 0..readback.bytes)?;
        let staging = buffers.take(BufferId::Staging).ok_or_else(|| GpuError::Lost("a buffer is missing".into()))?;
        let may_stay = pool.lend(&staging);
        Ok(Landed { numbers: Arc::new(LentNumbers::new(view, staging, pool.clone())), may_stay, times })
    }

    fn arrive(&self, readback: &PendingReadback) -> Result<(), GpuError> {
        self.device.wait(readback.submission.clone())?;
        match readback.mapped.get() {
            Some(true) => Ok(()),
            _ => Err(GpuError::Lost("a buffer could not be read back".into())),
        }
    }

    /// Returns the first `count` numbers of buffer `id`, after everything that was started is done.
    ///
    /// # Errors
    /// As [`GpuEngine::start`] and [`GpuEngine::finish`].
    pub fn numbers(&self, buffers: &mut BufferSet, id: BufferId, count: u64) -> Result<Vec<u32>, GpuError> {
        self.numbers_from(buffers, id, 0, count)
    }

    /// Returns `count` numbers of buffer `id` from number `first` on.
    ///
    /// # Errors
    /// As [`GpuEngine::numbers`].
    pub fn numbers_from(
        &self,
        buffers: &mut BufferSet,
        id: BufferId,
        first: u64,
        count: u64,
    ) -> Result<Vec<u32>, GpuError> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let readback = self.fetch(buffers, id, 4 * first, 4 * count)?;
        Ok(self.finish(buffers, readback)?.0)
    }

    /// Creates the buffers and compiles the shaders that `recording` needs.
    fn prepare(&mut self, buffers: &mut BufferSet, recording: &Recording) -> Result<(), GpuError> {
        let mut runs = 0;
        for command in &recording.commands {
            match command {
                GpuCommand::Reserve(id, bytes) => buffers.reserve(&self.device, *id, *bytes)?,
                GpuCommand::Run(program, ..) => {
                    runs += 1;
                    if !self.pipelines.contains_key(&program.key()) {
                        let pipeline = self.device.guard(|| compile(&self.device, program))?;
                        self.pipelines.insert(program.key(), pipeline);
                    }
                }
                GpuCommand::Step(..) | GpuCommand::Upload(..) | GpuCommand::Clear(..) => {}
            }
        }
        buffers.reserve(&self.device, BufferId::Params, (runs * BufferSet::STRIDE).max(BufferSet::STRIDE))
    }

    fn encoder(&self) -> CommandEncoder {
        self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Submits all commands; returns the last submission, and the steps that have dispatches.
    fn submit_all(
        &self,
        buffers: &mut BufferSet,
        recording: &Recording,
    ) -> Result<(wgpu::SubmissionIndex, Vec<GpuStep>), GpuError> {
        let queue = &self.device.queue;
        let (parts, steps) = parts(recording);
        let (uploaded, starts) = self.upload(buffers, recording)?;
        let mut starts = starts.into_iter();
        let mut copy_up = |encoder: &mut CommandEncoder, to: &wgpu::Buffer, bytes: usize| {
            let start = starts.next().unwrap_or_default();
            encoder.copy_buffer_to_buffer(&uploaded, start, to, 0, bytes as u64);
        };
        let mut encoder = self.encoder();
        copy_up(&mut encoder, buffers.get(BufferId::Params)?, BufferSet::STRIDE as usize * recording.dispatches());
        for part in parts {
            match part {
                Part::Pass(pass) => {
                    self.encode(&mut encoder, buffers, &pass)?;
                    if pass.ends_submission {
                        queue.submit([std::mem::replace(&mut encoder, self.encoder()).finish()]);
                    }
                }
                Part::Other(GpuCommand::Upload(id, numbers)) => {
                    copy_up(&mut encoder, buffers.get(*id)?, size_of_val(&numbers[..]));
                }
                Part::Other(GpuCommand::Clear(id, bytes)) => encoder.clear_buffer(buffers.get(*id)?, 0, Some(*bytes)),
                Part::Other(GpuCommand::Reserve(..) | GpuCommand::Step(..) | GpuCommand::Run(..)) => {}
            }
        }
        let submission = queue.submit([encoder.finish()]);
        buffers.upload.iter().for_each(UploadBuffer::map_again);
        Ok((submission, steps))
    }

    /// Writes the parameters of all dispatches, then what is uploaded, into the buffer that goes up; returns it, and where each part begins.
    fn upload(&self, buffers: &mut BufferSet, recording: &Recording) -> Result<(wgpu::Buffer, Vec<u64>), GpuError> {
        let params = params(recording);
        let uploads = recording.commands.iter().filter_map(|command| match command {
            GpuCommand::Upload(_, numbers) => Some(bytemuck::cast_slice(numbers)),
            _ => None,
        });
        let parts: Vec<&[u8]> = std::iter::once(&params[..]).chain(uploads).collect();
        let upload = UploadBuffer::with_room(buffers.upload.take(), &self.device, room_for(&parts))?;
        buffers.upload.insert(upload).write(&parts)
    }

    fn encode(&self, encoder: &mut CommandEncoder, buffers: &mut BufferSet, pass: &Pass) -> Result<(), GpuError> {
        for dispatch in &pass.dispatches {
            self.prepare_bind_group(buffers, dispatch)?;
        }
        let timestamp_writes = buffers.timestamps.as_ref().and_then(|timestamps| timestamps.writes(pass.marks));
        let mut encoded = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        for dispatch in &pass.dispatches {
            encoded.set_pipeline(self.pipeline(&dispatch.program)?);
            encoded.set_bind_group(0, buffers.bind_groups.get(&bind_group_key(dispatch)), &[]);
            encoded.dispatch_workgroups(dispatch.workgroups[0], dispatch.workgroups[1], 1);
        }
        Ok(())
    }

    /// Makes sure that `buffers` has the bind group of `dispatch`.
    fn prepare_bind_group(&self, buffers: &mut BufferSet, dispatch: &Dispatch) -> Result<(), GpuError> {
        let (key, program) = (bind_group_key(dispatch), &dispatch.program);
        if buffers.bind_groups.contains_key(&key) {
            return Ok(());
        }
        let (size, offset) = (wgpu::BufferSize::new(PARAM_BYTES), dispatch.number * BufferSet::STRIDE);
        let uniform = BufferBinding { buffer: buffers.get(BufferId::Params)?, offset, size };
        let mut entries = vec![BindGroupEntry { binding: 0, resource: BindingResource::Buffer(uniform) }];
        for &(binding, id) in program.bindings {
            entries.push(BindGroupEntry { binding, resource: buffers.get(id)?.as_entire_binding() });
        }
        let layout = self.pipeline(program)?.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
        let bind_group = self.device.device.create_bind_group(&descriptor);
        buffers.bind_groups.insert(key, bind_group);
        Ok(())
    }

    fn pipeline(&self, program: &ShaderProgram) -> Result<&ComputePipeline, GpuError> {
        self.pipelines.get(&program.key()).ok_or_else(|| GpuError::Refused("a shader is missing".into()))
    }
}

fn bind_group_key(dispatch: &Dispatch) -> BindGroupKey {
    (dispatch.program.key(), dispatch.program.bindings, dispatch.number)
}

/// Returns the bytes of a staging buffer that is mapped.
fn mapped(staging: &wgpu::Buffer, range: std::ops::Range<u64>) -> Result<BufferView, GpuError> {
    staging.slice(range).get_mapped_range().map_err(|error| GpuError::Lost(error.to_string()))
}

/// Returns the times of the steps of `readback`, which has arrived in `staging`.
fn step_times(
    buffers: &BufferSet,
    staging: &wgpu::Buffer,
    readback: &PendingReadback,
) -> Result<StepNanoseconds, GpuError> {
    let Some(timestamps) = buffers.timestamps.as_ref().filter(|_| !readback.timed.is_empty()) else {
        return Ok(StepNanoseconds::default());
    };
    let first = readback.bytes.next_multiple_of(8);
    let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&mapped(staging, first..first + STAMP_BYTES)?);
    Ok(timestamps.nanoseconds(&stamps, &readback.timed))
}

/// Bytes of the parameters of a dispatch.
const PARAM_BYTES: u64 = 32;

/// Returns the parameters of all dispatches.
fn params(recording: &Recording) -> Vec<u8> {
    let mut bytes = Vec::new();
    for command in &recording.commands {
        if let GpuCommand::Run(_, params, ..) = command {
            bytes.extend_from_slice(bytemuck::cast_slice(params));
            bytes.resize(bytes.len().next_multiple_of(BufferSet::STRIDE as usize), 0);
        }
    }
    bytes
}

fn compile(device: &Device, program: &ShaderProgram) -> ComputePipeline {
    let module = device.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(program.file),
        source: wgpu::ShaderSource::Wgsl(program.source.into()),
    });
    device.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(program.entry),
        layout: None,
        module: &module,
        entry_point: Some(program.entry),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}
