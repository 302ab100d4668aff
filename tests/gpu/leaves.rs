//! Whole leaves and whole jobs with a GPU's help give the same mesh as without.

use super::clouds::{Cloud, clouds, hard_clouds, real_cloud};
use super::random::Random;
use super::rig::Rig;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::{TriangulationCounts, canonical};
use delaunay::voronoi;
use delaunay::voronoi::PipelineBuffers;
use delaunay::voronoi::mesh_reply::{MadeMesh, MeshReply, SharedNumbers};
use delaunay::voronoi::texture_request::TextureResolution;
use delaunay_gpu::filled_atlas::{AtlasLimits, FilledAtlas};
use delaunay_gpu::options::{GpuOptions, TextureSide, VoronoiMethod};
use delaunay_gpu::reference_kernels;
use delaunay_gpu::returned::replies;
use delaunay_gpu::triangulation_options::{Backend, TriangulationOptions};
use delaunay_gpu::triangulator::Triangulator;
use job::progress::stage::ProgressOutput;
use std::collections::BTreeSet;
use std::sync::Arc;
use sys::ErrorKind;
use verify::verify;

const MEMORY: u64 = 1 << 30;

fn settings(backend: Backend) -> TriangulationOptions {
    TriangulationOptions { backend, ..TriangulationOptions::default() }
}

fn solve(config: &TriangulationOptions, gpu: &GpuOptions, sites: &[Site]) -> (BTreeSet<[u32; 3]>, TriangulationCounts) {
    let (mesh, outcome) = Triangulator::new(config, gpu, MEMORY).unwrap().triangulate(sites).unwrap();
    (triangles(&mesh), outcome)
}

/// Returns the set of triangles, each from its least corner.
fn triangles(mesh: &HalfEdgeMesh) -> BTreeSet<[u32; 3]> {
    mesh.corners().iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()).collect()
}

fn distinct(sites: impl IntoIterator<Item = Site>) -> Vec<Site> {
    let mut seen = BTreeSet::new();
    sites.into_iter().filter(|&site| seen.insert(site)).collect()
}

/// Inputs that the pipeline is known to accept.
fn inputs() -> Vec<(&'static str, Vec<Site>)> {
    let mut random = Random(11);
    let mut uniform = |n, w, h| distinct((0..n).map(|_| [random.below(w) as i32, random.below(h) as i32])).to_vec();
    vec![
        ("uniform", uniform(20_000, 1 << 28, 1 << 28)),
        ("coarse", uniform(8_000, 150, 150)),
        ("wide", uniform(5_000, 1 << 24, 1 << 14)),
        ("lattice", (0..5_000).map(|i| [i % 100 * 7, i / 100 * 3]).collect()),
        (
            "void",
            uniform(9_000, 3000, 3000)
                .into_iter()
                .filter(|s| (s[0] - 1500).pow(2) + (s[1] - 1500).pow(2) > 1_000_000)
                .collect(),
        ),
    ]
}

#[test]
fn a_leaf_has_the_same_triangles_with_every_backend() {
    if Rig::new().is_none() {
        return;
    }
    for (name, sites) in inputs() {
        let (expected, _) = solve(&settings(Backend::Reference), &GpuOptions::default(), &sites);
        let (on_cpu, outcome) = solve(&settings(Backend::Cpu), &GpuOptions::default(), &sites);
        assert!(on_cpu == expected, "{name} on the CPU");
        assert_eq!((outcome.pipeline, outcome.counts.on_gpu), (1, 0));
        for voronoi in [VoronoiMethod::Exact, VoronoiMethod::Jfa] {
            for texture in [TextureSide::Auto, TextureSide::Side(300), TextureSide::Side(1500)] {
                let (on_gpu, outcome) =
                    solve(&settings(Backend::Gpu), &GpuOptions { voronoi, texture, adapter: None }, &sites);
                assert!(on_gpu == expected, "{name}, {voronoi:?}, {texture:?}");
                // Only a texture that is too coarse for the input may be a reason to reject it.
                if texture == TextureSide::Auto {
                    assert_eq!((outcome.pipeline, outcome.counts.on_gpu), (1, 1), "{name}, {voronoi:?}");
                }
            }
        }
    }
}

