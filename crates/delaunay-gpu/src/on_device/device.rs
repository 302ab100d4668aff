//! Adapters and devices: which GPU is chosen, with which limits, and how its failures are caught. Nothing here panics, whatever
//! the driver does: every failure becomes a [`GpuError`].

use crate::on_device::error::GpuError;
use std::future::Future;
use std::path::Path;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Wake, Waker};
use std::thread::{self, Thread};
use std::time::Duration;
use wgpu::{AdapterInfo, Backends, DeviceType, ErrorFilter, Features, Limits};

/// The environment variable that names an adapter, or a part of its name, when the configuration names none.
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";
/// The largest width and height of a texture. It keeps the label of a pixel within 32 bits, and loops within what software Vulkan
/// can run.
pub const MAX_SIDE: u32 = 16_384;
/// A device that does not answer for this long counts as lost.
const PATIENCE: Duration = Duration::from_secs(60);

/// Which adapters are acceptable.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdapterRequest {
    /// A part of the adapter's name, in upper or lower case; `None` takes the fastest kind.
    pub name: Option<String>,
    /// Whether a software renderer is acceptable.
    pub allow_software: bool,
}

impl AdapterRequest {
    /// Requests the adapter called `name`, or if that is `None`, the one that the environment names.
    pub fn new(name: Option<&str>, allow_software: bool) -> AdapterRequest {
        let from_environment = || std::env::var(ADAPTER_VARIABLE).ok().filter(|name| !name.is_empty());
        AdapterRequest { name: name.map(str::to_owned).or_else(from_environment), allow_software }
    }
}

/// Returns whether this machine may have a hardware GPU. This is checked before any driver is loaded, because Linux machines
/// without a GPU often have software drivers: loading them takes tens of megabytes, and some of them write to standard error.
pub fn hardware_is_likely() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    // The device nodes of NVIDIA's driver, of WSL, and of Qualcomm's and ARM's own drivers. All others have a render node.
    let nodes = ["/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    let is_render_node = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with("renderD"))
    };
    nodes.iter().any(|node| Path::new(node).exists())
        || std::fs::read_dir("/dev/dri").is_ok_and(|mut entries| entries.any(is_render_node))
}

/// Returns all adapters of this machine, from all backends that wgpu can use here.
pub fn adapters() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    block_on(instance.enumerate_adapters(Backends::all()))
}

/// Returns the index of the best of `adapters` that `request` accepts.
///
/// # Errors
/// A sentence that lists the adapters, if none is acceptable.
pub fn choose(adapters: &[AdapterInfo], request: &AdapterRequest) -> Result<usize, String> {
    let named = |info: &AdapterInfo| {
        request.name.as_ref().is_none_or(|name| info.name.to_lowercase().contains(&name.to_lowercase()))
    };
    let fits = |info: &AdapterInfo| named(info) && (request.allow_software || !is_software(info));
    let best = (0..adapters.len()).filter(|&i| fits(&adapters[i])).min_by_key(|&i| rank(adapters[i].device_type));
    best.ok_or_else(|| complaint(adapters, request))
}

fn complaint(adapters: &[AdapterInfo], request: &AdapterRequest) -> String {
    let found: Vec<_> = adapters.iter().map(|info| format!("{:?}", info.name)).collect();
    let wanted = match &request.name {
        Some(name) => format!("no GPU whose name contains {name:?}"),
        None => "no GPU".into(),
    };
    match found.is_empty() {
        true => format!("{wanted} was found: no Vulkan, Metal or DX12 driver offers an adapter"),
        false => format!("{wanted} is suitable; this machine has {}", found.join(", ")),
    }
}

/// Returns whether the adapter is a program on the CPU that behaves like a GPU.
pub fn is_software(info: &AdapterInfo) -> bool {
    info.device_type == DeviceType::Cpu
}

fn rank(kind: DeviceType) -> u32 {
    match kind {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    }
}

/// Returns the limits to request from an adapter: what the shaders need, and buffers as large as the adapter allows.
pub fn wanted_limits(adapter: &Limits) -> Limits {
    Limits {
        max_buffer_size: adapter.max_buffer_size,
        max_storage_buffer_binding_size: adapter.max_storage_buffer_binding_size,
        ..Limits::default().or_worse_values_from(adapter)
    }
}

/// Returns the number of pixels of the largest texture that `limits` allow.
fn max_pixels(limits: &Limits) -> u64 {
    (limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) / 4).min(u64::from(MAX_SIDE).pow(2))
}

/// Returns what `limits` lack to run the shaders, or `None` if they are sufficient.
pub fn shortage(limits: &Limits) -> Option<&'static str> {
    let needs = [
        (limits.max_storage_buffers_per_shader_stage >= 8, "eight storage buffers in a shader"),
        (limits.max_compute_invocations_per_workgroup >= 256, "workgroups of 256 invocations"),
        (limits.max_compute_workgroups_per_dimension >= 65_535, "65535 workgroups in a dimension"),
        (max_pixels(limits) >= 1 << 20, "buffers of 4 MiB"),
    ];
    needs.iter().find(|(is_met, _)| !is_met).map(|&(_, need)| need)
}

/// What the driver's callbacks have reported, from any thread.
#[derive(Default)]
struct DeviceHealth {
    lost: AtomicBool,
    last_error: Mutex<Option<String>>,
}

