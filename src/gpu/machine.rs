//! Carries out recordings on a device.

use crate::gpu::Fault;
use crate::gpu::buffers::{Name, Set};
use crate::gpu::clock::{Clock, Marks, STAMP_BYTES, StepTimes, marks};
use crate::gpu::device::Device;
use crate::gpu::steps::{Command, Groups, Program, Recording, Step};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::{BindGroupEntry, BindingResource, BufferBinding, CommandEncoder, ComputePipeline, MapMode};

/// Uploads are cut in pieces of this many bytes, which drivers take faster than one large one.
const UPLOAD: usize = 32 << 20;
/// Workgroups after which what is recorded so far is handed over to the GPU.
const GROUPS_AT_ONCE: u64 = 1 << 18;

/// A device with its pipelines.
pub struct Machine {
    device: Device,
    pipelines: HashMap<Program, ComputePipeline>,
}

/// A recording under way, whose result is coming back.
pub struct Ticket {
    submission: wgpu::SubmissionIndex,
    bytes: u64,
    /// Those whose timestamps come back too.
    timed: Vec<Step>,
    mapped: Arc<AtomicBool>,
}

impl Machine {
    /// A machine on an opened device.
    pub fn new(device: Device) -> Machine {
        Machine { device, pipelines: HashMap::new() }
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Starts `recording` on the buffers of `set`.
    ///
    /// # Errors
    /// [`Fault`] if the device refuses; nothing is under way then that matters.
    pub fn start(&mut self, set: &mut Set, recording: &Recording) -> Result<wgpu::SubmissionIndex, Fault> {
        self.prepare(set, recording)?;
        self.device.guard(|| self.submit_all(set, recording, None))?
    }

    /// Starts `recording`, then the way back of the first `bytes` bytes of buffer `name`, and of the steps' times.
    ///
    /// # Errors
    /// As [`Machine::start`].
    pub fn start_and_fetch(
        &mut self,
        set: &mut Set,
        recording: &Recording,
        name: Name,
        bytes: u64,
    ) -> Result<Ticket, Fault> {
        set.need(&self.device, Name::Staging, bytes.next_multiple_of(8) + STAMP_BYTES)?;
        self.prepare(set, recording)?;
        if set.clock.is_none() {
            set.clock = Clock::new(&self.device)?;
        }
        let (marks, steps) = marks(recording);
        self.device.guard(|| self.submit_all(set, recording, Some(&marks)))??;
        let timed = if set.clock.is_some() { steps } else { Vec::new() };
        self.fetch_timed(set, name, 0, bytes, timed)
    }

    /// Starts the way back of `bytes` bytes of buffer `name`, from byte `first` on.
    ///
    /// # Errors
    /// As [`Machine::start`].
    pub fn fetch(&self, set: &mut Set, name: Name, first: u64, bytes: u64) -> Result<Ticket, Fault> {
        set.need(&self.device, Name::Staging, bytes)?;
        self.fetch_timed(set, name, first, bytes, Vec::new())
    }

    fn fetch_timed(&self, set: &Set, name: Name, first: u64, bytes: u64, timed: Vec<Step>) -> Result<Ticket, Fault> {
        let (from, staging) = (set.get(name)?, set.get(Name::Staging)?);
        let stamps = bytes.next_multiple_of(8);
        let all = if timed.is_empty() { bytes } else { stamps + STAMP_BYTES };
        let mapped = Arc::<AtomicBool>::default();
        let on_mapped = mapped.clone();
        let submission = self.device.guard(|| {
            let mut encoder = self.encoder();
            encoder.copy_buffer_to_buffer(from, first, staging, 0, bytes);
            if let Some(clock) = &set.clock {
                clock.resolve(&mut encoder, &timed, staging, stamps);
            }
            let submission = self.device.queue.submit([encoder.finish()]);
            let done = move |result: Result<(), _>| on_mapped.store(result.is_ok(), Ordering::Release);
            staging.slice(..all).map_async(MapMode::Read, done);
            submission
        })?;
        Ok(Ticket { submission, bytes, timed, mapped })
    }

    /// Waits for what `ticket` stands for; the numbers, and the times of the steps where they were taken.
    ///
    /// # Errors
    /// [`Fault::Lost`] if it never comes.
    pub fn finish(&self, set: &Set, ticket: Ticket) -> Result<(Vec<u32>, StepTimes), Fault> {
        self.device.wait(ticket.submission)?;
        if !ticket.mapped.load(Ordering::Acquire) {
            return Err(Fault::Lost("a buffer could not be read back".into()));
        }
        let staging = set.get(Name::Staging)?;
        let mapped = |range| staging.slice(range).get_mapped_range().map_err(|e| Fault::Lost(e.to_string()));
        let numbers = bytemuck::pod_collect_to_vec(&mapped(0..ticket.bytes)?);
        let mut times = StepTimes::default();
        if let Some(clock) = set.clock.as_ref().filter(|_| !ticket.timed.is_empty()) {
            let first = ticket.bytes.next_multiple_of(8);
            let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&mapped(first..first + STAMP_BYTES)?);
            times = clock.times(&stamps, &ticket.timed);
        }
        self.device.guard(|| staging.unmap())?;
        Ok((numbers, times))
    }