#[test]
fn every_cloud_has_one_mesh() {
    if Rig::new().is_none() {
        return;
    }
    let clouds: Vec<Cloud> = clouds().into_iter().chain(hard_clouds()).chain(real_cloud()).collect();
    let gpus = [VoronoiMethod::Exact, VoronoiMethod::Jfa].map(|voronoi| {
        let options = GpuOptions { voronoi, ..GpuOptions::default() };
        Triangulator::new(&settings(Backend::Gpu), &options, MEMORY).unwrap()
    });
    let mut on_gpu = 0;
    for cloud in &clouds {
        let expected = triangles(&canonical(&cloud.sites).unwrap());
        for gpu in &gpus {
            let (mesh, outcome) = gpu.triangulate(&cloud.sites).unwrap();
            assert!(triangles(&mesh) == expected, "{}", cloud.name);
            println!("{}: {:?}", cloud.name, outcome);
            on_gpu += outcome.counts.on_gpu as usize;
        }
    }
    // Some of the hard ones are none for a device.
    assert!(on_gpu + 6 >= 2 * clouds.len(), "{on_gpu} of {}", 2 * clouds.len());
}

/// Returns the answer of a device for `sites`.
fn reply(sites: &[Site]) -> MeshReply {
    let mut filled = FilledAtlas::default();
    let limits = AtlasLimits { pixels: 1 << 24, bytes: 1 << 27 };
    assert!(filled.add(sites, TextureResolution::PixelsPerSite(16.0), limits));
    let numbers = reference_kernels::atlas::mesh(&filled.atlas, &filled.sites, VoronoiMethod::Exact);
    let numbers: SharedNumbers = Arc::new(numbers);
    replies(&filled.atlas, &numbers, true).remove(0)
}

/// Returns the answer of a device, once `spoil` has spoilt the mesh.
fn spoilt(sites: &[Site], spoil: impl FnOnce(&mut MadeMesh)) -> MeshReply {
    match reply(sites) {
        MeshReply::Made(mut made) => {
            spoil(&mut made);
            MeshReply::Made(made)
        }
        other => other,
    }
}

/// Returns the answer of a device, once `spoil` has spoilt the records of the triangles.
fn spoilt_records(sites: &[Site], spoil: impl FnOnce(&mut [u32])) -> MeshReply {
    spoilt(sites, |made| {
        let mut numbers = (*made.numbers).as_ref().to_vec();
        spoil(&mut numbers[made.records.clone()]);
        made.numbers = Arc::new(numbers);
    })
}

/// A leaf is done without the device if its answer is of no use.
#[test]
fn a_wrong_answer_never_makes_a_wrong_mesh() {
    let (_, sites) = inputs().swap_remove(0);
    let (expected, _) = solve(&settings(Backend::Reference), &GpuOptions::default(), &sites);
    let replies = [
        ("as it is", 1, reply(&sites)),
        ("flagged", 0, MeshReply::Flagged),
        ("none", 0, MeshReply::Unavailable),
        ("no record", 0, spoilt(&sites, |made| made.records = 0..0)),
        ("fewer numbers than records", 0, spoilt(&sites, |made| made.numbers = Arc::new(vec![0; 8]))),
        ("zeros", 0, spoilt_records(&sites, |records| records.fill(0))),
        ("reversed", 0, spoilt_records(&sites, |records| records.reverse())),
        ("of other sites", 0, reply(&inputs()[1].1)),
        ("no block known", 1, spoilt(&sites, |made| made.block_of = Box::new(|_| u32::MAX))),
    ];
    for (name, on_gpu, reply) in replies {
        let done = voronoi::triangulate_with(&sites, &reply, &mut PipelineBuffers::default());
        let (mesh, counts) = done.unwrap_or_else(|why| panic!("{name}: {why}"));
        assert!(triangles(&mesh) == expected, "{name}");
        assert_eq!(counts.on_gpu, on_gpu, "{name}");
    }
}

