//! The time of every step, beside the least that moving its bytes takes.

use crate::gpu::Fault;
use crate::gpu::buffers::{Name, Set};
use crate::gpu::machine::Machine;
use crate::gpu::options::VoronoiMethod;
use crate::gpu::steps::{Command, Recording, Size, jfa_steps, total};
use serde::Serialize;
use std::time::Instant;

/// Runs of which the median is taken.
const RUNS: usize = 3;
/// A run repeats a step until it lasts about this long, so that handing work over does not count.
const RUN_SECONDS: f64 = 0.02;
/// Repetitions in a run at the most.
const MOST_REPEATS: usize = 20;
/// Bytes that are copied to see how fast memory is.
const COPY: u64 = 64 << 20;

/// The time of one step.
#[derive(Clone, Debug, Serialize)]
pub struct StepTime {
    /// The step.
    pub step: &'static str,
    /// Milliseconds that it took, the median of some runs.
    pub milliseconds: f64,
    /// Bytes that it has to read and write, were every number touched once.
    pub bytes: u64,
    /// Milliseconds that copying as many bytes takes on this adapter; `None` where they go to or come from the CPU.
    pub floor: Option<f64>,
}

/// The times of all steps on one texture.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    /// Width and height of the texture.
    pub side: u32,
    /// Sites in it.
    pub sites: u64,
    /// Triangles that came out.
    pub triangles: u64,
    /// In order.
    pub steps: Vec<StepTime>,
}

/// Bytes a second that a copy within the GPU's memory reads and writes, together.
///
/// # Errors
/// [`Fault`] of the device.
pub(super) fn copy_bandwidth(machine: &mut Machine, set: &mut Set) -> Result<f64, Fault> {
    let mut recording = Recording::default();
    recording.commands.extend([Name::Labels, Name::Flood].map(|name| Command::Need(name, COPY)));
    recording.commands.push(Command::Copy(Name::Labels, Name::Flood, COPY));
    let milliseconds = time(machine, set, &recording)?;
    Ok(2.0 * COPY as f64 / (milliseconds / 1000.0))
}

/// Times all steps on a texture of `side` x `side` with sites at `pixels`; `bandwidth` is that of copies.
///
/// # Errors
/// [`Fault`] of the device, [`Fault::OutOfMemory`] if the texture is too large for it.
pub(super) fn time_steps(
    machine: &mut Machine,
    set: &mut Set,
    side: u32,
    pixels: Vec<u32>,
    bandwidth: f64,
) -> Result<Timing, Fault> {
    let size = Size { width: side, height: side };
    let (sites, all, segments) = (pixels.len() as u64, size.pixels(), u64::from(size.all_segments()));
    // At most two triangles a site, and some for what the texture gets wrong.
    let room = (2 * sites + sites / 4 + 64) as u32;
    let jumps = jfa_steps(size).len() as u64;
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
        let milliseconds = time(machine, set, &recording)?;
        times.push(StepTime { step, milliseconds, bytes, floor: on_gpu.then_some(floor(bytes, bandwidth)) });
    }
    // Counting again and again, to be timed, has spoilt the sums.
    machine.start(set, &record(|r| r.find_vertices(size)))?;
    machine.start(set, &record(|r| r.count(size)))?;
    let triangles = u64::from(machine.numbers_from(set, Name::Counts, u64::from(total(size)), 1)?[0]);
    let bytes = 12 * segments + (12 + 16 + 12) * triangles;
    let milliseconds = time(machine, set, &record(|r| r.make_triangles(size, room)))?;
    times.push(StepTime { step: "G6 triangles", milliseconds, bytes, floor: Some(floor(bytes, bandwidth)) });
    let milliseconds = time_readback(machine, set, all)?;
    times.push(StepTime { step: "labels back", milliseconds, bytes: 4 * all, floor: None });
    Ok(Timing { side, sites, triangles, steps: times })
}

fn record(f: impl FnOnce(&mut Recording)) -> Recording {
    let mut recording = Recording::default();
    f(&mut recording);
    recording
}

/// Moves the uploads of `recording` to one of their own.
fn take_uploads(recording: &mut Recording) -> Recording {
    let needs = recording.commands.iter().filter(|c| matches!(c, Command::Need(..))).cloned().collect::<Vec<_>>();
    let (uploads, rest) =
        std::mem::take(&mut recording.commands).into_iter().partition(|c| matches!(c, Command::Upload(..)));
    recording.commands = rest;
    let uploads: Vec<Command> = uploads;
    Recording { commands: needs.into_iter().chain(uploads).collect() }
}

fn floor(bytes: u64, bandwidth: f64) -> f64 {
    1000.0 * bytes as f64 / bandwidth
}

/// Milliseconds that `recording` takes.
fn time(machine: &mut Machine, set: &mut Set, recording: &Recording) -> Result<f64, Fault> {
    // Once for the buffers and the shaders, once to see how long it takes.
    seconds(machine, set, recording)?;
    let once = seconds(machine, set, recording)?;
    let repeats = ((RUN_SECONDS / once) as usize).clamp(1, MOST_REPEATS);
    let repeated =
        Recording { commands: std::iter::repeat_n(&recording.commands, repeats).flatten().cloned().collect() };
    let mut runs = [once; RUNS];
    for run in &mut runs {
        *run = seconds(machine, set, &repeated)? / repeats as f64;
    }
    Ok(1000.0 * median(runs))
}

fn time_readback(machine: &mut Machine, set: &mut Set, numbers: u64) -> Result<f64, Fault> {
    let mut runs = [0.0; RUNS];
    for run in &mut runs {
        let start = Instant::now();
        machine.numbers(set, Name::Labels, numbers)?;
        *run = start.elapsed().as_secs_f64();
    }
    Ok(1000.0 * median(runs))
}

fn seconds(machine: &mut Machine, set: &mut Set, recording: &Recording) -> Result<f64, Fault> {
    let start = Instant::now();
    let submission = machine.start(set, recording)?;
    machine.device().wait(submission)?;
    Ok(start.elapsed().as_secs_f64())
}

fn median(mut runs: [f64; RUNS]) -> f64 {
    runs.sort_by(f64::total_cmp);
    runs[RUNS / 2]
}
