//! The time of every step by the GPU's own timestamps, next to the least time that moving its bytes takes.

use crate::on_device::buffer_id::BufferId;
use crate::on_device::buffers::BufferSet;
use crate::on_device::engine::GpuEngine;
use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::FilledAtlas;
use crate::on_device::recording::{GpuStep, Recording};
use crate::on_device::timestamps::StepNanoseconds;
use crate::options::VoronoiMethod;
use serde::Serialize;
use std::time::Instant;

/// How many runs the median is taken of.
const RUNS: usize = 3;
/// How many bytes are copied to measure the bandwidth of memory.
const COPY_BYTES: u64 = 64 << 20;
/// How often a run copies them, so that the time to submit work does not count.
const COPIES: u64 = 20;

/// The time of one step.
#[derive(Clone, Debug, Serialize)]
pub struct TimedStep {
    /// The step.
    pub step: &'static str,
    /// The milliseconds that it took: the median of some runs.
    pub milliseconds: f64,
    /// The bytes that it reads and writes at the least.
    pub bytes: u64,
    /// The milliseconds that copying as many bytes takes on this adapter; `None` if they go to or come from the CPU.
    pub floor: Option<f64>,
}

/// The times of all steps on one atlas.
#[derive(Clone, Debug, Serialize)]
pub struct AtlasTiming {
    /// The number of leaves.
    pub leaves: usize,
    /// The number of sites.
    pub sites: usize,
    /// The number of pixels.
    pub pixels: u32,
    /// The steps in order, if the adapter has timestamps; then everything from the CPU and back to it.
    pub steps: Vec<TimedStep>,
}

/// Returns the bytes per second, read and written together, of a shader that copies within the GPU's memory.
///
/// # Errors
/// [`GpuError`] of the device.
pub(super) fn copy_bandwidth(engine: &mut GpuEngine, buffers: &mut BufferSet) -> Result<f64, GpuError> {
    let mut recording = Recording::default();
    (0..COPIES).for_each(|_| recording.copy_labels(COPY_BYTES));
    let mut run = || {
        let start = Instant::now();
        let submission = engine.start(buffers, &recording)?;
        engine.device().wait(submission)?;
        Ok(start.elapsed().as_secs_f64())
    };
    // The first run creates the buffers.
    run()?;
    let seconds = median([run()?, run()?, run()?]);
    Ok((2 * COPIES * COPY_BYTES) as f64 / seconds)
}

/// Times all steps on an atlas; `bandwidth` is that of copies.
///
/// # Errors
/// [`GpuError`] of the device; [`GpuError::OutOfMemory`] if the atlas is too large for it.
pub(super) fn time_steps(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    filled: &FilledAtlas,
    bandwidth: f64,
) -> Result<AtlasTiming, GpuError> {
    let mut steps = Vec::new();
    let recording = Recording::mesh(&filled.atlas, &filled.sites, VoronoiMethod::Exact);
    let (times, whole) = time(engine, buffers, filled, &recording)?;
    let jfa = Recording::mesh(&filled.atlas, &filled.sites, VoronoiMethod::Jfa);
    let (jfa_times, _) = time(engine, buffers, filled, &jfa)?;
    let mut add = |name, step: GpuStep, times: StepNanoseconds, recording: &Recording| {
        let (milliseconds, bytes) = (times[step as usize] as f64 / 1e6, recording.traffic_of(step));
        let floor = Some(1000.0 * bytes as f64 / bandwidth);
        steps.extend((milliseconds > 0.0).then_some(TimedStep { step: name, milliseconds, bytes, floor }));
    };
    for step in GpuStep::ALL {
        add(step.name(), step, times, &recording);
        if step == GpuStep::Voronoi {
            add("or G2 by 1+JFA", step, jfa_times, &jfa);
        }
    }
    let bytes = recording.traffic();
    steps.push(TimedStep { step: "all, there and back", milliseconds: 1000.0 * whole, bytes, floor: None });
    let sites = filled.sites.len() - filled.atlas.leaves.len();
    Ok(AtlasTiming { leaves: filled.atlas.leaves.len(), sites, pixels: filled.atlas.pixels, steps })
}

/// Returns the times of the steps, and the seconds from the upload to the end of the readback.
fn time(
    engine: &mut GpuEngine,
    buffers: &mut BufferSet,
    filled: &FilledAtlas,
    recording: &Recording,
) -> Result<(StepNanoseconds, f64), GpuError> {
    let mut run = || {
        let start = Instant::now();
        let readback = engine.start_and_fetch(buffers, recording, BufferId::Returned, filled.bytes_back())?;
        let (_, times) = engine.finish(buffers, readback)?;
        Ok((times, start.elapsed().as_secs_f64()))
    };
    // The first run creates buffers and compiles shaders.
    run()?;
    let runs = [run()?, run()?, run()?];
    let mut times = StepNanoseconds::default();
    for (step, time) in times.iter_mut().enumerate() {
        *time = median(runs.map(|(times, _)| times[step] as f64)) as u64;
    }
    Ok((times, median(runs.map(|(_, seconds)| seconds))))
}

fn median(mut runs: [f64; RUNS]) -> f64 {
    runs.sort_by(f64::total_cmp);
    runs[RUNS / 2]
}