impl DeviceHealth {
    fn note(&self, error: String) {
        *self.last_error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
    }
}

/// An open device.
pub struct Device {
    /// wgpu's device.
    pub device: wgpu::Device,
    /// The queue of the device.
    pub queue: wgpu::Queue,
    /// The adapter of the device.
    pub info: AdapterInfo,
    /// The limits with which the device was opened.
    pub limits: Limits,
    health: Arc<DeviceHealth>,
}

impl Device {
    /// Opens `adapter`.
    ///
    /// # Errors
    /// [`GpuError::Refused`] if the adapter cannot run the shaders or does not open.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Device, GpuError> {
        let limits = wanted_limits(&adapter.limits());
        if let Some(need) = shortage(&limits) {
            return Err(GpuError::Refused(format!("{} lacks {need}", adapter.get_info().name)));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gdt-batch"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| GpuError::Refused(format!("the device does not open: {e}")))?;
        let health = Arc::<DeviceHealth>::default();
        let (on_error, on_loss) = (health.clone(), health.clone());
        device.on_uncaptured_error(Arc::new(move |error| on_error.note(error.to_string())));
        device.set_device_lost_callback(move |_, why| {
            on_loss.note(why);
            on_loss.lost.store(true, Ordering::Release);
        });
        Ok(Device { device, queue, info: adapter.get_info(), limits, health })
    }

    /// Runs `f`, whose calls to the device may fail.
    ///
    /// # Errors
    /// What the device reported while `f` ran.
    pub fn guard<T>(&self, f: impl FnOnce() -> T) -> Result<T, GpuError> {
        let internal = self.device.push_error_scope(ErrorFilter::Internal);
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(ErrorFilter::Validation);
        let value = f();
        let errors = [block_on(validation.pop()), block_on(memory.pop()), block_on(internal.pop())];
        self.check()?;
        match errors.into_iter().flatten().next() {
            None => Ok(value),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory),
            Some(error) => Err(GpuError::Refused(error.to_string())),
        }
    }

    /// Waits until `submission` is done.
    ///
    /// # Errors
    /// [`GpuError::Lost`] if the device is lost or does not answer.
    pub fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(PATIENCE) };
        let polled = self.device.poll(wait);
        self.check()?;
        polled.map(|_| ()).map_err(|e| GpuError::Lost(e.to_string()))
    }

    /// Lets the device report what is done by now.
    pub(super) fn look(&self) {
        // An error comes up where somebody waits.
        let _ = self.device.poll(wgpu::PollType::Poll);
    }

    /// Checks that the device still works.
    ///
    /// # Errors
    /// [`GpuError::Lost`] once the device is lost, or after an error outside of [`Device::guard`].
    fn check(&self) -> Result<(), GpuError> {
        let last_error = self.health.last_error.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if self.health.lost.load(Ordering::Acquire) || last_error.is_some() {
            return Err(GpuError::Lost(last_error.unwrap_or_default()));
        }
        Ok(())
    }
}

struct UnparkWaker(Thread);

impl Wake for UnparkWaker {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// Waits for `future` on this thread. wgpu's futures are ready at once except on the web.
fn block_on<F: Future>(future: F) -> F::Output {
    let waker = Waker::from(Arc::new(UnparkWaker(thread::current())));
    let mut context = Context::from_waker(&waker);
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        thread::park();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(name: &str, kind: DeviceType) -> AdapterInfo {
        AdapterInfo { name: name.into(), ..AdapterInfo::new(kind, wgpu::Backend::Vulkan) }
    }

    #[test]
    fn the_fastest_kind_is_chosen_and_software_only_if_it_is_allowed() {
        let all = [
            info("llvmpipe", DeviceType::Cpu),
            info("Iris", DeviceType::IntegratedGpu),
            info("GeForce", DeviceType::DiscreteGpu),
        ];
        let request =
            |name: Option<&str>, allow_software| AdapterRequest { name: name.map(str::to_owned), allow_software };
        assert_eq!(choose(&all, &request(None, false)), Ok(2));
        assert_eq!(choose(&all, &request(Some("iris"), false)), Ok(1));
        assert_eq!(choose(&all, &request(Some("pipe"), true)), Ok(0));
        assert!(choose(&all, &request(Some("pipe"), false)).unwrap_err().contains("GeForce"));
        assert_eq!(choose(&all[..1], &request(None, true)), Ok(0));
        assert!(choose(&all[..1], &request(None, false)).is_err());
        assert!(choose(&[], &request(None, true)).unwrap_err().contains("driver"));
    }

    #[test]
    fn requested_limits_never_exceed_those_of_the_adapter() {
        let weak = Limits { max_storage_buffers_per_shader_stage: 4, ..Limits::default() };
        assert!(wanted_limits(&weak).check_limits(&weak));
        assert_eq!(shortage(&wanted_limits(&weak)), Some("eight storage buffers in a shader"));
        let large = Limits { max_storage_buffer_binding_size: 1 << 31, max_buffer_size: 1 << 40, ..Limits::default() };
        assert!(wanted_limits(&large).check_limits(&large));
        assert_eq!(max_pixels(&wanted_limits(&large)), 1 << 28);
        assert_eq!(shortage(&large), None);
    }
}
