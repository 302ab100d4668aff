//! The paper's own experiments, its figures 9 and 10: the time of every step against the number of sites and the size of the
//! texture, on one CPU thread and on whatever GPU there is.
//!
//! `cargo bench --bench paper [-- ROUNDS]` prints tables in Markdown, in milliseconds of wall time:
//! 9(a), (b) the whole pipeline with textures of fixed and of suitable size, beside `spade` and `delaunator`; 9(c) its steps with
//! a texture of 4096 x 4096; 9(d) as (b), normally distributed; 10 the steps on a million sites with textures of 512 to 4096.
//!
//! All ways take turns on the same sites; a first round warms up, then medians of ROUNDS (5) are taken, of each step by itself, so
//! that they need not add up to the total. "Shaders" are G1 to G6 on the GPU, by its own timestamps. "GPU and CPU" is what a job with
//! `backend = "gpu"` does: G1 to G3 there, the rest here. "Plain loops" are the shaders' twins, which are to be read; timed once.
//! `WGPU_ADAPTER_NAME` names an adapter; a renderer in software, which the tables then say, is taken if there is no other.

mod points;

use delaunator::Point;
use gdt_batch::geometry::Site;
use gdt_batch::gpu::buffer_id::BufferId;
use gdt_batch::gpu::buffers::BufferSet;
use gdt_batch::gpu::device::{self, AdapterRequest, Device};
use gdt_batch::gpu::engine::GpuEngine;
use gdt_batch::gpu::error::GpuError;
use gdt_batch::gpu::executor::{Executor, GpuUse};
use gdt_batch::gpu::options::{GpuOptions, TextureSide, VoronoiMethod};
use gdt_batch::gpu::steps::{GpuStep, Recording};
use gdt_batch::gpu::texture_size::TextureSize;
use gdt_batch::gpu::twins;
use gdt_batch::mesh::half_edge::HalfEdgeMesh;
use gdt_batch::voronoi::counts::{PipelineCounts, STEP_NAMES};
use gdt_batch::voronoi::diagram_backend::{DiagramBackend, DiagramReply};
use gdt_batch::voronoi::rejection::Rejection;
use gdt_batch::voronoi::texture_request::{TextureRequest, TextureResolution};
use gdt_batch::voronoi::{PipelineBuffers, triangulate, triangulate_with};
use points::{gaussian, median, uniform};
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::hint::black_box;
use std::sync::Mutex;
use std::time::Instant;

/// Sides of the textures, as in the paper.
const SIDES: [u32; 4] = [512, 1024, 2048, 4096];
/// The side that figure 9(c) is about.
const FIXED: u32 = SIDES[3];
/// Numbers of sites.
const SITES: [usize; 6] = [100_000, 200_000, 400_000, 600_000, 800_000, 1_000_000];

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with("--"));
    let rounds = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(5);
    let gpu = Gpu::open();
    match &gpu {
        Ok(gpu) => println!("{}: {}", gpu.kind, gpu.name),
        Err(why) => println!("no GPU: {why}"),
    }
    let gpu = gpu.ok().map(RefCell::new);
    let runs = figure_9(&SITES.map(uniform), gpu.as_ref(), rounds);
    print_totals("Figure 9(a), (b): uniform", &runs);
    print_steps(&format!("Figure 9(c): uniform, {FIXED} x {FIXED}"), &SITES.map(thousands), &by_sites(&runs, FIXED));
    print_totals("Figure 9(d): gaussian", &figure_9(&SITES.map(gaussian), None, rounds));
    figure_10(&uniform(1_000_000), gpu.as_ref(), rounds);
}

/// All ways on every input, the GPU's on the largest texture.
fn figure_9(inputs: &[Vec<Site>], gpu: Option<&RefCell<Gpu>>, rounds: usize) -> Vec<Vec<Measured>> {
    let measure_one = |sites: &Vec<Site>| {
        let mut ways = on_cpu_with_any(sites);
        ways.push(by_delaunator(sites));
        ways.extend(gpu.into_iter().flat_map(|gpu| on_gpu_alone_and_helped(gpu, sites, FIXED)));
        measure(ways, rounds)
    };
    inputs.iter().map(measure_one).collect()
}

