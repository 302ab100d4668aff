//! Failures of a device are errors, never panics.

use super::rig::Rig;
use gdt_batch::gpu::buffer_id::BufferId;
use gdt_batch::gpu::error::GpuError;
use gdt_batch::gpu::options::VoronoiMethod;
use gdt_batch::gpu::steps::{GpuCommand, Recording};
use gdt_batch::gpu::texture_size::TextureSize;

#[test]
fn a_lost_device_is_an_error() {
    let Some(mut rig) = Rig::new() else { return };
    let recording =
        Recording::labels(TextureSize { width: 100, height: 100 }, vec![5, 7 << 16 | 9], VoronoiMethod::Exact);
    assert_eq!(rig.try_run(&recording), Ok(()));
    rig.lose();
    for _ in 0..2 {
        let error = rig.try_run(&recording).unwrap_err();
        assert!(matches!(error, GpuError::Lost(_)), "{error}");
    }
}

#[test]
fn a_texture_beyond_the_limits_does_not_fit_and_the_device_still_works() {
    let Some(mut rig) = Rig::new() else { return };
    let too_large = Recording { commands: vec![GpuCommand::Reserve(BufferId::Labels, 1 << 40)] };
    assert_eq!(rig.try_run(&too_large), Err(GpuError::OutOfMemory));
    let small = Recording::labels(TextureSize { width: 100, height: 100 }, vec![5], VoronoiMethod::Jfa);
    assert_eq!(rig.try_run(&small), Ok(()));
}

#[test]
fn a_buffer_that_was_never_reserved_is_refused() {
    let Some(mut rig) = Rig::new() else { return };
    let error = rig.try_run(&Recording { commands: vec![GpuCommand::Clear(BufferId::Counts, 4)] }).unwrap_err();
    assert!(matches!(error, GpuError::Refused(_)), "{error}");
}
