//! Two processes with one output directory.

use crate::rig::{Rig, Run, Setup};
use crate::scattered;

#[test]
fn a_second_process_is_told_which_process_works_in_the_directory() {
    let rig = Rig::new(&scattered::gaussian(40_000), &Setup::tiles_of(1_000));
    let first = Run::stopped_at(&mut rig.command(), "leaf", 1);
    let second = rig.run().stopped(&["is working in", "another [output] directory"]);
    assert!(second.err.contains(&first.child.id().to_string()), "{}", second.err);
    assert!(!second.err.contains("run the same command again"), "it has no steps to go on with: {}", second.err);
    first.signal("CONT");
    first.end().succeeded();
    rig.is_complete("after a second process");
}

#[test]
fn the_lock_of_a_killed_process_does_not_stop_the_next_run() {
    let rig = Rig::new(&scattered::gaussian(20_000), &Setup::tiles_of(2_000));
    assert!(rig.run_to("committed", 3).was_killed());
    assert!(rig.out().join("job/lock").exists());
    assert!(rig.completes("after a kill")["resumed"].as_u64() >= Some(3));
}
