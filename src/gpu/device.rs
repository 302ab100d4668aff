//! Adapters and devices: which GPU is taken, with which limits, and how its failures are caught. Nothing here panics, whatever
//! the driver does: every error ends as a [`Fault`].

use crate::gpu::Fault;
use std::future::Future;
use std::path::Path;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Wake, Waker};
use std::thread::{self, Thread};
use std::time::Duration;
use wgpu::{AdapterInfo, Backends, DeviceType, ErrorFilter, Features, Limits};

/// Environment variable that names an adapter, or a part of its name, where the configuration names none.
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";
/// Widest and highest texture. Keeps the label of a pixel within 32 bits, and loops within what software Vulkan can do.
pub const MOST_SIDE: u32 = 16_384;
/// After this long without an answer a device counts as lost.
const PATIENCE: Duration = Duration::from_secs(60);

/// What the user wants of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// A part of the adapter's name, in any case of letters; `None` takes the fastest kind.
    pub name: Option<String>,
    /// Whether a software renderer will do.
    pub software: bool,
}

impl Wish {
    /// The wish for `name`, or else for what the environment names.
    pub fn new(name: Option<&str>, software: bool) -> Wish {
        let from_environment = || std::env::var(ADAPTER_VARIABLE).ok().filter(|name| !name.is_empty());
        Wish { name: name.map(str::to_owned).or_else(from_environment), software }
    }
}

/// Whether this machine may have a hardware GPU. Asked before any driver is loaded, because Linux machines without one often have
/// software drivers, which take tens of megabytes and some write to standard error.
pub fn hardware_is_likely() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    // The device nodes of NVIDIA's driver, of WSL and of Qualcomm's and ARM's own; all others have a render node.
    let nodes = ["/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    let is_render_node = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with("renderD"))
    };
    nodes.iter().any(|node| Path::new(node).exists())
        || std::fs::read_dir("/dev/dri").is_ok_and(|mut entries| entries.any(is_render_node))
}

/// All adapters of this machine, of all backends that wgpu can use here.
pub fn adapters() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    block_on(instance.enumerate_adapters(Backends::all()))
}

/// Which of `adapters` to take.
///
/// # Errors
/// A sentence that says what there is, if nothing fulfils the wish.
pub fn choose(adapters: &[AdapterInfo], wish: &Wish) -> Result<usize, String> {
    let named = |info: &AdapterInfo| {
        wish.name.as_ref().is_none_or(|name| info.name.to_lowercase().contains(&name.to_lowercase()))
    };
    let fits = |info: &AdapterInfo| named(info) && (wish.software || !is_software(info));
    let best = (0..adapters.len()).filter(|&i| fits(&adapters[i])).min_by_key(|&i| rank(adapters[i].device_type));
    best.ok_or_else(|| complaint(adapters, wish))
}

fn complaint(adapters: &[AdapterInfo], wish: &Wish) -> String {
    let there: Vec<_> = adapters.iter().map(|info| format!("{:?}", info.name)).collect();
    let what = match &wish.name {
        Some(name) => format!("no GPU whose name contains {name:?}"),
        None => "no GPU".into(),
    };
    match there.is_empty() {
        true => format!("{what} was found: no Vulkan, Metal or DX12 driver offers an adapter"),
        false => format!("{what} was found that will do; there is {}", there.join(", ")),
    }
}

/// Whether the adapter is a program on the CPU that behaves like a GPU.
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

/// The limits to ask of `adapter`: what the shaders need, and buffers as large as it has.
pub fn wanted_limits(adapter: &Limits) -> Limits {
    Limits {
        max_buffer_size: adapter.max_buffer_size,
        max_storage_buffer_binding_size: adapter.max_storage_buffer_binding_size,
        ..Limits::default().or_worse_values_from(adapter)
    }
}

/// The pixels of the largest texture that limits allow.
pub fn most_pixels(limits: &Limits) -> u64 {
    (limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) / 4).min(u64::from(MOST_SIDE).pow(2))
}

/// Whether the shaders run within `limits`; if not, what is missing.
pub fn shortage(limits: &Limits) -> Option<&'static str> {
    let enough = [
        (limits.max_storage_buffers_per_shader_stage >= 5, "five storage buffers in a shader"),
        (limits.max_compute_invocations_per_workgroup >= 256, "workgroups of 256 invocations"),
        (limits.max_compute_workgroups_per_dimension >= 65_535, "65535 workgroups in a dimension"),
        (most_pixels(limits) >= 1 << 20, "buffers of 4 MiB"),
    ];
    enough.iter().find(|(there, _)| !there).map(|&(_, what)| what)
}