#[test]
fn a_gpu_that_does_not_exist_is_an_error_if_required_and_none_otherwise() {
    let nameless = GpuOptions { adapter: Some("no GPU has this name".into()), ..GpuOptions::default() };
    let error = Triangulator::new(&settings(Backend::Gpu), &nameless, MEMORY).err().expect("there is no such GPU");
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("no GPU has this name"), "{error}");
    let optional = Triangulator::new(&settings(Backend::Auto), &nameless, MEMORY).unwrap();
    optional.prepare(u64::MAX, 1);
    assert!(optional.gpu().is_none());
}

#[test]
fn a_job_writes_the_same_bytes_on_every_backend() {
    if Rig::new().is_none() {
        return;
    }
    let jobs = SampleJobs::new();
    for compression in ["meshopt", "none"] {
        let files =
            ["reference", "cpu", "gpu"].map(|backend| jobs.run(&format!("backend = \"{backend}\""), compression).0);
        assert!(files.iter().all(|list| *list == files[0]), "{compression}: {files:?}");
    }
}

#[test]
fn a_job_has_the_same_digest_with_every_tiling_and_texture() {
    if Rig::new().is_none() {
        return;
    }
    let jobs = SampleJobs::new();
    let digests: BTreeSet<String> = [
        "backend = \"cpu\"",
        "backend = \"gpu\"\nmax_points_per_tile = 7000\n[gpu]\nvoronoi = \"jfa\"",
        "backend = \"gpu\"\nmax_points_per_tile = 20000\n[gpu]\ntexture = 700",
    ]
    .iter()
    .map(|lines| jobs.run(lines, "auto").1)
    .collect();
    assert_eq!(digests.len(), 1, "{digests:?}");
}

/// Jobs on one sample terrain.
struct SampleJobs(tempfile::TempDir);

impl SampleJobs {
    fn new() -> SampleJobs {
        let folder = tempfile::tempdir().unwrap();
        gdt_batch::sample::write(&folder.path().join("cloud.las"), 60_000, 3, false).unwrap();
        SampleJobs(folder)
    }

    /// Runs a job; returns the checksum of all its results, and the digest of its mesh.
    fn run(&self, triangulation: &str, compression: &str) -> (String, String) {
        let (path, out) = (self.0.path().join("job.toml"), self.0.path().join("out"));
        let text = format!(
            "[input]\nfiles = [\"cloud.las\"]\n[triangulation]\n{triangulation}\n\
             [output]\ndirectory = \"out\"\ncompression = \"{compression}\"\n[limits]\nthreads = 2\n"
        );
        std::fs::write(&path, text).unwrap();
        let config = gdt_batch::config::load(&path).unwrap();
        let report = job::run(&config, ProgressOutput::Quiet).unwrap();
        let outcome = report.leaves.outcome;
        if config.triangulation.backend == Backend::Gpu {
            assert!(
                outcome.counts.on_gpu > 0 && outcome.counts.on_gpu == outcome.pipeline,
                "{triangulation}: {outcome:?}"
            );
        }
        let verdict = verify(&out, MEMORY).unwrap();
        assert_eq!(verdict.failures, Vec::<String>::new(), "{triangulation}");
        std::fs::remove_dir_all(out).unwrap();
        (report.file_list.to_string(), verdict.digest.to_string())
    }
}

#[test]
fn the_command_says_how_much_faster_a_job_is() {
    if Rig::new().is_none() {
        return;
    }
    let output =
        std::process::Command::new(env!("CARGO_BIN_EXE_gdt-batch")).args(["gpu", "--leaves", "1", "--json"]).output();
    let output = output.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let check: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(check["comparisons"].as_array().unwrap().len() >= 10, "{check}");
    let trial = &check["trial"];
    assert_eq!((trial["same"].as_bool(), &trial["on_gpu"]), (Some(true), &trial["leaves"]), "{trial}");
    assert!(["seconds_with", "seconds_without"].iter().all(|key| trial[key].as_f64().unwrap() > 0.0), "{trial}");
}
