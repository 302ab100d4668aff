//! A GPU that a job may use, but need not, does not harm it. The engines are no GPUs: they answer late, or never.

use crate::clouds;
use crate::program::{Job, number};
use std::fs;
use std::path::Path;

/// Returns a job of some sixty leaves, which may use a GPU.
fn job(cloud: &Path, threads: usize) -> Job {
    let job = Job::on(&[cloud]).tiles_of(1_000).threads(threads);
    job.with("limits", "memory = \"1 GiB\"").with("output", "format = \"glb\"")
}

fn terrain(job: &Job) -> Vec<u8> {
    fs::read(job.out().join("terrain.glb")).unwrap()
}

#[test]
fn a_late_or_silent_gpu_changes_no_byte() {
    if !cfg!(feature = "fault-injection") {
        eprintln!("not tested: this build has no fault-injection");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let cloud = clouds::write(folder.path(), "square.csv", &clouds::uniform(40_000, 100_000, 8));
    let alone = job(&cloud, 2).with("triangulation", "backend = \"cpu\"");
    assert!(alone.report()["gpu_figures"].is_null());
    for (gpu, threads) in [("slow:20", 1), ("slow:20", 3), ("silent", 2)] {
        let helped = job(&cloud, threads).variable("GDT_GPU", gpu);
        let report = helped.report();
        let figures = &report["gpu_figures"];
        let [with, without] = ["helped", "alone"].map(|kind| number(&figures[kind]));
        assert!(with < without, "{gpu}: {figures}");
        assert!(with == 0 || gpu != "silent", "{figures}");
        assert!(terrain(&helped) == terrain(&alone), "{gpu}, {threads} threads");
    }
    // How many late answers a job awaits that may use a GPU depends on the load of the machine. One that must use it awaits all.
    let helped = job(&cloud, 2).with("triangulation", "backend = \"gpu\"").variable("GDT_GPU", "slow:20");
    let report = helped.report();
    assert!(number(&report["gpu_figures"]["helped"]) > 0, "{}", report["gpu_figures"]);
    assert!(terrain(&helped) == terrain(&alone), "a GPU that is required");
}