/// The steps on all textures, and what they met.
fn figure_10(sites: &[Site], gpu: Option<&RefCell<Gpu>>, rounds: usize) {
    let mut ways = on_cpu_with_any(sites);
    for (gpu, side) in gpu.into_iter().flat_map(|gpu| SIDES.map(|side| (gpu, side))) {
        ways.extend(on_gpu_alone_and_helped(gpu, sites, side));
        ways.push(by_shaders(gpu, sites, side, VoronoiMethod::Jfa));
    }
    let mut groups = by_side(&measure(ways, rounds));
    groups.push(("plain loops, one thread".into(), SIDES.map(|side| plain_loops(sites, side)).into()));
    print_steps("Figure 10: uniform, 1 M sites", &SIDES.map(|side| side.to_string()), &groups);
    print_counts(&groups[0].1);
}

// Runs.

/// What a run took, in milliseconds; where there is no total, the steps are not all of the way.
#[derive(Clone, Default)]
struct Run {
    total: Option<f64>,
    steps: Vec<(&'static str, f64)>,
    counts: PipelineCounts,
    /// How often `spade` fits in.
    times_spade: f64,
}

type Outcome = Result<Run, String>;

/// A way to do it, for which sites on which texture.
struct Way<'a> {
    name: String,
    side: Option<u32>,
    run: Box<dyn FnMut() -> Outcome + 'a>,
}

/// A way's name, the side of its texture, and what came of it.
type Measured = (String, Option<u32>, Outcome);

/// Runs `ways`, of which one is `spade`.
fn measure(mut ways: Vec<Way>, rounds: usize) -> Vec<Measured> {
    let mut outcomes = alternate(&mut ways, rounds);
    let spade = ways.iter().zip(&outcomes).find(|(way, _)| way.name == SPADE);
    let spade = spade.and_then(|(_, outcome)| outcome.as_ref().ok()?.total).unwrap_or(f64::NAN);
    for run in outcomes.iter_mut().flatten() {
        run.times_spade = spade / run.total.unwrap_or(f64::NAN);
    }
    ways.into_iter().zip(outcomes).map(|(way, outcome)| (way.name, way.side, outcome)).collect()
}

fn alternate(ways: &mut [Way], rounds: usize) -> Vec<Outcome> {
    let mut outcomes: Vec<Vec<Outcome>> = ways.iter().map(|_| Vec::new()).collect();
    for round in 0..=rounds {
        for (way, outcomes) in ways.iter_mut().zip(&mut outcomes) {
            let outcome = (way.run)();
            if round > 0 {
                outcomes.push(outcome);
            }
        }
    }
    outcomes.into_iter().map(|outcomes| outcomes.into_iter().collect::<Result<_, _>>().map(medians)).collect()
}

fn medians(runs: Vec<Run>) -> Run {
    let Some(last) = runs.last().cloned() else { return Run::default() };
    let step = |i: usize| median(runs.iter().map(|run| run.steps[i].1).collect());
    let steps = last.steps.iter().enumerate().map(|(i, &(name, _))| (name, step(i))).collect();
    let totals: Option<Vec<f64>> = runs.iter().map(|run| run.total).collect();
    Run { total: totals.map(median), steps, ..last }
}

/// What `f` returns, and the milliseconds that it took.
fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let value = f();
    (value, 1000.0 * start.elapsed().as_secs_f64())
}

// Ways on the CPU.

const CPU: &str = "CPU, one thread";
const SPADE: &str = "spade";

/// `spade`, and the pipeline with every texture.
fn on_cpu_with_any(sites: &[Site]) -> Vec<Way<'_>> {
    let sides = SIDES.into_iter().map(Some);
    let pipelines = std::iter::once(None).chain(sides).map(|side| on_cpu(sites, side));
    std::iter::once(by_spade(sites)).chain(pipelines).collect()
}

/// The pipeline on this thread, with a texture of `side` or else of the size that suits.
fn on_cpu<'a>(sites: &'a [Site], side: Option<u32>) -> Way<'a> {
    let request = side.map_or(TextureRequest::default(), |side| TextureRequest {
        resolution: TextureResolution::Side(side),
        ..TextureRequest::default()
    });
    let mut buffers = PipelineBuffers::with_texture(request);
    let run = move || pipeline(&mut buffers, |buffers| triangulate(sites, buffers));
    Way { name: CPU.into(), side, run: Box::new(run) }
}

