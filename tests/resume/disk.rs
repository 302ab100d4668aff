//! Disks that fill up, at every stage.

use std::collections::BTreeSet;
use std::process::Command;

use crate::clouds;
use crate::rig::{Rig, Run, Setup};

/// A run in which no file may become larger than so many bytes.
fn limited(rig: &Rig, kibibytes: u64) -> Run {
    let mut command = Command::new("bash");
    command.arg("-c").arg(format!("ulimit -f {kibibytes} && exec \"$0\" job.toml"));
    Run::start(command.arg(env!("CARGO_BIN_EXE_gdt-batch")).env("GDT_COMMIT_MS", "0").current_dir(rig.folder.path()))
}

#[test]
fn a_file_that_may_not_grow_stops_any_stage() {
    let rig = Rig::new(&clouds::gaussian(20_000), &Setup::tiles_of(2_000)).committing_every(0);
    let mut stages = BTreeSet::new();
    for count in [0, 1, 8, 14, 30, 36, 40, 52] {
        for kibibytes in [24, 48, 96, 400] {
            rig.forget();
            assert!(count == 0 || rig.run_to("committed", count).was_killed());
            let end = limited(&rig, kibibytes).end();
            if end.status.success() {
                rig.is_complete("nothing grew too large");
                continue;
            }
            let end = end.stopped(&["error: cannot write", "ulimit -f"]);
            assert_eq!(count > 0, end.err.contains("run the same command again"), "{}", end.err);
            rig.has_nothing_half_written(&end.err);
            stages.insert(
                end.err.split("error: cannot write ").nth(1).unwrap().split(['0', ':', '.']).next().unwrap().to_owned(),
            );
            rig.completes(&end.err);
        }
    }
    assert!(stages.len() >= 4, "{stages:?}");
}

/// Fills a file system of $1 KiB, then makes room and goes on. Prints what the first run said.
const FILL: &str = r#"
set -u
mount -t tmpfs -o size=$1k tmpfs out || exit 77
GDT_COMMIT_MS=0 "$0" job.toml 2>&1
code=$?
mount -o remount,size=256m out
"$0" --quiet job.toml || exit 78
cp -r out copy
exit $code
"#;

/// A command that may mount, if there is one: for root in a mount namespace, for others in a user namespace as well.
fn mounting(rig: &Rig, kibibytes: u64) -> Command {
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount", "bash", "-c", FILL, env!("CARGO_BIN_EXE_gdt-batch")]);
    command.arg(kibibytes.to_string()).current_dir(rig.folder.path());
    command
}

#[test]
fn a_disk_that_fills_up_stops_any_stage() {
    let rig = Rig::new(&clouds::gaussian(20_000), &Setup::tiles_of(2_000));
    let can_mount = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"])
        .output()
        .is_ok_and(|output| output.status.success());
    if !can_mount {
        eprintln!("skipped: no file system can be mounted here");
        return;
    }
    let mut messages = BTreeSet::new();
    let copy = rig.folder.path().join("copy");
    for kibibytes in (1..40).map(|i| i * 128) {
        std::fs::create_dir(rig.out()).unwrap();
        let end = Run::start(&mut mounting(&rig, kibibytes)).end();
        std::fs::remove_dir(rig.out()).unwrap();
        std::fs::rename(&copy, rig.out()).unwrap();
        rig.is_complete(&format!("{kibibytes} KiB: {}", end.out));
        rig.forget();
        if end.status.success() {
            break;
        }
        assert_eq!(end.status.code(), Some(1), "{kibibytes} KiB: {end:?}");
        assert!(end.out.contains("No space left") && end.out.contains("make room"), "{}", end.out);
        let message = end.out[end.out.find("error: ").unwrap()..].lines().next().unwrap();
        messages.insert(message.chars().filter(|c| !c.is_ascii_digit()).collect::<String>());
    }
    assert!(messages.len() >= 5, "{messages:#?}");
}
