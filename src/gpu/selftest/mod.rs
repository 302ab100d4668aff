//! What `gdt-batch gpu` shows: the adapters of this machine and which of them would be chosen, whether every step gives the same
//! numbers as its twin, and how long each step takes.

mod compare;
mod flips;
mod timing;

pub use compare::{StepComparison, compare};
pub use timing::{TextureTiming, TimedStep};

use crate::gpu::buffers::BufferSet;
use crate::gpu::device::{self, ADAPTER_VARIABLE, AdapterRequest, Device};
use crate::gpu::engine::GpuEngine;
use crate::gpu::error::GpuError;
use crate::gpu::texture_size::TextureSize;
use crate::{Error, Result};
use serde::Serialize;
use std::fmt;

/// The sides of the textures that are timed.
const SIDES: [u32; 5] = [1024, 2048, 4096, 8192, 16_384];
/// The largest side that is timed on a software renderer. Larger textures take minutes.
const SOFTWARE_SIDE: u32 = 4096;
/// Pixels per site, as in the textures of leaves.
const PIXELS_PER_SITE: u64 = 5;

/// What the self-test shows of an adapter.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterSummary {
    /// The adapter's name.
    pub name: String,
    /// The kind of GPU.
    pub kind: String,
    /// Vulkan, Metal or DX12.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether the adapter is a program on the CPU.
    pub software: bool,
    /// Bytes of the largest buffer.
    pub buffer: u64,
    /// Bytes of the largest buffer that a shader can bind.
    pub binding: u64,
    /// Pixels of the largest texture.
    pub pixels: u64,
    /// What the adapter lacks to run the shaders.
    pub lacks: Option<&'static str>,
}

/// The result of the self-test.
#[derive(Clone, Debug, Serialize)]
pub struct SelfTest {
    /// All adapters.
    pub adapters: Vec<AdapterSummary>,
    /// The adapter that `backend = "auto"` uses, or why there is none.
    pub auto: std::result::Result<String, String>,
    /// The adapter that `backend = "gpu"` uses, or why there is none. This adapter was tested.
    pub gpu: std::result::Result<String, String>,
    /// Every step compared with its twin.
    pub comparisons: Vec<StepComparison>,
    /// Bytes per second that a copy within the adapter's memory reads and writes.
    pub copy_bandwidth: f64,
    /// The times of the steps, by texture size.
    pub timings: Vec<TextureTiming>,
    /// Why larger textures were not timed.
    pub stopped: Option<String>,
}

impl SelfTest {
    /// Returns whether every number of every step was right.
    pub fn holds(&self) -> bool {
        self.comparisons.iter().all(|comparison| comparison.differing == 0)
    }
}

/// Lists the adapters, and tests the one called `name`, or if that is `None`, the one that `backend = "gpu"` would use. Times the
/// steps on textures of up to `side` pixels a side.
///
/// # Errors
/// [`Error::Config`] if there is no such adapter or it fails.
pub fn run(name: Option<&str>, side: Option<u32>) -> Result<SelfTest> {
    let adapters = device::adapters();
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let choose = |allow_software| device::choose(&infos, &AdapterRequest::new(name, allow_software));
    let name_of = |chosen: &std::result::Result<usize, String>| match chosen {
        Ok(i) => Ok(infos[*i].name.clone()),
        Err(why) => Err(why.clone()),
    };
    let (auto, gpu) = (choose(false), choose(true));
    let mut test = SelfTest {
        adapters: adapters.iter().map(describe).collect(),
        auto: name_of(&auto),
        gpu: name_of(&gpu),
        comparisons: Vec::new(),
        copy_bandwidth: 0.0,
        timings: Vec::new(),
        stopped: None,
    };
    let chosen = gpu.map_err(Error::Config)?;
    let max_side = side.unwrap_or(if test.adapters[chosen].software { SOFTWARE_SIDE } else { SIDES[SIDES.len() - 1] });
    let tested = Device::open(&adapters[chosen]).and_then(|device| fill(&mut test, device, max_side));
    tested.map_err(|error| Error::Config(format!("{}: {error}", infos[chosen].name)))?;
    Ok(test)
}

fn describe(adapter: &wgpu::Adapter) -> AdapterSummary {
    let (info, limits) = (adapter.get_info(), device::wanted_limits(&adapter.limits()));
    AdapterSummary {
        software: device::is_software(&info),
        kind: format!("{:?}", info.device_type),
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        name: info.name,
        buffer: limits.max_buffer_size,
        binding: limits.max_storage_buffer_binding_size,
        pixels: device::max_pixels(&limits),
        lacks: device::shortage(&limits),
    }
}

