//! What `gdt-batch gpu` shows: the adapters of this machine and which of them would be chosen, whether every step gives the same
//! numbers as its twin, and how long each step takes.

mod compare;
mod flips;
mod timing;

pub use compare::{StepComparison, compare};
pub use timing::{AtlasTiming, TimedStep};

use crate::on_device::buffers::BufferSet;
use crate::on_device::device;
use crate::on_device::device::{ADAPTER_VARIABLE, AdapterRequest, Device};
use crate::on_device::engine::GpuEngine;
use crate::on_device::error::GpuError;
use crate::on_device::filled_atlas::{AtlasLimits, FilledAtlas};
use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::TextureResolution;
use serde::Serialize;
use std::fmt;
use sys::{Error, Result};

/// The numbers of leaves of the atlases that are timed.
const LEAVES: [usize; 4] = [1, 4, 12, 24];
/// The most leaves that are timed on a software renderer. More take minutes.
const SOFTWARE_LEAVES: usize = 4;
/// Sites in each of them, about as many as in a leaf of a job.
const SITES_PER_LEAF: u64 = 35_000;
/// The leaves whose steps are compared with the reference kernels.
const COMPARED: [u64; 4] = [40_000, 30, 3, 5000];
/// Pixels a site in the textures.
const PIXELS_PER_SITE: TextureResolution = TextureResolution::PixelsPerSite(16.0);

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
    /// Pixels of the largest atlas.
    pub pixels: u32,
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
    /// The times of the steps, by the number of leaves.
    pub timings: Vec<AtlasTiming>,
    /// Why larger atlases were not timed.
    pub stopped: Option<String>,
}

impl SelfTest {
    /// Returns whether every number of every step was right.
    pub fn holds(&self) -> bool {
        self.comparisons.iter().all(|comparison| comparison.differing == 0)
    }

    /// Returns whether the adapter that was tested is a software renderer.
    pub fn is_software(&self) -> bool {
        self.adapters.iter().any(|adapter| adapter.software && self.gpu.as_ref().is_ok_and(|gpu| *gpu == adapter.name))
    }
}

/// Lists the adapters, and tests the one called `name`, or if that is `None`, the one that `backend = "gpu"` would use. Times the
/// steps on atlases of up to `leaves` leaves.
///
/// # Errors
/// [`Error::Config`] if there is no such adapter or it fails.
pub fn run(name: Option<&str>, leaves: Option<usize>) -> Result<SelfTest> {
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
    let most = leaves.unwrap_or(if test.adapters[chosen].software { SOFTWARE_LEAVES } else { usize::MAX });
    let tested = Device::open(&adapters[chosen]).and_then(|device| fill(&mut test, device, most));
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
        pixels: AtlasLimits::of(&limits).pixels,
        lacks: device::shortage(&limits),
    }
}

/// Compares the steps on `device`, and times them on atlases of up to `most` leaves.
fn fill(test: &mut SelfTest, device: Device, most: usize) -> std::result::Result<(), GpuError> {
    let limits = AtlasLimits::of(&device.limits);
    let (mut engine, mut buffers) = (GpuEngine::new(device), BufferSet::default());
    let compared = scattered(COMPARED, limits).ok_or(GpuError::OutOfMemory)?;
    test.comparisons.extend(compare(&mut engine, &mut buffers, &compared)?);
    test.comparisons.push(compare::compare_predicates(&mut engine, &mut buffers)?);
    test.comparisons.extend(flips::compare_flips(&mut engine, &mut buffers)?);
    test.copy_bandwidth = timing::copy_bandwidth(&mut engine, &mut buffers)?;
    for leaves in LEAVES.into_iter().filter(|&leaves| leaves <= most) {
        let Some(filled) = scattered(std::iter::repeat_n(SITES_PER_LEAF, leaves), limits) else {
            test.stopped = Some(format!("an atlas of {leaves} leaves is too large for this adapter"));
            break;
        };
        match timing::time_steps(&mut engine, &mut buffers, &filled, test.copy_bandwidth) {
            Ok(timing) => test.timings.push(timing),
            Err(GpuError::OutOfMemory) => {
                test.stopped = Some(format!("an atlas of {leaves} leaves does not fit the adapter's memory"));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Returns an atlas of leaves with so many sites each, which look random and are the same on every machine (splitmix64); `None` if they do
/// not fit.
fn scattered(leaves: impl IntoIterator<Item = u64>, limits: AtlasLimits) -> Option<FilledAtlas> {
    let mixed = |i: u64| {
        let mut v = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        v ^ (v >> 31)
    };
    // Coordinates have 24 bits.
    let site = |i: u64| [(mixed(i) & 0xff_ffff) as i32, (mixed(i) >> 40) as i32];
    let mut filled = FilledAtlas::default();
    leaves
        .into_iter()
        .all(|count| {
            let mut sites: Vec<Site> = (1..=count).map(site).collect();
            sites.sort_unstable_by_key(|&[x, y]| (y, x));
            sites.dedup();
            filled.add(&sites, PIXELS_PER_SITE, limits)
        })
        .then_some(filled)
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
        writeln!(f, "the CPU does C1 and C3, what is left of C2 and C4, and proves every mesh")?;
        if !self.timings.is_empty() {
            let bandwidth = self.copy_bandwidth / 1e9;
            let floor = "the floor is the time that a step's bytes take at this speed";
            writeln!(f, "\ncopies read and write {bandwidth:.1} GB/s; {floor}")?;
        }
        for timing in &self.timings {
            let AtlasTiming { leaves, sites, pixels, .. } = timing;
            writeln!(f, "\n{leaves} leaves, {sites} sites, {pixels} pixels")?;
            writeln!(f, "{:<20} {:>10} {:>10} {:>8} {:>10}", "step", "ms", "floor ms", "times", "MB")?;
            for step in &timing.steps {
                let TimedStep { step, milliseconds, bytes, floor } = step;
                let floor_text = floor.map_or("-".into(), |floor| format!("{floor:.3}"));
                let times = floor.map_or("-".into(), |floor| format!("{:.1}", milliseconds / floor));
                let megabytes = *bytes as f64 / 1e6;
                writeln!(f, "{step:<20} {milliseconds:>10.3} {floor_text:>10} {times:>8} {megabytes:>10.1}")?;
            }
        }
        self.stopped.iter().try_for_each(|why| writeln!(f, "\n{why}"))
    }
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let AdapterSummary { name, kind, backend, driver, .. } = self;
        writeln!(f, "{name} ({kind}, {backend}; {driver})")?;
        write!(
            f,
            "  buffers of {} MiB, {} MiB in a shader: atlases of up to {} pixels",
            self.buffer >> 20,
            self.binding >> 20,
            self.pixels
        )?;
        self.lacks.iter().try_for_each(|need| write!(f, "\n  cannot be used: it lacks {need}"))
    }
}
