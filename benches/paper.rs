//! The paper's own experiments, its figures 9 and 10: the time of every step against the number of sites and the size of the
//! texture, on one CPU thread and on the GPU of this machine.
//!
//! `cargo bench --bench paper [-- ROUNDS]` prints tables in Markdown, in milliseconds of wall time:
//!
//! - 9(a), (b): the whole pipeline with textures of fixed and of suitable size, compared with `spade` and `delaunator`;
//! - 9(c): its steps with a texture of 4096 x 4096;
//! - 9(d): as (b), with normally distributed sites;
//! - 10: the steps on a million sites with textures of 512 to 4096 pixels a side.
//!
//! All methods take turns on the same sites. After a round to warm up, the tables show medians of ROUNDS (5) rounds. Each step has a
//! median of its own, so steps need not add up to the total. "Shaders" are G1 to G6 and the flips on the GPU, by its own timestamps.
//! "GPU and CPU" is what a job with `backend = "gpu"` does with one leaf: what the device leaves, and the proof, is the CPU's part. "Plain
//! loops" are the shaders' twins, which are written to be read, and are timed once. `WGPU_ADAPTER_NAME` names an adapter. If there is no
//! hardware GPU, a software renderer is used, and the tables say so.

mod points;

use delaunator::Point;
use delaunay::geometry::Site;
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::voronoi::counts::{PipelineCounts, STEP_NAMES};
use delaunay::voronoi::rejection::Rejection;
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};
use delaunay::voronoi::{PipelineBuffers, triangulate, triangulate_with};
use delaunay_gpu::buffer_id::BufferId;
use delaunay_gpu::buffers::BufferSet;
use delaunay_gpu::device;
use delaunay_gpu::device::{AdapterRequest, Device};
use delaunay_gpu::engine::GpuEngine;
use delaunay_gpu::error::GpuError;
use delaunay_gpu::executor::{Executor, GpuUse};
use delaunay_gpu::filled_atlas::{AtlasLimits, FilledAtlas, MAX_PIXELS};
use delaunay_gpu::mesh_steps::FLIP_ROUNDS;
use delaunay_gpu::options::{GpuOptions, TextureSide, VoronoiMethod};
use delaunay_gpu::recording::{GpuStep, Recording};
use delaunay_gpu::reference_kernels::atlas::{
    AtlasDiagram, MeshOnDevice, WrittenSites, count, find_vertices, give_back, make_triangles, remove_islands, voronoi,
    write_sites,
};
use delaunay_gpu::reference_kernels::c4_flip::{FlipState, flip_round};
use delaunay_gpu::timestamps::StepNanoseconds;
use points::{gaussian, median, uniform};
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::hint::black_box;
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

/// Measures all methods on every input. Methods of the GPU use the largest texture.
fn figure_9(inputs: &[Vec<Site>], gpu: Option<&RefCell<Gpu>>, rounds: usize) -> Vec<Vec<Measured>> {
    let measure_one = |sites: &Vec<Site>| {
        let mut methods = on_cpu_with_any(sites);
        methods.push(by_delaunator(sites));
        methods.extend(gpu.into_iter().flat_map(|gpu| on_gpu_alone_and_helped(gpu, sites, FIXED)));
        measure(methods, rounds)
    };
    inputs.iter().map(measure_one).collect()
}

/// Measures the steps on all textures, and prints what they counted.
fn figure_10(sites: &[Site], gpu: Option<&RefCell<Gpu>>, rounds: usize) {
    let mut methods = on_cpu_with_any(sites);
    for (gpu, side) in gpu.into_iter().flat_map(|gpu| SIDES.map(|side| (gpu, side))) {
        methods.extend(on_gpu_alone_and_helped(gpu, sites, side));
        methods.push(by_shaders(gpu, sites, side, VoronoiMethod::Jfa));
    }
    let mut groups = by_side(&measure(methods, rounds));
    groups.push(("plain loops, one thread".into(), SIDES.map(|side| plain_loops(sites, side)).into()));
    print_steps("Figure 10: uniform, 1 M sites", &SIDES.map(|side| side.to_string()), &groups);
    print_counts(&groups[0].1);
}

// Runs.