/// Compares and times the steps on `device`.
fn fill(test: &mut SelfTest, device: Device, max_side: u32) -> std::result::Result<(), GpuError> {
    let max_pixels = device::max_pixels(&device.limits);
    let (mut engine, mut buffers) = (GpuEngine::new(device), BufferSet::default());
    for (width, height, sites) in [(1000, 700, 140_000), (600, 500, 30)] {
        let size = TextureSize { width, height };
        test.comparisons.extend(compare(&mut engine, &mut buffers, size, &scatter(size, sites))?);
    }
    test.comparisons.push(compare::compare_predicates(&mut engine, &mut buffers)?);
    test.comparisons.extend(flips::compare_flips(&mut engine, &mut buffers)?);
    test.copy_bandwidth = timing::copy_bandwidth(&mut engine, &mut buffers)?;
    for side in SIDES.into_iter().filter(|&side| side <= max_side) {
        let size = TextureSize { width: side, height: side };
        if size.pixels() > max_pixels {
            test.stopped = Some(format!("this adapter does not support a texture of {side} x {side}"));
            break;
        }
        let sites = scatter(size, size.pixels() / PIXELS_PER_SITE);
        match timing::time_steps(&mut engine, &mut buffers, side, sites, test.copy_bandwidth) {
            Ok(timing) => test.timings.push(timing),
            Err(GpuError::OutOfMemory) => {
                test.stopped = Some(format!("a texture of {side} x {side} does not fit the adapter's memory"));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Returns pixels (y << 16 | x) that look random and are the same on every machine (splitmix64).
fn scatter(size: TextureSize, sites: u64) -> Vec<u32> {
    let mixed = |i: u64| {
        let mut v = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        v ^ (v >> 31)
    };
    let below = |bits: u64, end: u32| (((bits & 0xffff_ffff) * u64::from(end)) >> 32) as u32;
    (1..=sites).map(|i| below(mixed(i), size.height) << 16 | below(mixed(i) >> 32, size.width)).collect()
}

impl fmt::Display for SelfTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for adapter in &self.adapters {
            writeln!(f, "{adapter}")?;
        }
        let or_none = |chosen: &std::result::Result<String, String>| match chosen {
            Ok(name) => name.clone(),
            Err(why) => format!("none: {why}"),
        };
        writeln!(f, "backend = \"auto\" uses {}", or_none(&self.auto))?;
        writeln!(f, "backend = \"gpu\"  uses {} (set {ADAPTER_VARIABLE} to choose another)\n", or_none(&self.gpu))?;
        for c in &self.comparisons {
            let verdict = match c.first {
                None if c.differing == 0 => "same".into(),
                first => format!("{} DIFFER, the first (position, shader, twin): {first:?}", c.differing),
            };
            writeln!(f, "{:<10} {:>9} numbers {verdict}", c.step, c.numbers)?;
        }
        writeln!(
            f,
            "\ncopies read and write {:.1} GB/s; the floor is the time that a step's bytes take at this speed",
            self.copy_bandwidth / 1e9
        )?;
        for timing in &self.timings {
            writeln!(f, "\n{0} x {0}, {1} sites, {2} triangles", timing.side, timing.sites, timing.triangles)?;
            writeln!(f, "{:<16} {:>10} {:>10} {:>8} {:>10}", "step", "ms", "floor ms", "times", "MB")?;
            for step in &timing.steps {
                let TimedStep { step, milliseconds, bytes, floor } = step;
                let floor_text = floor.map_or("-".into(), |floor| format!("{floor:.3}"));
                let times = floor.map_or("-".into(), |floor| format!("{:.1}", milliseconds / floor));
                let megabytes = *bytes as f64 / 1e6;
                writeln!(f, "{step:<16} {milliseconds:>10.3} {floor_text:>10} {times:>8} {megabytes:>10.1}")?;
            }
        }
        self.stopped.iter().try_for_each(|why| writeln!(f, "\n{why}"))
    }
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let AdapterSummary { name, kind, backend, driver, .. } = self;
        writeln!(f, "{name} ({kind}, {backend}; {driver})")?;
        let side = (self.pixels as f64).sqrt();
        write!(
            f,
            "  buffers of {} MiB, {} MiB in a shader: textures of up to {} pixels, for example {side:.0} x {side:.0}",
            self.buffer >> 20,
            self.binding >> 20,
            self.pixels
        )?;
        self.lacks.iter().try_for_each(|need| write!(f, "\n  cannot be used: it lacks {need}"))
    }
}