fn pipeline(
    buffers: &mut PipelineBuffers,
    f: impl FnOnce(&mut PipelineBuffers) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection>,
) -> Outcome {
    let (done, total) = timed(|| f(buffers));
    let (mesh, counts) = done.map_err(|why| why.to_string())?;
    buffers.recycle(black_box(mesh));
    let milliseconds = counts.nanoseconds.map(|time| time as f64 / 1e6);
    // The last step is to wait for the GPU.
    let steps =
        STEP_NAMES.into_iter().zip(milliseconds).take(STEP_NAMES.len() - (counts.on_gpu == 0) as usize).collect();
    Ok(Run { total: Some(total), steps, counts, ..Run::default() })
}

fn by_spade<'a>(sites: &[Site]) -> Way<'a> {
    let points: Vec<_> = sites.iter().map(|s| Point2::new(f64::from(s[0]), f64::from(s[1]))).collect();
    library(SPADE, move || {
        let mesh = DelaunayTriangulation::<Point2<f64>>::bulk_load(points.clone()).expect("finite");
        black_box(mesh.num_inner_faces());
    })
}

fn by_delaunator<'a>(sites: &[Site]) -> Way<'a> {
    let points: Vec<_> = sites.iter().map(|s| Point { x: f64::from(s[0]), y: f64::from(s[1]) }).collect();
    library("delaunator", move || {
        black_box(delaunator::triangulate(&points));
    })
}

fn library<'a>(name: &str, mut f: impl FnMut() + 'a) -> Way<'a> {
    let run = move || Ok(Run { total: Some(timed(&mut f).1), ..Run::default() });
    Way { name: name.into(), side: None, run: Box::new(run) }
}

/// The shaders' twins, once each.
fn plain_loops(sites: &[Site], side: u32) -> Outcome {
    let (size, pixels) = placed(sites, side)?;
    let (texture, g1) = timed(|| twins::write_sites(size, &pixels));
    let (_, jfa) = timed(|| black_box(twins::voronoi_jfa(size, &texture)));
    let (mut labels, g2) = timed(|| twins::voronoi_exact(size, &texture));
    let ((), g3) = timed(|| twins::remove_islands(size, &mut labels));
    let (corners, g4) = timed(|| twins::find_vertices(size, &labels));
    let (_, g5) = timed(|| black_box(twins::count(size, &corners)));
    let (_, g6) = timed(|| black_box(twins::make_triangles(size, &labels, &texture)));
    let mut steps: Vec<_> = GpuStep::ALL.map(GpuStep::name).into_iter().zip([g1, g2, g3, g4, g5, g6]).collect();
    steps.insert(2, ("or G2 by 1+JFA", jfa));
    Ok(Run { steps, ..Run::default() })
}

/// Somebody who makes no diagrams, but keeps what is asked of him.
struct Listener(u32, Mutex<Option<(TextureSize, Vec<u32>)>>);

impl DiagramBackend for Listener {
    fn texture_request(&self) -> TextureRequest {
        TextureRequest { resolution: TextureResolution::Side(self.0), ..TextureRequest::default() }
    }

    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply {
        if let Ok(mut heard) = self.1.lock() {
            *heard = Some((TextureSize { width, height }, pixels));
        }
        DiagramReply::Unavailable
    }
}

/// The texture of `sites`, and the pixel of each that has one.
fn placed(sites: &[Site], side: u32) -> Result<(TextureSize, Vec<u32>), String> {
    let listener = Listener(side, Mutex::new(None));
    let done = triangulate_with(sites, Some(&listener), &mut PipelineBuffers::default());
    let heard = listener.1.into_inner().ok().flatten();
    heard.ok_or_else(|| done.err().map_or("no texture was made".into(), |why| why.to_string()))
}

// Ways on the GPU.

struct Gpu {
    /// The adapter's name.
    name: String,
    /// Whether it is one, or only a program that behaves so.
    kind: &'static str,
    engine: GpuEngine,
    buffers: BufferSet,
}

