//! The JSON that the program prints and writes fits docs/schemas, and every field of these schemas is in use.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::bad_files::write;
use crate::breaklines::with_doubtful_heights;
use crate::clip::clipped;
use crate::clouds;
use crate::copc_file::CopcFile;
use crate::diff::surveys;
use crate::ept_files::{EptFiles, NodeType};
use crate::far_points::with_a_far_point;
use crate::las_file::LasFile;
use crate::levels::hills;
use crate::parts::{in_files, in_parts};
use crate::program::{Job, Said, gdt_batch};
use crate::web_server::WebServer;

/// The documents that are to be compared, each in a file that is called after its schema.
struct Documents {
    folder: TempDir,
}

impl Documents {
    fn add(&self, schema: &str, text: &str) {
        let number = fs::read_dir(self.folder.path()).unwrap().count();
        fs::write(self.folder.path().join(format!("{schema}-{number}.json")), text).unwrap();
    }

    /// Checks and runs a job, and adds both results. Returns its report.
    #[track_caller]
    fn run(&self, job: &Job) -> String {
        self.add("check", &job.run_with(&["check", "--json"]).succeeded().out);
        let report = job.run_with(&["--json", "--quiet"]).succeeded().out;
        self.add("report", &report);
        report
    }

    /// Verifies the results of a job, which has this conclusion.
    #[track_caller]
    fn verify(&self, job: &Job, inputs: &[&Path], verdict: &str) {
        let mut arguments = vec!["verify", "out", "--json"];
        if !inputs.is_empty() {
            arguments.push("--input");
        }
        arguments.extend(inputs.iter().map(|file| file.to_str().unwrap()));
        let said = gdt_batch(job.folder(), &arguments);
        assert_eq!(said.json()["verdict"], verdict, "{said:?}");
        self.add("verify", &said.out);
    }

    /// Adds how far a job is, which is this.
    #[track_caller]
    fn status(&self, job: &Job, added: &[&str], state: &str) {
        let config = job.config();
        let said = gdt_batch(job.folder(), &[&["status", config.to_str().unwrap(), "--json"], added].concat());
        assert_eq!(said.json()["state"], state, "{said:?}");
        self.add("status", &said.succeeded().out);
    }
}

#[track_caller]
fn task(job: &Job, phase: &str, task: &str) -> Said {
    let config = job.config();
    gdt_batch(job.folder(), &["work", config.to_str().unwrap(), "--phase", phase, "--task", task]).succeeded()
}

/// A text in degrees with a bad row, one without ground, and a damaged file.
fn mixed_inputs(folder: &Path) -> Job {
    let rows = |class: u8| {
        let row = |i: u32| {
            let [x, y] = [i % 20, i / 20].map(|step| f64::from(step) * 1e-4);
            format!("{:.6},{:.6},{}.5,{i},{class}\n", 45.0 + y, -91.0 + x + y / 7.0, i % 9)
        };
        (0..400).map(row).collect::<String>()
    };
    let head = "lat,lon,z,intensity,classification\n";
    let ground = write(folder, "ground.csv", format!("{head}{}bad row\n", rows(2)).as_bytes());
    let trees = write(folder, "trees.csv", format!("{head}{}", rows(5)).as_bytes());
    let damaged = write(folder, "damaged.las", b"LASF and nothing else");
    Job::on(&[ground, trees, damaged])
        .with("input", "surface = \"ground\"\non_bad_file = \"skip\"\nmax_malformed_fraction = 0.1")
        .with("input", "missing_crs = \"EPSG:4269\"\nto_crs = \"EPSG:32615\"\ndatums = \"close\"")
        .with("input", "bounds = [0, 0, 1e7, 1e7]\ncsv = { delimiter = \",\", header = true, comment = \"#\" }")
        .with("output", "attributes = [\"intensity\"]")
}

