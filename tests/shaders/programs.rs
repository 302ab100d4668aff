//! The programs: all entry points of all shaders.

use delaunay::geometry::Site;
use delaunay::voronoi::texture_request::{TextureRequest, TextureResolution};
use delaunay_gpu::atlas::Atlas;
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::recording::{GpuCommand, Recording, ShaderProgram};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Returns the name of a program: its file and its function.
pub(crate) fn name(program: &ShaderProgram) -> String {
    format!("{} {}", program.file, program.entry)
}

/// Returns all programs, in the order of their names: those that a recording of every step runs.
pub(crate) fn programs() -> Vec<ShaderProgram> {
    let commands = [VoronoiMethod::Exact, VoronoiMethod::Jfa].map(|voronoi| recorded(voronoi).commands);
    let programs = commands.into_iter().flatten().filter_map(|command| match command {
        GpuCommand::Run(program, ..) => Some((name(&program), program)),
        _ => None,
    });
    programs.collect::<BTreeMap<_, _>>().into_values().collect()
}

fn recorded(voronoi: VoronoiMethod) -> Recording {
    let sites: [Site; 3] = [[0, 0], [1000, 0], [0, 1000]];
    let resolution = TextureResolution::PixelsPerSite(100_000.0);
    let mut atlas = Atlas::default();
    assert!(atlas.add(&sites, &TextureRequest { resolution, max_side: 16_384, max_pixels: 1 << 24 }, 1 << 25));
    let mut recording = Recording::mesh(&atlas, &sites, voronoi);
    recording.decide(&[[[0, 0]; 4]]);
    recording.copy_labels(16);
    recording
}

/// Returns the names of all compute functions in `shaders/`.
pub(crate) fn on_disk() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "", &mut names);
    names
}

/// Adds the compute functions of a folder. `path` is how programs name the folder.
fn read(folder: &Path, path: &str, names: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("the folder is there").map(|entry| entry.expect("it can be read")) {
        let file_name = entry.file_name().into_string().expect("it is a plain name");
        if entry.path().is_dir() {
            read(&entry.path(), &format!("{path}{file_name}/"), names);
        } else if let Some(file) = file_name.strip_suffix(".wgsl") {
            let text = fs::read_to_string(entry.path()).expect("it can be read");
            names.extend(compute_functions(&text).map(|function| format!("{path}{file} {function}")));
        }
    }
}

fn compute_functions(text: &str) -> impl Iterator<Item = &str> {
    let functions = text.split("@compute").skip(1).filter_map(|rest| rest.split_once("fn ")?.1.split_once('('));
    functions.map(|(function, _)| function)
}