/// The times of a run in milliseconds. There is no total if the steps are only a part of the pipeline.
#[derive(Clone, Default)]
struct Run {
    total: Option<f64>,
    steps: Vec<(&'static str, f64)>,
    counts: PipelineCounts,
    /// The time of `spade` divided by the total.
    times_spade: f64,
}

type Outcome = Result<Run, String>;

/// A method to triangulate some sites, with the side of its texture.
struct Method<'a> {
    name: String,
    side: Option<u32>,
    run: Box<dyn FnMut() -> Outcome + 'a>,
}

/// A method's name, the side of its texture, and its outcome.
type Measured = (String, Option<u32>, Outcome);

/// Runs `methods`, one of which is `spade`.
fn measure(mut methods: Vec<Method>, rounds: usize) -> Vec<Measured> {
    let mut outcomes = alternate(&mut methods, rounds);
    let spade = methods.iter().zip(&outcomes).find(|(method, _)| method.name == SPADE);
    let spade = spade.and_then(|(_, outcome)| outcome.as_ref().ok()?.total).unwrap_or(f64::NAN);
    for run in outcomes.iter_mut().flatten() {
        run.times_spade = spade / run.total.unwrap_or(f64::NAN);
    }
    methods.into_iter().zip(outcomes).map(|(method, outcome)| (method.name, method.side, outcome)).collect()
}

fn alternate(methods: &mut [Method], rounds: usize) -> Vec<Outcome> {
    let mut outcomes: Vec<Vec<Outcome>> = methods.iter().map(|_| Vec::new()).collect();
    for round in 0..=rounds {
        for (method, outcomes) in methods.iter_mut().zip(&mut outcomes) {
            let outcome = (method.run)();
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

/// Returns the result of `f`, and the milliseconds that it took.
fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let value = f();
    (value, 1000.0 * start.elapsed().as_secs_f64())
}

// Methods on the CPU.

const CPU: &str = "CPU, one thread";
const SPADE: &str = "spade";

/// Returns `spade`, and the pipeline with every texture.
fn on_cpu_with_any(sites: &[Site]) -> Vec<Method<'_>> {
    let sides = SIDES.into_iter().map(Some);
    let pipelines = std::iter::once(None).chain(sides).map(|side| on_cpu(sites, side));
    std::iter::once(by_spade(sites)).chain(pipelines).collect()
}

/// Returns the pipeline on this thread, with a texture of `side` or of suitable size.
fn on_cpu<'a>(sites: &'a [Site], side: Option<u32>) -> Method<'a> {
    let request = side.map_or(TextureRequest::default(), |side| TextureRequest {
        resolution: TextureResolution::Side(side),
        ..TextureRequest::default()
    });
    let mut buffers = PipelineBuffers::with_texture(request);
    let run = move || pipeline(&mut buffers, |buffers| triangulate(sites, buffers));
    Method { name: CPU.into(), side, run: Box::new(run) }
}

fn pipeline(
    buffers: &mut PipelineBuffers,
    f: impl FnOnce(&mut PipelineBuffers) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection>,
) -> Outcome {
    let (done, total) = timed(|| f(buffers));
    let (mesh, counts) = done.map_err(|why| why.to_string())?;
    buffers.recycle(black_box(mesh));
    let milliseconds = counts.nanoseconds.map(|time| time as f64 / 1e6);
    let mut steps: Vec<_> = STEP_NAMES.into_iter().zip(milliseconds).collect();
    if counts.on_gpu > 0 {
        steps.push(("wait for the GPU", total - milliseconds.iter().sum::<f64>()));
    }
    Ok(Run { total: Some(total), steps, counts, ..Run::default() })
}

fn by_spade<'a>(sites: &[Site]) -> Method<'a> {
    let points: Vec<_> = sites.iter().map(|s| Point2::new(f64::from(s[0]), f64::from(s[1]))).collect();
    library(SPADE, move || {
        let mesh = DelaunayTriangulation::<Point2<f64>>::bulk_load(points.clone()).expect("finite");
        black_box(mesh.num_inner_faces());
    })
}

fn by_delaunator<'a>(sites: &[Site]) -> Method<'a> {
    let points: Vec<_> = sites.iter().map(|s| Point { x: f64::from(s[0]), y: f64::from(s[1]) }).collect();
    library("delaunator", move || {
        black_box(delaunator::triangulate(&points));
    })
}

