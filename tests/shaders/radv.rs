//! Mesa's Vulkan driver for AMD's GPUs, which compiles for a GPU that is not there. All calls of Vulkan are in this file.

use crate::compile::{Abilities, Compiled};
use crate::statistics::Statistics;
use ash::vk::{self, PipelineExecutableStatisticFormatKHR as Format};
use delaunay_gpu::recording::ShaderProgram;
use std::ffi::{CStr, CString};

/// The GPU to compile for: a Radeon RX 6800. The driver reads it from the environment.
pub(crate) const FAMILY: &str = "navi21";

/// A device without hardware. It can compile, but not run anything.
pub(crate) struct NullDevice {
    /// What the driver calls the GPU.
    pub(crate) name: String,
    /// The driver and its version.
    pub(crate) driver: String,
    pub(crate) abilities: Abilities,
    statistics: ash::khr::pipeline_executable_properties::Device,
    device: ash::Device,
    instance: ash::Instance,
    /// The Vulkan loader, which must stay as long as the others.
    _entry: ash::Entry,
}

impl Drop for NullDevice {
    fn drop(&mut self) {
        // SAFETY: Whatever was made from the device has borrowed it, so it is gone. Nobody can use the two after this.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

impl NullDevice {
    /// Opens the device. Fails where the loader, the driver or an ability is missing.
    pub(crate) fn open() -> Result<NullDevice, String> {
        // SAFETY: The library has the name of the Vulkan loader, so it behaves as such.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| format!("no Vulkan loader: {error}"))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let create_info = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: The structure and what it points to live during the call.
        let instance = unsafe { entry.create_instance(&create_info, None) }
            .map_err(|error| format!("no Vulkan driver: {error}"))?;
        let opened = choose(&instance).and_then(|(physical, name, driver)| {
            let (device, abilities) = open_device(&instance, physical)?;
            Ok((name, driver, device, abilities))
        });
        match opened {
            Ok((name, driver, device, abilities)) => {
                let statistics = ash::khr::pipeline_executable_properties::Device::new(&instance, &device);
                Ok(NullDevice { name, driver, abilities, statistics, device, instance, _entry: entry })
            }
            Err(why) => {
                // SAFETY: No device was made from the instance.
                unsafe { instance.destroy_instance(None) };
                Err(why)
            }
        }
    }

    /// Returns what the driver says about a program.
    pub(crate) fn statistics(&self, program: &ShaderProgram, compiled: &Compiled) -> Result<Statistics, String> {
        let made = self.pipeline(program, compiled).map_err(|error| format!("the driver refuses it: {error}"))?;
        self.read(made.pipeline)
    }

    fn pipeline(&self, program: &ShaderProgram, compiled: &Compiled) -> Result<Made<'_>, vk::Result> {
        let mut made = Made::new(&self.device);
        let bindings: Vec<_> =
            compiled.bindings.iter().map(|&(binding, is_uniform)| layout(binding, is_uniform)).collect();
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: The structure and what it points to live during the call.
        made.set = unsafe { self.device.create_descriptor_set_layout(&set_info, None) }?;
        let sets = [made.set];
        let layout_info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        // SAFETY: As above.
        made.layout = unsafe { self.device.create_pipeline_layout(&layout_info, None) }?;
        let module_info = vk::ShaderModuleCreateInfo::default().code(&compiled.words);
        // SAFETY: As above; the SPIR-V comes from naga, which writes only what is valid.
        made.module = unsafe { self.device.create_shader_module(&module_info, None) }?;
        let entry = CString::new(program.entry).expect("a function's name has no zero");
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(made.module)
            .name(&entry);
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(made.layout)
            .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
        // SAFETY: As above; the module has the function, and the layout has all bindings that it uses.
        let pipelines = unsafe { self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        made.pipeline = pipelines.map_err(|(_, error)| error)?[0];
        Ok(made)
    }

    fn read(&self, pipeline: vk::Pipeline) -> Result<Statistics, String> {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(0);
        // SAFETY: The pipeline was made for this device with the flag that this call needs, and has one executable at least.
        let statistics = unsafe { self.statistics.get_pipeline_executable_statistics(&info) };
        let statistics = statistics.map_err(|error| format!("the driver tells no statistics: {error}"))?;
        let numbers = statistics.iter().filter(|statistic| statistic.format == Format::UINT64).map(|statistic| {
            // SAFETY: The format says which of the values it is.
            (text(statistic.name_as_c_str()), unsafe { statistic.value.u64 })
        });
        let numbers: Vec<_> = numbers.collect();
        Ok(numbers.iter().map(|(name, number)| (name.as_str(), *number)).collect())
    }
}

/// A pipeline and what it was made from. Null is what was not made yet.
struct Made<'a> {
    device: &'a ash::Device,
    set: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    module: vk::ShaderModule,
    pipeline: vk::Pipeline,
}

impl Made<'_> {
    fn new(device: &ash::Device) -> Made<'_> {
        let (set, layout) = (vk::DescriptorSetLayout::null(), vk::PipelineLayout::null());
        Made { device, set, layout, module: vk::ShaderModule::null(), pipeline: vk::Pipeline::null() }
    }
}

