//! Runs recordings on a device.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::buffers::BufferSet;
use crate::gpu::device::Device;
use crate::gpu::error::GpuError;
use crate::gpu::steps::{GpuCommand, GpuStep, Recording, ShaderProgram};
use crate::gpu::timestamps::{DispatchMarks, GpuTimestamps, STAMP_BYTES, StepNanoseconds, marks};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::{BindGroupEntry, BindingResource, BufferBinding, CommandEncoder, ComputePipeline, MapMode};

/// Uploads are cut into chunks of this many bytes, which drivers accept faster than one large upload.
const UPLOAD_CHUNK: usize = 32 << 20;
/// After this many workgroups, the commands so far are submitted to the GPU.
const WORKGROUPS_PER_SUBMISSION: u64 = 1 << 18;

/// A device with its compiled shaders.
pub struct GpuEngine {
    device: Device,
    pipelines: HashMap<ShaderProgram, ComputePipeline>,
}

/// A recording that is running, and whose result will be read back.
pub struct PendingReadback {
    submission: wgpu::SubmissionIndex,
    bytes: u64,
    /// The steps whose timestamps are read back too.
    timed: Vec<GpuStep>,
    mapped: Arc<AtomicBool>,
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
        self.device.guard(|| self.submit_all(buffers, recording, None))?
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
        let (marks, steps) = marks(recording);
        self.device.guard(|| self.submit_all(buffers, recording, Some(&marks)))??;
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
        let mapped = Arc::<AtomicBool>::default();
        let on_mapped = mapped.clone();
        let submission = self.device.guard(|| {
            let mut encoder = self.encoder();
            encoder.copy_buffer_to_buffer(from, first, staging, 0, bytes);
            if let Some(timestamps) = &buffers.timestamps {
                timestamps.resolve(&mut encoder, &timed, staging, stamps);
            }
            let submission = self.device.queue.submit([encoder.finish()]);
            let done = move |result: Result<(), _>| on_mapped.store(result.is_ok(), Ordering::Release);
            staging.slice(..all).map_async(MapMode::Read, done);
            submission
        })?;
        Ok(PendingReadback { submission, bytes, timed, mapped })
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
        self.finish_with(buffers, readback, <[u32]>::to_vec)
    }

    /// As [`GpuEngine::finish`], but `take` reads the numbers where the device has written them, so that nothing is copied twice.
    ///
    /// # Errors
    /// As [`GpuEngine::finish`].
    pub fn finish_with<T>(
        &self,
        buffers: &BufferSet,
        readback: PendingReadback,
        take: impl FnOnce(&[u32]) -> T,
    ) -> Result<(T, StepNanoseconds), GpuError> {
        self.device.wait(readback.submission)?;
        if !readback.mapped.load(Ordering::Acquire) {
            return Err(GpuError::Lost("a buffer could not be read back".into()));
        }
        let staging = buffers.get(BufferId::Staging)?;
        let mapped = |range| staging.slice(range).get_mapped_range().map_err(|e| GpuError::Lost(e.to_string()));
        let taken = {
            let bytes = mapped(0..readback.bytes)?;
            take(bytemuck::try_cast_slice(&bytes).map_err(|e| GpuError::Lost(e.to_string()))?)
        };
        let mut times = StepNanoseconds::default();
        if let Some(timestamps) = buffers.timestamps.as_ref().filter(|_| !readback.timed.is_empty()) {
            let first = readback.bytes.next_multiple_of(8);
            let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&mapped(first..first + STAMP_BYTES)?);
            times = timestamps.nanoseconds(&stamps, &readback.timed);
        }
        self.device.guard(|| staging.unmap())?;
        Ok((taken, times))
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
                    if !self.pipelines.contains_key(program) {
                        let pipeline = self.device.guard(|| compile(&self.device, program))?;
                        self.pipelines.insert(*program, pipeline);
                    }
                }
                GpuCommand::Step(..) | GpuCommand::Upload(..) | GpuCommand::Clear(..) | GpuCommand::Copy(..) => {}
            }
        }
        buffers.reserve(&self.device, BufferId::Params, (runs * BufferSet::STRIDE).max(BufferSet::STRIDE))
    }

    fn encoder(&self) -> CommandEncoder {
        self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    fn submit_all(
        &self,
        buffers: &BufferSet,
        recording: &Recording,
        marks: Option<&[DispatchMarks]>,
    ) -> Result<wgpu::SubmissionIndex, GpuError> {
        let queue = &self.device.queue;
        queue.write_buffer(buffers.get(BufferId::Params)?, 0, &params(recording));
        let mut encoder = self.encoder();
        let (mut runs, mut workgroups) = (0, 0);
        for command in &recording.commands {
            match command {
                GpuCommand::Reserve(..) | GpuCommand::Step(..) => {}
                GpuCommand::Upload(id, numbers) => self.upload(buffers.get(*id)?, numbers),
                GpuCommand::Clear(id, bytes) => encoder.clear_buffer(buffers.get(*id)?, 0, Some(*bytes)),
                GpuCommand::Copy(from, to, bytes) => {
                    encoder.copy_buffer_to_buffer(buffers.get(*from)?, 0, buffers.get(*to)?, 0, *bytes);
                }
                GpuCommand::Run(program, _, count, _) => {
                    let marks = marks.and_then(|marks| marks.get(runs as usize)).copied().unwrap_or_default();
                    self.encode(&mut encoder, buffers, program, *count, runs * BufferSet::STRIDE, marks)?;
                    runs += 1;
                    workgroups += u64::from(count[0]) * u64::from(count[1]);
                    if workgroups > WORKGROUPS_PER_SUBMISSION {
                        workgroups = 0;
                        queue.submit([std::mem::replace(&mut encoder, self.encoder()).finish()]);
                    }
                }
            }
        }
        Ok(queue.submit([encoder.finish()]))
    }

    fn upload(&self, buffer: &wgpu::Buffer, numbers: &[u32]) {
        for (i, chunk) in bytemuck::cast_slice::<u32, u8>(numbers).chunks(UPLOAD_CHUNK).enumerate() {
            self.device.queue.write_buffer(buffer, (i * UPLOAD_CHUNK) as u64, chunk);
        }
    }

    fn encode(
        &self,
        encoder: &mut CommandEncoder,
        buffers: &BufferSet,
        program: &ShaderProgram,
        workgroups: [u32; 2],
        params: u64,
        marks: DispatchMarks,
    ) -> Result<(), GpuError> {
        let pipeline = self.pipelines.get(program).ok_or_else(|| GpuError::Refused("a shader is missing".into()))?;
        let size = wgpu::BufferSize::new(PARAM_BYTES);
        let uniform = BufferBinding { buffer: buffers.get(BufferId::Params)?, offset: params, size };
        let mut entries = vec![BindGroupEntry { binding: 0, resource: BindingResource::Buffer(uniform) }];
        for &(binding, id) in program.bindings {
            entries.push(BindGroupEntry { binding, resource: buffers.get(id)?.as_entire_binding() });
        }
        let device = &self.device.device;
        let layout = pipeline.get_bind_group_layout(0);
        let bind_group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries });
        let timestamp_writes = buffers.timestamps.as_ref().and_then(|timestamps| timestamps.writes(marks));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(workgroups[0], workgroups[1], 1);
        Ok(())
    }
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