fn library<'a>(name: &str, mut f: impl FnMut() + 'a) -> Method<'a> {
    let run = move || Ok(Run { total: Some(timed(&mut f).1), ..Run::default() });
    Method { name: name.into(), side: None, run: Box::new(run) }
}

/// Times the shaders' twins, once each.
fn plain_loops(sites: &[Site], side: u32) -> Outcome {
    let FilledAtlas { atlas, sites } = filled(sites, side)?;
    let (WrittenSites { texture, missing }, g1) = timed(|| write_sites(&atlas, &sites));
    let (_, jfa) = timed(|| black_box(voronoi(&atlas, &texture, VoronoiMethod::Jfa)));
    let (mut labels, g2) = timed(|| voronoi(&atlas, &texture, VoronoiMethod::Exact));
    let (mut flags, g3) = timed(|| remove_islands(&atlas, &mut labels));
    let diagram = AtlasDiagram { atlas: &atlas, labels: &labels, texture: &texture, sites: &sites };
    let ((_, counts), g4) = timed(|| find_vertices(diagram));
    let (starts, g5) = timed(|| count(&counts));
    let (records, g6) = timed(|| make_triangles(diagram, &mut flags));
    let mut state = FlipState::new(records);
    let (_, flips) = timed(|| (1..=FLIP_ROUNDS).for_each(|round| flip_round(&mut state, &sites, round)));
    let (records, marks) = (&state.records, &state.marks);
    let mesh = MeshOnDevice { records, marks, missing: &missing, starts: &starts, flags: &flags };
    let (_, back) = timed(|| black_box(give_back(&atlas, mesh)));
    let times = [g1, g2, g3, g4, g5, g6, flips, back];
    let mut steps: Vec<_> = GpuStep::ALL.map(GpuStep::name).into_iter().zip(times).collect();
    steps.insert(2, ("or G2 by 1+JFA", jfa));
    Ok(Run { steps, ..Run::default() })
}

/// Returns an atlas of one leaf, in a texture of `side`.
fn filled(sites: &[Site], side: u32) -> Result<FilledAtlas, String> {
    let mut filled = FilledAtlas::default();
    let limits = AtlasLimits { pixels: MAX_PIXELS, bytes: u64::MAX };
    let fits = filled.add(sites, TextureResolution::Side(side), limits);
    fits.then_some(filled).ok_or_else(|| "the texture is too large".into())
}

// Methods on the GPU.

struct Gpu {
    /// The adapter's name.
    name: String,
    /// Whether it is hardware or a software renderer.
    kind: &'static str,
    engine: GpuEngine,
    buffers: BufferSet,
}

impl Gpu {
    fn open() -> Result<Gpu, String> {
        let adapters = device::adapters();
        let infos: Vec<_> = adapters.iter().map(|adapter| adapter.get_info()).collect();
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

    /// Times all steps by the GPU's own timestamps.
    fn run(&mut self, filled: &FilledAtlas, voronoi: VoronoiMethod) -> Result<StepNanoseconds, GpuError> {
        let recording = Recording::mesh(&filled.atlas, &filled.sites, voronoi);
        let readback = self.engine.start_and_fetch(&mut self.buffers, &recording, BufferId::Returned, 32)?;
        Ok(self.engine.finish(&self.buffers, readback)?.1)
    }
}

/// Returns the exact shaders, and the pipeline with their help.
fn on_gpu_alone_and_helped<'a>(gpu: &'a RefCell<Gpu>, sites: &'a [Site], side: u32) -> Vec<Method<'a>> {
    let shaders = by_shaders(gpu, sites, side, VoronoiMethod::Exact);
    std::iter::once(shaders).chain(on_gpu_and_cpu(gpu.borrow().kind, sites, side)).collect()
}

fn by_shaders<'a>(gpu: &'a RefCell<Gpu>, sites: &[Site], side: u32, voronoi: VoronoiMethod) -> Method<'a> {
    let filled = filled(sites, side);
    let transform = if voronoi == VoronoiMethod::Jfa { "1+JFA" } else { "exact" };
    let name = format!("{}, shaders, {transform}", gpu.borrow().kind);
    let run = move || {
        let filled = filled.as_ref().map_err(String::clone)?;
        let times = gpu.borrow_mut().run(filled, voronoi).map_err(|error| error.to_string())?;
        if times.iter().all(|&time| time == 0) {
            return Err("the adapter has no timestamps".into());
        }
        let times = times.map(|nanoseconds| nanoseconds as f64 / 1e6);
        Ok(Run { steps: GpuStep::ALL.map(GpuStep::name).into_iter().zip(times).collect(), ..Run::default() })
    };
    Method { name, side: Some(side), run: Box::new(run) }
}