impl Gpu {
    fn open() -> Result<Gpu, String> {
        let adapters = device::adapters();
        let infos: Vec<_> = adapters.iter().map(wgpu::Adapter::get_info).collect();
        let chosen = device::choose(&infos, &AdapterRequest::new(None, true))?;
        let device = Device::open(&adapters[chosen]).map_err(|error| error.to_string())?;
        let kind = if device::is_software(&infos[chosen]) { "software GPU" } else { "GPU" };
        Ok(Gpu {
            name: infos[chosen].name.clone(),
            kind,
            engine: GpuEngine::new(device),
            buffers: BufferSet::default(),
        })
    }

    /// Steps G1 to G6, by the GPU's own timestamps.
    fn run(
        &mut self,
        size: TextureSize,
        pixels: &[u32],
        voronoi: VoronoiMethod,
    ) -> Result<[f64; GpuStep::ALL.len()], GpuError> {
        // At most two triangles a site, and some for what the texture gets wrong.
        let room = 2 * pixels.len() + pixels.len() / 4 + 64;
        let mut recording = Recording::labels(size, pixels.to_vec(), voronoi);
        recording.commands.extend(Recording::triangles(size, room as u32).commands);
        let readback = self.engine.start_and_fetch(&mut self.buffers, &recording, BufferId::Triangles, 12)?;
        let (_, times) = self.engine.finish(&self.buffers, readback)?;
        Ok(times.map(|time| time as f64 / 1e6))
    }
}

/// The exact shaders, and the pipeline with their help.
fn on_gpu_alone_and_helped<'a>(gpu: &'a RefCell<Gpu>, sites: &'a [Site], side: u32) -> Vec<Way<'a>> {
    let shaders = by_shaders(gpu, sites, side, VoronoiMethod::Exact);
    std::iter::once(shaders).chain(on_gpu_and_cpu(gpu.borrow().kind, sites, side)).collect()
}

fn by_shaders<'a>(gpu: &'a RefCell<Gpu>, sites: &[Site], side: u32, voronoi: VoronoiMethod) -> Way<'a> {
    let placed = placed(sites, side);
    let transform = if voronoi == VoronoiMethod::Jfa { "1+JFA" } else { "exact" };
    let name = format!("{}, shaders, {transform}", gpu.borrow().kind);
    let run = move || {
        let (size, pixels) = placed.as_ref().map_err(String::clone)?;
        let times = gpu.borrow_mut().run(*size, pixels, voronoi).map_err(|error| error.to_string())?;
        if times.iter().all(|&time| time == 0.0) {
            return Err("the adapter has no timestamps".into());
        }
        Ok(Run { steps: GpuStep::ALL.map(GpuStep::name).into_iter().zip(times).collect(), ..Run::default() })
    };
    Way { name, side: Some(side), run: Box::new(run) }
}

/// The pipeline with the GPU's help, if it gives any.
fn on_gpu_and_cpu<'a>(kind: &str, sites: &'a [Site], side: u32) -> Option<Way<'a>> {
    let options = GpuOptions { texture: TextureSide::Side(side), ..GpuOptions::default() };
    let executor = Executor::start(&options, GpuUse::Required, u64::MAX).ok()?;
    let mut buffers = PipelineBuffers::default();
    let run = move || {
        let mut run = pipeline(&mut buffers, |buffers| triangulate_with(sites, Some(&executor), buffers))?;
        if run.counts.on_gpu == 0 {
            return Err("the GPU did not take it".into());
        }
        // In the order of what happens, and named after what is left here.
        run.steps.rotate_right(1);
        run.steps.swap(0, 1);
        (run.steps[1].0, run.steps[2].0) = ("upload, G1 to G3, read back", "G4-G6 triangles, most flips");
        Ok(run)
    };
    Some(Way { name: format!("{kind} and CPU"), side: Some(side), run: Box::new(run) })
}

// Tables.

/// A name for rows that belong together, and an outcome for each column.
type Group = (String, Vec<Outcome>);

fn find(runs: &[Measured], name: &str, side: Option<u32>) -> Outcome {
    let found = runs.iter().find(|run| run.0 == name && run.1 == side);
    found.map_or_else(|| Err("not measured".into()), |run| run.2.clone())
}

/// The groups of ways with a texture of `side`; a column for every number of sites.
fn by_sites(runs: &[Vec<Measured>], side: u32) -> Vec<Group> {
    let names = runs[0].iter().filter(|run| run.1 == Some(side)).map(|run| run.0.clone());
    names.map(|name| (name.clone(), runs.iter().map(|runs| find(runs, &name, Some(side))).collect())).collect()
}