impl Drop for Made<'_> {
    fn drop(&mut self) {
        // SAFETY: All were made from this device and nobody else has them. To destroy null does nothing.
        unsafe {
            self.device.destroy_pipeline(self.pipeline, None);
            self.device.destroy_shader_module(self.module, None);
            self.device.destroy_pipeline_layout(self.layout, None);
            self.device.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

fn text(bytes: Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    bytes.map_or_else(|_| String::new(), |text| text.to_string_lossy().into_owned())
}

fn layout(binding: u32, is_uniform: bool) -> vk::DescriptorSetLayoutBinding<'static> {
    let kind = if is_uniform { vk::DescriptorType::UNIFORM_BUFFER } else { vk::DescriptorType::STORAGE_BUFFER };
    vk::DescriptorSetLayoutBinding::default()
        .binding(binding)
        .descriptor_type(kind)
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::COMPUTE)
}

/// Returns the device that is not there, its name, and the driver with its version.
fn choose(instance: &ash::Instance) -> Result<(vk::PhysicalDevice, String, String), String> {
    // SAFETY: The instance is alive.
    let devices =
        unsafe { instance.enumerate_physical_devices() }.map_err(|error| format!("no Vulkan device: {error}"))?;
    for physical in devices {
        // SAFETY: The device comes from this instance.
        let version = unsafe { instance.get_physical_device_properties(physical) }.api_version;
        if version < vk::API_VERSION_1_2 {
            continue;
        }
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: The device comes from this instance; its version has both structures.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let name = text(properties.properties.device_name_as_c_str());
        if driver.driver_id == vk::DriverId::MESA_RADV && name.to_lowercase().contains(FAMILY) {
            return Ok((physical, name, text(driver.driver_info_as_c_str())));
        }
    }
    Err(format!("no driver RADV of Mesa that compiles for a {FAMILY} without hardware"))
}

/// Opens a device with what wgpu would enable of the abilities that matter for compiling.
fn open_device(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<(ash::Device, Abilities), String> {
    // SAFETY: The device comes from this instance.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    // SAFETY: As above.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.map_err(|e| e.to_string())?;
    let has = |name: &CStr| offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
    if !has(ash::khr::pipeline_executable_properties::NAME) {
        return Err("a driver RADV that tells no statistics".into());
    }
    let is_1_3 = properties.api_version >= vk::API_VERSION_1_3;
    let (mut robustness, mut clearing) = (Default::default(), Default::default());
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if has(ash::ext::robustness2::NAME) {
        features = features.push_next::<vk::PhysicalDeviceRobustness2FeaturesEXT<'_>>(&mut robustness);
    }
    if is_1_3 {
        features = features.push_next::<vk::PhysicalDeviceZeroInitializeWorkgroupMemoryFeatures<'_>>(&mut clearing);
    }
    // SAFETY: The device comes from this instance and has the structures.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    let abilities = Abilities {
        checks_buffers: robustness.robust_buffer_access2 == vk::TRUE,
        clears_workgroup_memory: clearing.shader_zero_initialize_workgroup_memory == vk::TRUE,
        spirv: if is_1_3 { (1, 6) } else { (1, 5) },
    };
    Ok((create_device(instance, physical, &abilities)?, abilities))
}

fn create_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    abilities: &Abilities,
) -> Result<ash::Device, String> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
    let core = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
    let mut extensions = vec![ash::khr::pipeline_executable_properties::NAME.as_ptr()];
    let mut telling =
        vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
    let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
    let mut clearing = vk::PhysicalDeviceZeroInitializeWorkgroupMemoryFeatures::default()
        .shader_zero_initialize_workgroup_memory(true);
    let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&core);
    info = info.push_next(&mut telling);
    if abilities.checks_buffers {
        extensions.push(ash::ext::robustness2::NAME.as_ptr());
        info = info.push_next(&mut robustness);
    }
    if abilities.clears_workgroup_memory {
        info = info.push_next(&mut clearing);
    }
    let info = info.enabled_extension_names(&extensions);
    // SAFETY: The structures and what they point to live during the call, and the device has all that they ask for.
    unsafe { instance.create_device(physical, &info, None) }.map_err(|error| format!("no device of RADV: {error}"))
}
