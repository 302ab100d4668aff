//! The time of every step, next to the least time that moving its bytes takes.

use crate::gpu::buffer_id::BufferId;
use crate::gpu::buffers::BufferSet;
use crate::gpu::engine::GpuEngine;
use crate::gpu::error::GpuError;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::prefix_sums::position_of_total;
use crate::gpu::steps::{GpuCommand, Recording};
use crate::gpu::texture_size::TextureSize;
use serde::Serialize;
use std::time::Instant;

/// How many runs the median is taken of.
const RUNS: usize = 3;
/// A run repeats a step until it lasts about this long, so that the time to submit work does not count.
const RUN_SECONDS: f64 = 0.02;
/// The most repetitions in a run.
const MAX_REPEATS: usize = 20;
/// How many bytes are copied to measure the bandwidth of memory.
const COPY_BYTES: u64 = 64 << 20;

/// The time of one step.
#[derive(Clone, Debug, Serialize)]
pub struct TimedStep {
    /// The step.
    pub step: &'static str,
    /// The milliseconds that it took: the median of some runs.
    pub milliseconds: f64,
    /// The bytes that it reads and writes if it touches every number once.
    pub bytes: u64,
    /// The milliseconds that copying as many bytes takes on this adapter; `None` if they go to or come from the CPU.
    pub floor: Option<f64>,
}

/// The times of all steps on one texture.
#[derive(Clone, Debug, Serialize)]
pub struct TextureTiming {
    /// The width and height of the texture.
    pub side: u32,
    /// The number of sites in it.
    pub sites: u64,
    /// The number of triangles that the steps made.
    pub triangles: u64,
    /// The steps, in order.
    pub steps: Vec<TimedStep>,
}

/// Returns the bytes per second, read and written together, of a copy within the GPU's memory.
///
/// # Errors
/// [`GpuError`] of the device.
pub(super) fn copy_bandwidth(engine: &mut GpuEngine, buffers: &mut BufferSet) -> Result<f64, GpuError> {
    let mut recording = Recording::default();
    recording.commands.extend([BufferId::Labels, BufferId::Flood].map(|id| GpuCommand::Reserve(id, COPY_BYTES)));
    recording.commands.push(GpuCommand::Copy(BufferId::Labels, BufferId::Flood, COPY_BYTES));
    let milliseconds = time(engine, buffers, &recording)?;
    Ok(2.0 * COPY_BYTES as f64 / (milliseconds / 1000.0))
}

/// Times all steps on a texture of `side` x `side` with sites at `pixels`; `bandwidth` is that of copies.
///
/// # Errors
/// [`GpuError`] of the device; [`GpuError::OutOfMemory`] if the texture is too large for it.
pub(super) fn time_steps(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    side: u32,
    pixels: Vec<u32>,
    bandwidth: f64,
) -> Result<TextureTiming, GpuError> {
    let size = TextureSize { width: side, height: side };
    let (sites, all, segments) = (pixels.len() as u64, size.pixels(), u64::from(size.all_segments()));
    // A site has at most two triangles; leave some room for what the texture gets wrong.
    let room = (2 * sites + sites / 4 + 64) as u32;
    let jumps = size.jump_steps().len() as u64;
    let mut write = record(|r| r.write_sites(size, pixels));
    let upload = take_uploads(&mut write);
    let steps = [
        ("upload", upload, 4 * sites, false),
        ("G1 write sites", write, 4 * all + 12 * sites, true),
        ("G2 jfa", record(|r| r.voronoi(size, VoronoiMethod::Jfa)), 8 * all * (jumps + 1), true),
        ("G3 islands", record(|r| r.remove_islands(size)), 4 * all, true),
        ("G2 exact", record(|r| r.voronoi(size, VoronoiMethod::Exact)), 8 * all + all / 2, true),
        ("G4 vertices", record(|r| r.find_vertices(size)), 4 * all + 12 * segments, true),
        ("G5 count", record(|r| r.count(size)), 12 * segments, true),
    ];
    let mut times = Vec::new();
    for (step, recording, bytes, on_gpu) in steps {
        let milliseconds = time(engine, buffers, &recording)?;
        times.push(TimedStep { step, milliseconds, bytes, floor: on_gpu.then_some(floor(bytes, bandwidth)) });
    }
    // The repetitions of the count have spoilt the sums: compute them once more.
    engine.start(buffers, &record(|r| r.find_vertices(size)))?;
    engine.start(buffers, &record(|r| r.count(size)))?;
    let total = u64::from(position_of_total(size));
    let triangles = u64::from(engine.numbers_from(buffers, BufferId::Counts, total, 1)?[0]);
    let bytes = 12 * segments + (12 + 16 + 12) * triangles;
    let milliseconds = time(engine, buffers, &record(|r| r.make_triangles(size, room)))?;
    times.push(TimedStep { step: "G6 triangles", milliseconds, bytes, floor: Some(floor(bytes, bandwidth)) });
    let milliseconds = time_readback(engine, buffers, all)?;
    times.push(TimedStep { step: "labels back", milliseconds, bytes: 4 * all, floor: None });
    Ok(TextureTiming { side, sites, triangles, steps: times })
}

fn record(f: impl FnOnce(&mut Recording)) -> Recording {
    let mut recording = Recording::default();
    f(&mut recording);
    recording
}

/// Moves the uploads of `recording` to a recording of their own.
fn take_uploads(recording: &mut Recording) -> Recording {
    let reserve = recording.commands.iter().filter(|c| matches!(c, GpuCommand::Reserve(..))).cloned();
    let mut commands: Vec<GpuCommand> = reserve.collect();
    let (uploads, rest): (Vec<_>, Vec<_>) =
        std::mem::take(&mut recording.commands).into_iter().partition(|c| matches!(c, GpuCommand::Upload(..)));
    recording.commands = rest;
    commands.extend(uploads);
    Recording { commands }
}

fn floor(bytes: u64, bandwidth: f64) -> f64 {
    1000.0 * bytes as f64 / bandwidth
}

/// Returns the milliseconds that `recording` takes.
fn time(engine: &mut GpuEngine, buffers: &mut BufferSet, recording: &Recording) -> Result<f64, GpuError> {
    // The first run creates buffers and compiles shaders, the second shows how long a run takes.
    seconds(engine, buffers, recording)?;
    let once = seconds(engine, buffers, recording)?;
    let repeats = ((RUN_SECONDS / once) as usize).clamp(1, MAX_REPEATS);
    let repeated =
        Recording { commands: std::iter::repeat_n(&recording.commands, repeats).flatten().cloned().collect() };
    let mut runs = [once; RUNS];
    for run in &mut runs {
        *run = seconds(engine, buffers, &repeated)? / repeats as f64;
    }
    Ok(1000.0 * median(runs))
}

fn time_readback(engine: &mut GpuEngine, buffers: &mut BufferSet, numbers: u64) -> Result<f64, GpuError> {
    let mut runs = [0.0; RUNS];
    for run in &mut runs {
        let start = Instant::now();
        engine.numbers(buffers, BufferId::Labels, numbers)?;
        *run = start.elapsed().as_secs_f64();
    }
    Ok(1000.0 * median(runs))
}

fn seconds(engine: &mut GpuEngine, buffers: &mut BufferSet, recording: &Recording) -> Result<f64, GpuError> {
    let start = Instant::now();
    let submission = engine.start(buffers, recording)?;
    engine.device().wait(submission)?;
    Ok(start.elapsed().as_secs_f64())
}

fn median(mut runs: [f64; RUNS]) -> f64 {
    runs.sort_by(f64::total_cmp);
    runs[RUNS / 2]
}
