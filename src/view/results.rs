//! Which files of an output directory are served: the results of its job, and nothing that lies beside them.
//!
//! An output directory may hold other files too: inputs, configurations with URLs that let their reader in, all of a project. So a file is
//! served if the job's list of checksums has it. The report has the checksum of that list, so a list of another program is no such list.
//! People may remove both. Then only the terrain itself is served, by the names that jobs give its files.

use std::collections::HashSet;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use serde::Deserialize;

use tiles::checksums::{Checksum, parse_list, read_file};
use tiles::file_names::{OutputFiles, level_uri, tile_uri, tileset_uri};

/// The name of the report from the output directory.
const REPORT: &str = "report.json";

/// The results in an output directory. A job may replace them at any time.
pub(super) struct Results {
    files: OutputFiles,
    /// What the report and the list said when they were last read, and when they had been written.
    last: Mutex<Option<([Written; 2], Arc<Listed>)>>,
}

/// What tells a file from a later one: when it was written and its length. `None` for a file that is not there.
type Written = Option<(SystemTime, u64)>;

/// What the report and the list of checksums say.
#[derive(Debug, Default)]
struct Listed {
    /// Whether a job wrote the report.
    has_report: bool,
    /// The names of all other results, if the list is that of the job.
    names: Option<HashSet<String>>,
}

/// What counts here of a report.
#[derive(Deserialize)]
struct ReportHead {
    generator: String,
    file_list: Option<Checksum>,
}

impl Results {
    /// Returns the results in the output directory `root`.
    pub(super) fn new(root: &Path) -> Results {
        Results { files: OutputFiles::new(root), last: Mutex::new(None) }
    }

    /// Tells whether the file with this path from the output directory, with slashes, is a result.
    pub(super) fn contain(&self, name: &str) -> bool {
        let listed = self.listed();
        match &listed.names {
            _ if name == REPORT => listed.has_report,
            Some(names) => names.contains(name),
            None => is_of_terrain(name),
        }
    }

    /// Returns what the report and the list say now.
    fn listed(&self) -> Arc<Listed> {
        let written = [self.files.report(), self.files.checksums()].map(|path| written(&path));
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((then, listed)) if *then == written => Arc::clone(listed),
            _ => {
                let listed = Arc::new(Listed::read(&self.files));
                *last = Some((written, Arc::clone(&listed)));
                listed
            }
        }
    }
}

impl Listed {
    fn read(files: &OutputFiles) -> Listed {
        let report = read_file(&files.report()).ok().and_then(|text| serde_json::from_slice::<ReportHead>(&text).ok());
        let Some(report) = report.filter(|report| report.generator.starts_with("gdt-batch ")) else {
            return Listed::default();
        };
        let list = read_file(&files.checksums()).ok().filter(|text| report.file_list == Some(Checksum::of(text)));
        let files = list.and_then(|text| parse_list(&text));
        Listed { has_report: true, names: files.map(|files| files.into_iter().map(|(name, _)| name).collect()) }
    }
}

fn written(path: &Path) -> Written {
    let data = path.metadata().ok()?;
    Some((data.modified().ok()?, data.len()))
}

/// Tells whether jobs give this name to the terrain in one file, to a tileset or to a tile.
fn is_of_terrain(name: &str) -> bool {
    let number = || Path::new(name).file_stem()?.to_str()?.parse::<u32>().ok();
    let is_numbered = |number: u32| {
        let number = number as usize;
        [tile_uri(number), level_uri(number), tileset_uri(Some(number))].iter().any(|uri| uri == name)
    };
    name == "terrain.glb" || name == tileset_uri(None) || number().is_some_and(is_numbered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use tempfile::TempDir;
    use tiles::checksums::list_text;

    /// Returns a folder with a list of files with these names, and a report with the checksum of the list.
    fn folder(names: &[&str]) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        write_list(folder.path(), names);
        folder
    }

    fn write_list(folder: &Path, names: &[&str]) {
        let files: Vec<_> = names.iter().map(|name| (name.to_string(), Checksum::of(b""))).collect();
        let list = list_text(&files);
        fs::write(folder.join("XXH128SUMS"), &list).unwrap();
        let report =
            format!("{{\"generator\": \"gdt-batch 9\", \"file_list\": \"{}\"}}", Checksum::of(list.as_bytes()));
        fs::write(folder.join("report.json"), report).unwrap();
    }

    fn are_results(results: &Results, names: &[&str]) -> Vec<bool> {
        names.iter().map(|name| results.contain(name)).collect()
    }

    #[test]
    fn a_result_is_what_the_list_names_in_its_letters() {
        let folder = folder(&["tiles/000000.glb", "preview.png"]);
        let results = Results::new(folder.path());
        assert_eq!(are_results(&results, &["tiles/000000.glb", "preview.png", "report.json"]), [true; 3]);
        for other in [
            "tiles/000001.glb",
            "Preview.png",
            "tiles",
            "",
            "XXH128SUMS",
            "job.toml",
            "terrain.glb",
            "tiles//000000.glb",
        ] {
            assert!(!results.contain(other), "{other}");
        }
        // Another job replaces the results.
        write_list(folder.path(), &["terrain.glb"]);
        assert_eq!(are_results(&results, &["tiles/000000.glb", "terrain.glb"]), [false, true]);
    }

    #[test]
    fn a_list_of_another_program_lists_no_results() {
        let folder = folder(&["tiles/000000.glb"]);
        fs::write(folder.path().join("XXH128SUMS"), list_text(&[("cloud.laz".into(), Checksum::of(b""))])).unwrap();
        let results = Results::new(folder.path());
        let terrain =
            ["terrain.glb", "tileset.json", "tiles/000000.glb", "levels/001/000256.glb", "tilesets/000000.json"];
        let others = [
            "cloud.laz",
            "XXH128SUMS",
            "terrain.tif",
            "tiles/256.glb",
            "tiles/000256.glb",
            "tiles/000000.json",
            "x/000000.glb",
        ];
        let holds = |results: &Results| {
            assert_eq!(are_results(results, &terrain), [true; 5]);
            assert_eq!(are_results(results, &others), [false; 7]);
        };
        holds(&results);
        assert!(results.contain("report.json"));
        fs::write(folder.path().join("report.json"), "{\"generator\": \"another program\"}").unwrap();
        holds(&results);
        assert!(!results.contain("report.json"));
        for name in ["report.json", "XXH128SUMS"] {
            fs::remove_file(folder.path().join(name)).unwrap();
            holds(&results);
        }
    }
}