fn add_jobs_of_one_part(documents: &Documents) {
    let folder = tempfile::tempdir().unwrap();
    let mixed = documents.run(&mixed_inputs(folder.path()));
    assert!(["bad row", "no point of it is used", "damaged.las"].iter().all(|words| mixed.contains(words)), "{mixed}");
    let (_survey, job) = with_doubtful_heights();
    documents.run(&job);
    let (_cloud, clipped) = clipped();
    documents.run(&clipped);
    documents.verify(&job, &[], "proved");
    let (_cloud, far) = with_a_far_point();
    documents.run(&far);
    fs::write(job.out().join("tiles/000000.glb"), "its only tile").unwrap();
    documents.verify(&job, &[], "failed");
    // The program believes in a GPU that is a millisecond late.
    let square = clouds::write(folder.path(), "square.csv", &clouds::uniform(6_000, 30_000, 8));
    let job = Job::on(&[&square]).tiles_of(500).threads(2).variable("GDT_GPU", "slow:1");
    let job = job
        .with("output", "max_edge = 900.0\nmax_error = 9.0\nexport = [\"obj\", \"ply\"]")
        .with("output.raster", "resolution = 500.0");
    let job = job.with("output.contours", "interval = 100");
    documents.run(&job);
    documents.verify(&job, &[&square], "proved");
    add_what_is_missing_or_wrong(documents, &job);
    let bare = Job::on(&[&square]).with("input", "surface = \"bare-earth\"\nbare_earth = { slope = 0.2 }");
    documents.run(&bare);
    let on_map = Job::on(&[&square]).with("input", "crs = \"EPSG:32631\"");
    let on_map = on_map.with("output", "terrain = { format = \"quantized-mesh\" }");
    documents.run(&on_map.with("output.raster", "resolution = 500.0\npmtiles = \"terrarium\""));
    let server = WebServer::of(&[("/returns.las", LasFile::new(4, 7, 0, 500).las())]);
    documents.run(
        &Job::on(&[server.url("/returns.las")])
            .with("input", "returns = [1, 2]\nclasses = [1, 2, 3]\nresolution = 0.01"),
    );
    let octree = CopcFile::new(&LasFile::new(4, 7, 0, 500), 2);
    let octree = EptFiles::of(&octree, NodeType::Binary).write(&folder.path().join("octree"));
    documents.run(&Job::on(&[octree]));
}

fn add_what_is_missing_or_wrong(documents: &Documents, job: &Job) {
    fs::rename(job.out().join("cut"), job.folder().join("cut")).unwrap();
    documents.verify(job, &[], "as-far-as-can-be-told");
    fs::rename(job.folder().join("cut"), job.out().join("cut")).unwrap();
    fs::write(job.out().join("tileset.json"), "{}").unwrap();
    documents.verify(job, &[], "failed");
}

fn add_a_job_of_parts(documents: &Documents) {
    let folder = tempfile::tempdir().unwrap();
    let files = in_files(folder.path(), &hills(6_000, 3), 4_000);
    let job = in_parts(&files, 2_000);
    documents.status(&job, &[], "not-planned");
    ["plan", "read"].iter().for_each(|phase| _ = task(&job, phase, "1/1"));
    documents.status(&job, &["--tasks", "2"], "under-way");
    documents.status(&job, &[], "under-way");
    documents.run(&job);
    documents.status(&job, &[], "done");
    documents.verify(&job, &[], "proved");
    documents.status(&job.with("output", "max_edge = 900.0"), &[], "other-results");
    let updated = in_parts(&files, 2_000);
    updated.run_with(&["--update", "--quiet"]).succeeded();
    documents.add("report", &updated.run_with(&["--update", "--json", "--quiet"]).succeeded().out);
    let whole = Job::on(&files);
    task(&whole, "plan", "1/1");
    documents.status(&whole, &[], "left-to-publish");
}

/// Returns the Python that has jsonschema. If there is none, says so; under tests/run, fails.
fn python() -> Option<PathBuf> {
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/venv/bin/python");
    if !program.is_file() {
        assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "no {}", program.display());
        eprintln!("not tested: no jsonschema; run tests/run, which installs it");
        return None;
    }
    Some(program)
}

#[test]
fn every_document_fits_its_schema_and_every_field_is_in_one() {
    if !cfg!(feature = "fault-injection") {
        eprintln!("not tested: this build has no fault-injection, and so no GPU to believe in");
        return;
    }
    let Some(python) = python() else { return };
    let documents = Documents { folder: tempfile::tempdir().unwrap() };
    add_jobs_of_one_part(&documents);
    add_a_job_of_parts(&documents);
    let surveys = surveys();
    let changes = surveys.before.folder().join("changes");
    let output = ["--json", "--areas", &surveys.write_areas(), "--output", changes.to_str().unwrap()];
    documents.add("diff", &surveys.diff(&output).succeeded().out);
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut check = Command::new(python);
    check.arg(project.join("tests/python/schemas.py")).arg(project.join("docs/schemas")).arg(documents.folder.path());
    let output = check.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let count = fs::read_dir(documents.folder.path()).unwrap().count();
    assert_eq!(said.trim(), format!("{count} documents fit"));
}
