//! Disks that fill up at every stage.

use std::collections::BTreeSet;
use std::process::Command;

use crate::rig::{Rig, Run, Setup};
use crate::scattered;

/// Starts a run in which no file may become larger than `kibibytes` KiB.
fn limited(rig: &Rig, kibibytes: u64) -> Run {
    let mut command = Command::new("bash");
    command.arg("-c").arg(format!("ulimit -f {kibibytes} && exec \"$0\" --force job.toml"));
    command.arg(env!("CARGO_BIN_EXE_gdt-batch")).current_dir(rig.folder.path()).envs(rig.environment());
    Run::start(&mut command)
}

/// Returns where a run stopped: the file that it could not write, without its number, and how many phases it kept.
fn place(said: &str) -> (String, String) {
    let after = |text: &'static str| said.split(text).nth(1).unwrap_or_default();
    let file = after("error: cannot write ").split(": ").next().unwrap_or_default();
    let phases = after("is kept in out/job (").split(')').next().unwrap_or_default();
    (file.replace(|c: char| c.is_ascii_digit(), ""), phases.to_owned())
}

#[test]
fn a_job_that_reached_a_file_size_limit_at_any_stage_goes_on_without_it() {
    let setup = Setup::tiles_of(2_000);
    let rig = Rig::new(&scattered::gaussian(20_000), &setup).with_usual_preview(&setup);
    let mut places = BTreeSet::new();
    for count in [0, 1, 2, 3, 4] {
        for kibibytes in [24, 300, 600, 1_000] {
            rig.forget();
            assert!(count == 0 || rig.run_to("committed", count).was_killed());
            let end = limited(&rig, kibibytes).end().stopped(&["error: cannot write", "ulimit -f"]);
            assert!(count == 0 || end.err.contains("run the same command again"), "{}", end.err);
            rig.has_nothing_half_written(&end.err);
            places.insert(place(&end.err));
            rig.completes(&end.err);
        }
    }
    assert!(places.len() >= 5, "{places:?}");
}

/// Runs the job on a file system of $1 KiB, then makes room and runs it again. Prints what the first run said.
const FILL: &str = r#"
set -u
mount -t tmpfs -o size=$1k tmpfs out || exit 77
"$0" --force job.toml 2>&1
code=$?
mount -o remount,size=256m out
"$0" --quiet job.toml || exit 78
cp -r out copy
exit $code
"#;

/// Returns a command that runs `FILL` as root of its own user and mount namespaces, where it may mount.
fn mounting(rig: &Rig, kibibytes: u64) -> Command {
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount", "bash", "-c", FILL, env!("CARGO_BIN_EXE_gdt-batch")]);
    command.arg(kibibytes.to_string()).current_dir(rig.folder.path()).envs(rig.environment());
    command
}

/// Runs a small job, a job that fills the disk, and a job that fits once what the second one left is gone.
const FILL_AND_GO_ON: &str = r#"
set -u
mount -t tmpfs -o size=40m tmpfs out || exit 77
"$0" --quiet small.toml || exit 78
"$0" --quiet --force large.toml 2>&1 && exit 79
"$0" --quiet $1 medium.toml 2>&1 || exit 80
cp -r out copy
"#;

#[test]
fn after_a_job_that_filled_the_disk_another_one_runs_in_its_directory() {
    if !can_mount() {
        eprintln!("skipped: no file system can be mounted here");
        return;
    }
    let setup = Setup::tiles_of(20_000);
    let mut rig = Rig::new(&scattered::gaussian(2_000), &setup).with_usual_preview(&setup);
    for (name, points) in [("small", 5_000), ("large", 400_000), ("medium", 20_000)] {
        scattered::write(rig.folder.path(), &format!("{name}.csv"), &scattered::gaussian(points));
        let input = format!("files = [\"{name}.csv\"]");
        rig.configure(&Setup { input: input.clone(), ..setup.clone() });
        std::fs::rename(rig.folder.path().join("job.toml"), rig.folder.path().join(format!("{name}.toml"))).unwrap();
        if name == "medium" {
            std::fs::remove_dir_all(rig.folder.path().join("undisturbed")).unwrap();
            rig.expect(&Setup { input, ..setup.clone() });
        }
    }
    for flag in ["", "--restart"] {
        std::fs::create_dir(rig.out()).unwrap();
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "bash", "-c", FILL_AND_GO_ON]);
        command.arg(env!("CARGO_BIN_EXE_gdt-batch")).arg(flag).current_dir(rig.folder.path()).envs(rig.environment());
        let end = Run::start(&mut command).end();
        assert!(end.status.success() && end.out.contains("No space left"), "{end:?}");
        std::fs::remove_dir(rig.out()).unwrap();
        std::fs::rename(rig.folder.path().join("copy"), rig.out()).unwrap();
        rig.is_complete(flag);
        rig.forget();
    }
}

/// Tells whether this user may mount a file system in a namespace of its own.
fn can_mount() -> bool {
    let mount = ["--user", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"];
    Command::new("unshare").args(mount).output().is_ok_and(|output| output.status.success())
}

#[test]
fn a_job_whose_disk_was_full_at_any_stage_goes_on_when_there_is_room() {
    let setup = Setup::tiles_of(2_000);
    let rig = Rig::new(&scattered::gaussian(20_000), &setup).with_usual_preview(&setup);
    if !can_mount() {
        eprintln!("skipped: no file system can be mounted here");
        return;
    }
    let mut places = BTreeSet::new();
    let copy = rig.folder.path().join("copy");
    // The points and the leaves fill the smaller sizes, mostly the pixels of the preview the larger ones.
    let kibibytes = [256, 768, 1024, 1280, 1536, 1792].into_iter().chain((2..40).map(|mebibytes| mebibytes << 10));
    for kibibytes in kibibytes {
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
        assert!(end.out.contains("No space left") && end.out.contains("free some space"), "{}", end.out);
        places.insert(place(&end.out));
    }
    assert!(places.len() >= 4, "{places:?}");
}
