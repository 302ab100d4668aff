//! From WGSL to SPIR-V, as wgpu does it for a device of these abilities (`wgpu-hal`, `src/vulkan/adapter.rs`, `naga_options`).

use delaunay_gpu::recording::ShaderProgram;
use naga::back::spv::{Capability, Options, WriterFlags, ZeroInitializeWorkgroupMemoryMode, write_vec};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module};

/// What decides how wgpu compiles for a device.
#[derive(Debug)]
pub(crate) struct Abilities {
    /// The device checks the bounds of buffers itself.
    pub(crate) checks_buffers: bool,
    /// The device sets workgroup memory to zero itself.
    pub(crate) clears_workgroup_memory: bool,
    /// The version of SPIR-V.
    pub(crate) spirv: (u8, u8),
}

/// A compiled shader.
pub(crate) struct Compiled {
    /// SPIR-V with all entry points of the program's file.
    pub(crate) words: Vec<u32>,
    /// The bindings that the program's function uses, and whether each is a uniform buffer.
    pub(crate) bindings: Vec<(u32, bool)>,
}

/// Compiles the file of a program.
pub(crate) fn compile(program: &ShaderProgram, abilities: &Abilities) -> Compiled {
    let module = naga::front::wgsl::parse_str(program.source)
        .unwrap_or_else(|error| panic!("{}: {}", program.file, error.emit_to_string(program.source)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}: {}", program.file, error.emit_to_string(program.source)));
    let words = write_vec(&module, &info, &options(abilities), None).expect("a valid module can be written");
    Compiled { words, bindings: bindings(&module, &info, program.entry) }
}

fn options(abilities: &Abilities) -> Options<'static> {
    let buffer = if abilities.checks_buffers { BoundsCheckPolicy::Unchecked } else { BoundsCheckPolicy::Restrict };
    let clearing = if abilities.clears_workgroup_memory {
        ZeroInitializeWorkgroupMemoryMode::Native
    } else {
        ZeroInitializeWorkgroupMemoryMode::Polyfill
    };
    Options {
        lang_version: abilities.spirv,
        flags: WriterFlags::LABEL_VARYINGS | WriterFlags::FORCE_POINT_SIZE,
        capabilities: Some([Capability::Shader, Capability::Matrix].into_iter().collect()),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer,
            image_load: BoundsCheckPolicy::Restrict,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: clearing,
        force_loop_bounding: true,
        emit_int_div_checks: true,
        ..Options::default()
    }
}

fn bindings(module: &Module, info: &ModuleInfo, entry: &str) -> Vec<(u32, bool)> {
    let index = module.entry_points.iter().position(|point| point.name == entry).expect("the function is there");
    let uses = info.get_entry_point(index);
    let used = module.global_variables.iter().filter(|(handle, _)| uses[*handle] != GlobalUse::empty());
    used.filter_map(|(_, variable)| Some((variable.binding.as_ref()?.binding, variable.space == AddressSpace::Uniform)))
        .collect()
}