/// What callbacks of the driver report, from whatever thread.
#[derive(Default)]
struct Health {
    lost: AtomicBool,
    last: Mutex<Option<String>>,
}

impl Health {
    fn note(&self, what: String) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(what);
    }
}

/// An opened device.
pub struct Device {
    /// The device itself.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// The adapter it belongs to.
    pub info: AdapterInfo,
    /// The limits it was opened with.
    pub limits: Limits,
    health: Arc<Health>,
}

impl Device {
    /// Opens `adapter`.
    ///
    /// # Errors
    /// [`Fault::Refused`] if the adapter cannot run the shaders or does not open.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Device, Fault> {
        let limits = wanted_limits(&adapter.limits());
        if let Some(what) = shortage(&limits) {
            return Err(Fault::Refused(format!("{} lacks {what}", adapter.get_info().name)));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gdt-batch"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| Fault::Refused(format!("the device does not open: {e}")))?;
        let health = Arc::<Health>::default();
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
    pub fn guard<T>(&self, f: impl FnOnce() -> T) -> Result<T, Fault> {
        let internal = self.device.push_error_scope(ErrorFilter::Internal);
        let memory = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(ErrorFilter::Validation);
        let value = f();
        let errors = [block_on(validation.pop()), block_on(memory.pop()), block_on(internal.pop())];
        self.check()?;
        match errors.into_iter().flatten().next() {
            None => Ok(value),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(Fault::OutOfMemory),
            Some(error) => Err(Fault::Refused(error.to_string())),
        }
    }

    /// Waits until `submission` is done.
    ///
    /// # Errors
    /// [`Fault::Lost`] if the device is lost or does not answer.
    pub fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), Fault> {
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(PATIENCE) };
        let polled = self.device.poll(wait);
        self.check()?;
        polled.map(|_| ()).map_err(|e| Fault::Lost(e.to_string()))
    }

    /// # Errors
    /// [`Fault::Lost`] once the device is lost, or after an error that nobody was looking for.
    fn check(&self) -> Result<(), Fault> {
        let last = self.health.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if self.health.lost.load(Ordering::Acquire) || last.is_some() {
            return Err(Fault::Lost(last.unwrap_or_default()));
        }
        Ok(())
    }
}

struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// Waits for `future` on this thread. wgpu's futures are ready at once on everything but the web.
fn block_on<F: Future>(future: F) -> F::Output {
    let waker = Waker::from(Arc::new(Unpark(thread::current())));
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
    fn the_fastest_kind_is_taken_and_software_only_if_it_will_do() {
        let all = [
            info("llvmpipe", DeviceType::Cpu),
            info("Iris", DeviceType::IntegratedGpu),
            info("GeForce", DeviceType::DiscreteGpu),
        ];
        let wish = |name: Option<&str>, software| Wish { name: name.map(str::to_owned), software };
        assert_eq!(choose(&all, &wish(None, false)), Ok(2));
        assert_eq!(choose(&all, &wish(Some("iris"), false)), Ok(1));
        assert_eq!(choose(&all, &wish(Some("pipe"), true)), Ok(0));
        assert!(choose(&all, &wish(Some("pipe"), false)).unwrap_err().contains("GeForce"));
        assert_eq!(choose(&all[..1], &wish(None, true)), Ok(0));
        assert!(choose(&all[..1], &wish(None, false)).is_err());
        assert!(choose(&[], &wish(None, true)).unwrap_err().contains("driver"));
    }

    #[test]
    fn limits_are_never_more_than_the_adapter_has() {
        let weak = Limits { max_storage_buffers_per_shader_stage: 4, ..Limits::default() };
        assert!(wanted_limits(&weak).check_limits(&weak));
        assert_eq!(shortage(&wanted_limits(&weak)), Some("five storage buffers in a shader"));
        let large = Limits { max_storage_buffer_binding_size: 1 << 31, max_buffer_size: 1 << 40, ..Limits::default() };
        assert!(wanted_limits(&large).check_limits(&large));
        assert_eq!(most_pixels(&wanted_limits(&large)), 1 << 28);
        assert_eq!(shortage(&large), None);
    }
}