    /// The first `count` numbers of buffer `name`, after all that was started.
    ///
    /// # Errors
    /// As [`Machine::start`] and [`Machine::finish`].
    pub fn numbers(&self, set: &mut Set, name: Name, count: u64) -> Result<Vec<u32>, Fault> {
        self.numbers_from(set, name, 0, count)
    }

    /// `count` numbers of buffer `name` from number `first` on.
    ///
    /// # Errors
    /// As [`Machine::numbers`].
    pub fn numbers_from(&self, set: &mut Set, name: Name, first: u64, count: u64) -> Result<Vec<u32>, Fault> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let ticket = self.fetch(set, name, 4 * first, 4 * count)?;
        Ok(self.finish(set, ticket)?.0)
    }

    /// Makes buffers and pipelines.
    fn prepare(&mut self, set: &mut Set, recording: &Recording) -> Result<(), Fault> {
        let mut runs = 0;
        for command in &recording.commands {
            match command {
                Command::Need(name, bytes) => set.need(&self.device, *name, *bytes)?,
                Command::Run(program, ..) => {
                    runs += 1;
                    if !self.pipelines.contains_key(program) {
                        let pipeline = self.device.guard(|| compile(&self.device, program))?;
                        self.pipelines.insert(*program, pipeline);
                    }
                }
                Command::Step(..) | Command::Upload(..) | Command::Clear(..) | Command::Copy(..) => {}
            }
        }
        set.need(&self.device, Name::Params, (runs * Set::STRIDE).max(Set::STRIDE))
    }

    fn encoder(&self) -> CommandEncoder {
        self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    fn submit_all(
        &self,
        set: &Set,
        recording: &Recording,
        marks: Option<&[Marks]>,
    ) -> Result<wgpu::SubmissionIndex, Fault> {
        let queue = &self.device.queue;
        queue.write_buffer(set.get(Name::Params)?, 0, &params(recording));
        let mut encoder = self.encoder();
        let (mut runs, mut groups) = (0, 0);
        for command in &recording.commands {
            match command {
                Command::Need(..) | Command::Step(..) => {}
                Command::Upload(name, numbers) => {
                    let buffer = set.get(*name)?;
                    for (i, piece) in bytemuck::cast_slice::<u32, u8>(numbers).chunks(UPLOAD).enumerate() {
                        queue.write_buffer(buffer, (i * UPLOAD) as u64, piece);
                    }
                }
                Command::Clear(name, bytes) => encoder.clear_buffer(set.get(*name)?, 0, Some(*bytes)),
                Command::Copy(from, to, bytes) => {
                    encoder.copy_buffer_to_buffer(set.get(*from)?, 0, set.get(*to)?, 0, *bytes);
                }
                Command::Run(program, _, size) => {
                    let marks = marks.and_then(|marks| marks.get(runs as usize)).copied().unwrap_or_default();
                    self.encode(&mut encoder, set, program, *size, runs * Set::STRIDE, marks)?;
                    runs += 1;
                    groups += match size {
                        Groups::Fixed([x, y]) => u64::from(*x) * u64::from(*y),
                        Groups::Indirect(_) => 0,
                    };
                    if groups > GROUPS_AT_ONCE {
                        groups = 0;
                        queue.submit([std::mem::replace(&mut encoder, self.encoder()).finish()]);
                    }
                }
            }
        }
        Ok(queue.submit([encoder.finish()]))
    }

    fn encode(
        &self,
        encoder: &mut CommandEncoder,
        set: &Set,
        program: &Program,
        groups: Groups,
        params: u64,
        marks: Marks,
    ) -> Result<(), Fault> {
        let pipeline = self.pipelines.get(program).ok_or_else(|| Fault::Refused("a shader is missing".into()))?;
        let size = wgpu::BufferSize::new(PARAMS);
        let uniform = BufferBinding { buffer: set.get(Name::Params)?, offset: params, size };
        let mut entries = vec![BindGroupEntry { binding: 0, resource: BindingResource::Buffer(uniform) }];
        for &(binding, name) in program.bindings {
            entries.push(BindGroupEntry { binding, resource: set.get(name)?.as_entire_binding() });
        }
        let device = &self.device.device;
        let layout = pipeline.get_bind_group_layout(0);
        let bind_group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries });
        let timestamp_writes = set.clock.as_ref().and_then(|clock| clock.writes(marks));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        match groups {
            Groups::Fixed([x, y]) => pass.dispatch_workgroups(x, y, 1),
            Groups::Indirect(first) => pass.dispatch_workgroups_indirect(set.get(Name::Workgroups)?, 4 * first),
        }
        Ok(())
    }
}

/// Bytes of the parameters of a dispatch.
const PARAMS: u64 = 32;

/// The parameters of all dispatches.
fn params(recording: &Recording) -> Vec<u8> {
    let mut bytes = Vec::new();
    for command in &recording.commands {
        if let Command::Run(_, params, _) = command {
            bytes.extend_from_slice(bytemuck::cast_slice(params));
            bytes.resize(bytes.len().next_multiple_of(Set::STRIDE as usize), 0);
        }
    }
    bytes
}

fn compile(device: &Device, program: &Program) -> ComputePipeline {
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
