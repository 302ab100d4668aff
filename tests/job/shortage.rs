//! Too little memory, at every amount: the program says so and exits with 1. It never aborts or panics.

use std::path::Path;
use std::sync::OnceLock;

use crate::clouds;
use crate::program::{Job, gdt_batch, gdt_batch_within_kib};

/// Returns the KiB of address space from which on the program itself says what is wrong. With less, the system cannot load it; with a little
/// more than that, it aborts before `main`, where the standard library wants memory.
fn least_to_start() -> u64 {
    let code = |kibibytes: u64| {
        let mut command = std::process::Command::new("sh");
        command.env("RUST_BACKTRACE", "0").arg("-c").arg(format!("ulimit -v {kibibytes} && exec \"$0\" --version"));
        command.arg(env!("CARGO_BIN_EXE_gdt-batch")).output().unwrap().status.code()
    };
    let started = (20_000..).step_by(100).find(|&kibibytes| matches!(code(kibibytes), Some(0 | 1))).unwrap();
    assert_eq!(code(started - 1_000), Some(127), "it aborts over a long range below {started} KiB");
    started
}

/// Runs the program with more and more address space until it succeeds a few times. Returns how many runs were refused.
#[track_caller]
fn refused_until_it_fits(folder: &Path, arguments: &[&str], before: impl Fn()) -> usize {
    static LEAST: OnceLock<u64> = OnceLock::new();
    let (mut refused, mut fitted, mut kibibytes) = (0, 0, *LEAST.get_or_init(least_to_start));
    while fitted < 3 {
        before();
        let said = gdt_batch_within_kib(kibibytes, folder, arguments);
        match said.code {
            0 => fitted += 1,
            code => {
                let has_words =
                    ["memory", "cannot start", "Cannot allocate"].iter().any(|word| said.err.contains(word));
                assert!(code == 1 && has_words, "{arguments:?} with {kibibytes} KiB: {said:?}");
                (refused, fitted) = (refused + 1, 0);
            }
        }
        // Coarser steps where there is more: some hundred runs in all.
        kibibytes += 200 + kibibytes / 14;
        assert!(kibibytes < 8 << 20, "{arguments:?} never fits: {said:?}");
    }
    refused
}

#[test]
#[cfg(target_os = "linux")]
fn with_any_amount_of_address_space_a_command_succeeds_or_says_that_memory_is_short() {
    let folder = tempfile::tempdir().unwrap();
    let text = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(6_000, 40_000, 4));
    gdt_batch(folder.path(), &["sample", "cloud.laz", "--points", "20000"]).succeeded();
    let laz = folder.path().join("cloud.laz");
    for (cloud, threads) in [(&text, 4), (&laz, 1)] {
        let job = Job::on(&[cloud]).tiles_of(2_000).threads(threads);
        let (config, out) = (job.config(), job.out());
        let config = config.to_str().unwrap();
        let restart = || _ = std::fs::remove_dir_all(&out);
        assert!(refused_until_it_fits(job.folder(), &["--force", "--quiet", config], restart) > 3);
    }
    let job = Job::on(&[&text]).tiles_of(2_000).threads(4);
    let config = job.config();
    let config = config.to_str().unwrap();
    assert!(refused_until_it_fits(job.folder(), &[config], || {}) > 3);
    assert!(refused_until_it_fits(job.folder(), &["check", config], || {}) > 3);
    let with_input = ["verify", "out", "--input", text.to_str().unwrap()];
    assert!(refused_until_it_fits(job.folder(), &with_input, || {}) > 1);
    for arguments in [&["info", "cloud.csv"][..], &["info", "cloud.laz"], &["sample", "s.laz", "--overwrite"]] {
        refused_until_it_fits(folder.path(), arguments, || {});
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_job_that_the_address_space_does_not_hold_is_refused_with_the_limit_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let text = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(100_000, 100_000, 4));
    let job = Job::on(&[&text]).threads(2);
    let config = job.config();
    let said = gdt_batch_within_kib(200 << 10, job.folder(), &[config.to_str().unwrap()]);
    said.refused(1, &["not enough memory", "the job takes about", "ulimit -v", "raise it"]);
}

/// Runs one test of this program by itself, in a process where the variable GDT_TEST_ABORT is set, and returns how that ended.
#[cfg(unix)]
fn ended(test: &str) -> (Option<i32>, String) {
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    let output = command.args([test, "--exact", "--nocapture"]).env("GDT_TEST_ABORT", "1").output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[cfg(unix)]
fn is_child() -> bool {
    let is_child = std::env::var_os("GDT_TEST_ABORT").is_some();
    if is_child {
        sys::shortage::listen(gdt_batch::exit_code::exit_code).unwrap();
    }
    is_child
}

#[test]
#[cfg(unix)]
fn an_allocation_that_fails_ends_the_program_with_1() {
    if is_child() {
        std::hint::black_box(Vec::<u8>::with_capacity(isize::MAX as usize));
    }
    let (code, said) = ended("shortage::an_allocation_that_fails_ends_the_program_with_1");
    assert!(code == Some(1) && said.contains("memory allocation of"), "{code:?}: {said}");
}

#[test]
#[cfg(unix)]
fn a_panic_while_panicking_ends_the_program_with_4() {
    struct Again;
    impl Drop for Again {
        fn drop(&mut self) {
            panic!("again");
        }
    }
    if is_child() {
        let _again = Again;
        panic!("first");
    }
    let (code, said) = ended("shortage::a_panic_while_panicking_ends_the_program_with_4");
    assert!(code == Some(4) && said.contains("again"), "{code:?}: {said}");
}

/// Runs the program with little room for its data, which a limit on the address space does not see.
#[test]
#[cfg(target_os = "linux")]
fn a_limit_on_the_data_is_named_too() {
    let folder = tempfile::tempdir().unwrap();
    let text = clouds::write(folder.path(), "cloud.csv", &clouds::uniform(6_000, 40_000, 4));
    let job = Job::on(&[&text]).tiles_of(2_000).threads(2);
    let run = |mebibytes: u64, arguments: &str| {
        let line = format!("ulimit -d {} && exec \"$0\" {arguments} job.toml", mebibytes * 1024);
        let mut command = std::process::Command::new("sh");
        command.arg("-c").arg(line).arg(env!("CARGO_BIN_EXE_gdt-batch")).current_dir(job.folder());
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    job.config();
    for mebibytes in [10, 20, 30] {
        let (code, said) = run(mebibytes, "");
        assert!(code == Some(1) && said.contains("not enough memory") && said.contains("ulimit -d"), "{said}");
    }
    for mebibytes in [40, 60, 80, 100] {
        let (code, said) = run(mebibytes, "--force --quiet --restart");
        assert!(code == Some(0) || code == Some(1) && said.contains("ulimit -d"), "{mebibytes} MiB: {code:?}, {said}");
    }
}