/// The groups of ways that have textures; a column for every side.
fn by_side(runs: &[Measured]) -> Vec<Group> {
    let names = runs.iter().filter(|run| run.1 == Some(FIXED)).map(|run| run.0.clone());
    names.map(|name| (name.clone(), SIDES.map(|side| find(runs, &name, Some(side))).into())).collect()
}

fn thousands(n: usize) -> String {
    if n.is_multiple_of(1_000_000) { format!("{} M", n / 1_000_000) } else { format!("{} k", n / 1000) }
}

fn milliseconds(time: f64) -> String {
    if time < 10.0 { format!("{time:.1}") } else { format!("{time:.0}") }
}

fn print_head(title: &str, columns: &[String]) {
    println!("\n{title}\n\n| | {} |\n|---{}|", columns.join(" | "), "|---".repeat(columns.len()));
}

/// The total of every way: milliseconds, and in brackets how often it fits into `spade`'s.
fn print_totals(title: &str, runs: &[Vec<Measured>]) {
    print_head(title, &SITES.map(thousands));
    let ways = runs[0].iter().filter(|run| run.2.as_ref().map_or(true, |run| run.total.is_some()));
    for (name, side, _) in ways {
        let texture = match (side, name == CPU) {
            (Some(side), _) => format!(", {side} x {side}"),
            (None, true) => ", 5 pixels a site".into(),
            (None, false) => String::new(),
        };
        let cell = |runs: &Vec<Measured>| match find(runs, name, *side) {
            Ok(run) => format!("{} ({:.2})", milliseconds(run.total.unwrap_or(f64::NAN)), run.times_spade),
            Err(_) => "-".into(),
        };
        let cells: Vec<_> = runs.iter().map(cell).collect();
        println!("| {name}{texture} | {} |", cells.join(" | "));
    }
    print_whys(runs.iter().flatten().map(|run| &run.2));
}

/// The steps of every group, its total, and how often that fits into `spade`'s.
fn print_steps(title: &str, columns: &[String], groups: &[Group]) {
    print_head(title, columns);
    for (name, outcomes) in groups {
        let row = |label: &str, cell: &dyn Fn(&Run) -> String| {
            let cells: Vec<_> = outcomes.iter().map(|o| o.as_ref().map_or("-".into(), cell)).collect();
            println!("| {label} | {} |", cells.join(" | "));
        };
        println!("| **{name}** |{}", " |".repeat(columns.len()));
        let Some(first) = outcomes.iter().flatten().next() else { continue };
        for (i, (step, _)) in first.steps.iter().enumerate() {
            row(step, &|run| milliseconds(run.steps[i].1));
        }
        if first.total.is_some() {
            row("total", &|run| milliseconds(run.total.unwrap_or(f64::NAN)));
            row("x spade", &|run| format!("{:.2}", run.times_spade));
        }
    }
    print_whys(groups.iter().flat_map(|group| &group.1));
}

/// Why there are cells with nothing in them.
fn print_whys<'a>(outcomes: impl Iterator<Item = &'a Outcome>) {
    let whys: BTreeSet<_> = outcomes.filter_map(|outcome| outcome.as_ref().err()).collect();
    whys.iter().for_each(|why| println!("\n-: {why}"));
}

/// What the steps met, as percentages of the sites.
fn print_counts(outcomes: &[Outcome]) {
    print_head("Of a hundred sites (CPU)", &SIDES.map(|side| side.to_string()));
    let count = |label: &str, of: fn(&PipelineCounts) -> u64| {
        let percent = |run: &Run| format!("{:.2}", 100.0 * of(&run.counts) as f64 / run.counts.sites as f64);
        let cells: Vec<_> = outcomes.iter().map(|o| o.as_ref().map_or("-".into(), percent)).collect();
        println!("| {label} | {} |", cells.join(" | "));
    };
    count("missing", |c| c.missing);
    count("moved to the pixel beside", |c| c.moved);
    count("islands", |c| c.islands);
    count("inverted triangles", |c| c.inverted);
    count("taken out for it", |c| c.removed);
    count("flips", |c| c.flips);
}