/// Returns the pipeline with the GPU's help, if there is a GPU.
fn on_gpu_and_cpu<'a>(kind: &str, sites: &'a [Site], side: u32) -> Option<Method<'a>> {
    let options = GpuOptions { texture: TextureSide::Side(side), ..GpuOptions::default() };
    let executor = Executor::start(&options, GpuUse::Required, u64::MAX).ok()?;
    let mut buffers = PipelineBuffers::default();
    let run = move || {
        let mut run = pipeline(&mut buffers, |buffers| triangulate_with(sites, &executor.mesh(sites), buffers))?;
        if run.counts.on_gpu == 0 {
            return Err("the GPU's mesh was of no use".into());
        }
        // Put the steps in the order in which they happen, and name the one that takes over the device's mesh.
        run.steps.rotate_right(1);
        run.steps.retain(|(step, _)| !["G1 write sites", "G3 islands"].contains(step));
        (run.steps[0].0, run.steps[1].0) = ("upload, G1 to G6, flips, read back", "check, take over");
        Ok(run)
    };
    Some(Method { name: format!("{kind} and CPU"), side: Some(side), run: Box::new(run) })
}

// Tables.

/// The name of a group of rows, and an outcome for each column.
type Group = (String, Vec<Outcome>);

fn find(runs: &[Measured], name: &str, side: Option<u32>) -> Outcome {
    let found = runs.iter().find(|run| run.0 == name && run.1 == side);
    found.map_or_else(|| Err("not measured".into()), |run| run.2.clone())
}

/// Returns the groups of methods with a texture of `side`, with a column for every number of sites.
fn by_sites(runs: &[Vec<Measured>], side: u32) -> Vec<Group> {
    let names = runs[0].iter().filter(|run| run.1 == Some(side)).map(|run| run.0.clone());
    names.map(|name| (name.clone(), runs.iter().map(|runs| find(runs, &name, Some(side))).collect())).collect()
}

/// Returns the groups of methods that have textures, with a column for every side.
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

/// Prints the total of every method in milliseconds, and in brackets the time of `spade` divided by it.
fn print_totals(title: &str, runs: &[Vec<Measured>]) {
    print_head(title, &SITES.map(thousands));
    let methods = runs[0].iter().filter(|run| run.2.as_ref().map_or(true, |run| run.total.is_some()));
    for (name, side, _) in methods {
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
    print_reasons(runs.iter().flatten().map(|run| &run.2));
}

/// Prints the steps of every group, its total, and the time of `spade` divided by the total.
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
    print_reasons(groups.iter().flat_map(|group| &group.1));
}

/// Prints why some cells are empty.
fn print_reasons<'a>(outcomes: impl Iterator<Item = &'a Outcome>) {
    let reasons: BTreeSet<_> = outcomes.filter_map(|outcome| outcome.as_ref().err()).collect();
    reasons.iter().for_each(|why| println!("\n-: {why}"));
}

/// Prints what the steps counted, as percentages of the sites.
fn print_counts(outcomes: &[Outcome]) {
    print_head("Of a hundred sites (CPU)", &SIDES.map(|side| side.to_string()));
    let count = |label: &str, of: fn(&PipelineCounts) -> u64| {
        let percent = |run: &Run| format!("{:.2}", 100.0 * of(&run.counts) as f64 / run.counts.sites as f64);
        let cells: Vec<_> = outcomes.iter().map(|o| o.as_ref().map_or("-".into(), percent)).collect();
        println!("| {label} | {} |", cells.join(" | "));
    };
    count("missing", |c| c.missing);
    count("moved to a neighbouring pixel", |c| c.moved);
    count("islands", |c| c.islands);
    count("inverted triangles", |c| c.inverted);
    count("removed for it", |c| c.removed);
    count("flips", |c| c.flips);
}
