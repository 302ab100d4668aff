//! Failures of a device are errors, never panics.

use super::placed::{PlacedAtlas, recorded};
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::error::GpuError;
use delaunay_gpu::recording::{GpuCommand, Recording};

/// An atlas of one triangle.
fn small() -> PlacedAtlas {
    let sites: [Site; 3] = [[0, 0], [50, 3], [9, 70]];
    PlacedAtlas::new([&sites[..]], 16.0)
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(mut rig) = Rig::new() else { return };
    let recording = recorded(&small());
    assert_eq!(rig.try_run(&recording), Ok(()));
    rig.lose();
    for _ in 0..2 {
        let error = rig.try_run(&recording).unwrap_err();
        assert!(matches!(error, GpuError::Lost(_)), "{error}");
    }
}

#[test]
fn a_buffer_beyond_the_limits_does_not_fit_and_the_device_still_works() {
    let Some(mut rig) = Rig::new() else { return };
    let too_large = Recording { commands: vec![GpuCommand::Reserve(BufferId::Labels, 1 << 40)] };
    assert_eq!(rig.try_run(&too_large), Err(GpuError::OutOfMemory));
    assert_eq!(rig.try_run(&recorded(&small())), Ok(()));
}

#[test]
fn a_buffer_that_was_never_reserved_is_refused() {
    let Some(mut rig) = Rig::new() else { return };
    let error = rig.try_run(&Recording { commands: vec![GpuCommand::Clear(BufferId::Flood, 4)] }).unwrap_err();
    assert!(matches!(error, GpuError::Refused(_)), "{error}");
}
