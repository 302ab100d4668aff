//! Whole leaves and whole jobs with a GPU's help give the same mesh as without.

use super::random::Random;
use super::rig::Rig;
use gdt_batch::geometry::Site;
use gdt_batch::gpu::options::{GpuOptions, TextureSide, VoronoiMethod};
use gdt_batch::job::{self, progress::stage::ProgressOutput};
use gdt_batch::triangulation::options::{Backend, TriangulationOptions};
use gdt_batch::triangulation::{TriangulationCounts, Triangulator};
use gdt_batch::verify::verify;
use gdt_batch::voronoi::diagram_backend::{DiagramBackend, DiagramReply};
use gdt_batch::voronoi::rejection::Rejection;
use gdt_batch::voronoi::texture_request::{TextureRequest, TextureResolution};
use gdt_batch::voronoi::{self, PipelineBuffers};
use std::collections::BTreeSet;

const MEMORY: u64 = 1 << 30;

fn settings(backend: Backend) -> TriangulationOptions {
    TriangulationOptions { backend, ..TriangulationOptions::default() }
}

fn solve(config: &TriangulationOptions, gpu: &GpuOptions, sites: &[Site]) -> (BTreeSet<[u32; 3]>, TriangulationCounts) {
    let (mesh, outcome) = Triangulator::new(config, gpu, MEMORY, 2).unwrap().triangulate(sites).unwrap();
    let turned = mesh.corners().iter().map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap());
    (turned.collect(), outcome)
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

/// A backend whose diagrams are wrong.
struct Liar(fn(u32, u32, &[u32]) -> Vec<u32>);

impl DiagramBackend for Liar {
    fn texture_request(&self) -> TextureRequest {
        TextureRequest { resolution: TextureResolution::PixelsPerSite(5.0), max_side: 16_384, max_pixels: 1 << 28 }
    }

    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply {
        DiagramReply::Labels((self.0)(width, height, &pixels))
    }
}

#[test]
fn a_wrong_diagram_never_makes_a_wrong_mesh() {
    let (_, sites) = inputs().swap_remove(0);
    let (expected, _) = solve(&settings(Backend::Reference), &GpuOptions::default(), &sites);
    // The flag says whether every label is a pixel with a site, so that only the mesh shows the lie.
    let liars: [(&str, bool, Liar); 6] = [
        ("too few labels", false, Liar(|_, _, pixels| pixels.to_vec())),
        ("none at all", false, Liar(|_, _, _| Vec::new())),
        ("no site there", false, Liar(|w, h, _| vec![u32::MAX; (w * h) as usize])),
        ("one label", true, Liar(|w, h, pixels| vec![pixels[pixels.len() / 2]; (w * h) as usize])),
        ("in order", true, Liar(|w, h, pixels| pixels.iter().copied().cycle().take((w * h) as usize).collect())),
        (
            "noise",
            true,
            Liar(|w, h, pixels| {
                let mut random = Random(5);
                (0..w * h).map(|_| pixels[random.below(pixels.len() as u32) as usize]).collect()
            }),
        ),
    ];
    for (name, plausible, liar) in liars {
        match voronoi::triangulate_with(&sites, Some(&liar), &mut PipelineBuffers::default()) {
            Ok((mesh, counts)) => {
                let turn = |&[a, b, c]: &[u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
                assert!(mesh.corners().iter().map(turn).collect::<BTreeSet<_>>() == expected, "{name}");
                assert_eq!(counts.on_gpu, plausible as u64, "{name}");
            }
            Err(why) => assert!(plausible && matches!(why, Rejection::NotAccepted(_)), "{name}: {why}"),
        }
    }
}

#[test]
fn a_gpu_that_does_not_exist_is_an_error_if_required_and_none_otherwise() {
    let nameless = GpuOptions { adapter: Some("no GPU has this name".into()), ..GpuOptions::default() };
    let error = Triangulator::new(&settings(Backend::Gpu), &nameless, MEMORY, 1).err().expect("there is no such GPU");
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("no GPU has this name"), "{error}");
    assert!(Triangulator::new(&settings(Backend::Auto), &nameless, MEMORY, 1).unwrap().gpu().is_none());
}

#[test]
fn a_job_has_the_same_digest_on_every_backend() {
    if Rig::new().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.las");
    gdt_batch::sample::write(&cloud, 60_000, 3, false).unwrap();
    let mut digests = BTreeSet::new();
    for (i, lines) in [
        "backend = \"reference\"",
        "backend = \"cpu\"",
        "backend = \"gpu\"",
        "backend = \"gpu\"\nmax_points_per_tile = 7000\n[gpu]\nvoronoi = \"jfa\"",
        "backend = \"gpu\"\nmax_points_per_tile = 20000\n[gpu]\ntexture = 700",
    ]
    .iter()
    .enumerate()
    {
        let path = folder.path().join("job.toml");
        let text = format!(
            "[input]\nfiles = [\"cloud.las\"]\n[triangulation]\n{lines}\n[output]\ndirectory = \"out{i}\"\n[limits]\nthreads = 2\n"
        );
        std::fs::write(&path, text).unwrap();
        let config = gdt_batch::config::load(&path).unwrap();
        let report = job::run(&config, ProgressOutput::detect(true)).unwrap();
        let outcome = report.leaves.outcome;
        if config.triangulation.backend == Backend::Gpu {
            assert!(outcome.counts.on_gpu > 0 && outcome.counts.on_gpu == outcome.pipeline, "{lines}: {outcome:?}");
        }
        let verdict = verify(&config.output.directory, MEMORY).unwrap();
        assert_eq!(verdict.failures, Vec::<String>::new(), "{lines}");
        digests.insert(verdict.digest.to_string());
    }
    assert_eq!(digests.len(), 1, "{digests:?}");
}
