//! What `gdt-batch gpu` shows: the adapters of this machine and which would be chosen, whether every step gives the same numbers
//! as its twin, and how long each takes.

mod compare;
mod timing;

pub use compare::{Comparison, compare};
pub use timing::{StepTime, Timing};

use crate::gpu::Fault;
use crate::gpu::buffers::Set;
use crate::gpu::device::{self, ADAPTER_VARIABLE, Device, Wish};
use crate::gpu::machine::Machine;
use crate::gpu::steps::Size;
use crate::{Error, Result};
use serde::Serialize;
use std::fmt;

/// Sides of the textures that are timed.
const SIDES: [u32; 5] = [1024, 2048, 4096, 8192, 16_384];
/// The largest that software is asked for: beyond it takes minutes.
const SOFTWARE_SIDE: u32 = 4096;
/// Pixels per site, as leaves have them.
const PIXELS_PER_SITE: u64 = 5;

/// An adapter, as far as it matters here.
#[derive(Clone, Debug, Serialize)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// What kind of GPU it is.
    pub kind: String,
    /// Vulkan, Metal or DX12.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is a program on the CPU.
    pub software: bool,
    /// Bytes of the largest buffer.
    pub buffer: u64,
    /// Bytes of a buffer that a shader can see.
    pub binding: u64,
    /// Pixels of the largest texture.
    pub pixels: u64,
    /// What it lacks to be used.
    pub lacks: Option<&'static str>,
}

/// The outcome of the self-test.
#[derive(Clone, Debug, Serialize)]
pub struct SelfTest {
    /// All adapters.
    pub adapters: Vec<Adapter>,
    /// What `backend = "auto"` takes, or why nothing.
    pub auto: std::result::Result<String, String>,
    /// What `backend = "gpu"` takes, or why nothing; it is what was tested.
    pub gpu: std::result::Result<String, String>,
    /// Every step against its twin.
    pub comparisons: Vec<Comparison>,
    /// Bytes a second that a copy within the adapter's memory reads and writes.
    pub copy_bandwidth: f64,
    /// By texture size.
    pub timings: Vec<Timing>,
    /// Why larger textures were not timed.
    pub stopped: Option<String>,
}

impl SelfTest {
    /// Whether every number of every step was right.
    pub fn holds(&self) -> bool {
        self.comparisons.iter().all(|comparison| comparison.differing == 0)
    }
}

/// Lists the adapters; tests the one called `name`, or the one that `backend = "gpu"` would take; times it on textures up to `side`.
///
/// # Errors
/// [`Error::Config`] if there is no such adapter or it does not do what it must.
pub fn run(name: Option<&str>, side: Option<u32>) -> Result<SelfTest> {
    let adapters = device::adapters();
    let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
    let choose = |software| device::choose(&infos, &Wish::new(name, software));
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
    let most_side = side.unwrap_or(if test.adapters[chosen].software { SOFTWARE_SIDE } else { SIDES[SIDES.len() - 1] });
    let tested = Device::open(&adapters[chosen]).and_then(|device| fill(&mut test, device, most_side));
    tested.map_err(|fault| Error::Config(format!("{}: {fault}", infos[chosen].name)))?;
    Ok(test)
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits) = (adapter.get_info(), device::wanted_limits(&adapter.limits()));
    Adapter {
        software: device::is_software(&info),
        kind: format!("{:?}", info.device_type),
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        name: info.name,
        buffer: limits.max_buffer_size,
        binding: limits.max_storage_buffer_binding_size,
        pixels: device::most_pixels(&limits),
        lacks: device::shortage(&limits),
    }
}

fn fill(test: &mut SelfTest, device: Device, most_side: u32) -> std::result::Result<(), Fault> {
    let most_pixels = device::most_pixels(&device.limits);
    let (mut machine, mut set) = (Machine::new(device), Set::default());
    for (width, height, sites) in [(1000, 700, 140_000), (600, 500, 30)] {
        let size = Size { width, height };
        test.comparisons.extend(compare(&mut machine, &mut set, size, &scatter(size, sites))?);
    }
    test.copy_bandwidth = timing::copy_bandwidth(&mut machine, &mut set)?;
    for side in SIDES.into_iter().filter(|&side| side <= most_side) {
        let size = Size { width: side, height: side };
        if size.pixels() > most_pixels {
            test.stopped = Some(format!("a texture of {side} x {side} is more than this adapter takes"));
            break;
        }
        let sites = scatter(size, size.pixels() / PIXELS_PER_SITE);
        match timing::time_steps(&mut machine, &mut set, side, sites, test.copy_bandwidth) {
            Ok(timing) => test.timings.push(timing),
            Err(Fault::OutOfMemory) => {
                test.stopped = Some(format!("a texture of {side} x {side} does not fit the adapter's memory"));
                break;
            }
            Err(fault) => return Err(fault),
        }
    }
    Ok(())
}

/// Pixels (y << 16 | x) that look random and are the same everywhere (splitmix64).
fn scatter(size: Size, sites: u64) -> Vec<u32> {
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
        writeln!(f, "backend = \"auto\" takes {}", or_none(&self.auto))?;
        writeln!(f, "backend = \"gpu\"  takes {} ({ADAPTER_VARIABLE} names another)\n", or_none(&self.gpu))?;
        for c in &self.comparisons {
            let verdict = match c.first {
                None if c.differing == 0 => "same".into(),
                first => format!("{} DIFFER, the first (position, shader, twin): {first:?}", c.differing),
            };
            writeln!(f, "{:<10} {:>9} numbers {verdict}", c.step, c.numbers)?;
        }
        writeln!(
            f,
            "\ncopies read and write {:.1} GB/s; the floor is what a step's bytes take at that",
            self.copy_bandwidth / 1e9
        )?;
        for timing in &self.timings {
            writeln!(f, "\n{0} x {0}, {1} sites, {2} triangles", timing.side, timing.sites, timing.triangles)?;
            writeln!(f, "{:<16} {:>10} {:>10} {:>8} {:>10}", "step", "ms", "floor ms", "times", "MB")?;
            for step in &timing.steps {
                let StepTime { step, milliseconds, bytes, floor } = step;
                let floor_text = floor.map_or("-".into(), |floor| format!("{floor:.3}"));
                let times = floor.map_or("-".into(), |floor| format!("{:.1}", milliseconds / floor));
                let megabytes = *bytes as f64 / 1e6;
                writeln!(f, "{step:<16} {milliseconds:>10.3} {floor_text:>10} {times:>8} {megabytes:>10.1}")?;
            }
        }
        self.stopped.iter().try_for_each(|why| writeln!(f, "\n{why}"))
    }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Adapter { name, kind, backend, driver, .. } = self;
        writeln!(f, "{name} ({kind}, {backend}; {driver})")?;
        let side = (self.pixels as f64).sqrt();
        write!(
            f,
            "  buffers of {} MiB, {} MiB in a shader: textures of {} pixels, such as {side:.0} x {side:.0}",
            self.buffer >> 20,
            self.binding >> 20,
            self.pixels
        )?;
        self.lacks.iter().try_for_each(|what| write!(f, "\n  cannot be used: it lacks {what}"))
    }
}
