//! What identifies a job: whether a run may go on from what an earlier one left.

use crate::input::samples::{FileSamples, fingerprint_of};
use crate::job::options::JobOptions;
use crate::job::plan::inputs::input_paths;
use crate::job::plan::lattice_choice::LatticeCoarsening;
use crate::output::options::ColorChoice;
use crate::{Error, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The first line of a job's journal.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JobHeader {
    /// What identifies the job.
    pub fingerprint: Fingerprint,
    /// How much coarser than the inputs ask for the lattice is.
    pub coarsening: LatticeCoarsening,
}

/// Version of the records in the store, of the plan, and of which nodes merge. It changes with every change of these, so that no
/// run misreads what another version left.
pub(crate) const LAYOUT: u32 = 6;

/// What the results of a job depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Program, version, [`LAYOUT`] and byte order: the files in the job directory are not for exchange.
    program: String,
    /// The options that the mesh depends on, as the user knows them.
    mesh: Map<String, Value>,
    /// The options that only the style of the tiles depends on.
    style: Map<String, Value>,
    /// The inputs.
    files: Vec<InputIdentity>,
    /// The memory limit in bytes. Only the number of levels depends on it.
    pub memory: u64,
}

/// What identifies an input file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct InputIdentity {
    /// As the report names it.
    path: PathBuf,
    /// When it was written, in nanoseconds since 1970.
    modified: u64,
    #[serde(flatten)]
    content: FileSamples,
}

/// How a job differs from an earlier one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JobChange {
    /// In nothing that matters.
    Nothing,
    /// In the style of its tiles: the text says in what.
    Style(String),
    /// In its mesh: the text says in what.
    Mesh(String),
}

impl Fingerprint {
    /// Returns the fingerprint of the job with these options.
    ///
    /// # Errors
    /// [`Error::Config`] if there are no inputs, [`Error::Io`] if one cannot be read.
    pub fn of(options: &JobOptions) -> Result<Fingerprint> {
        let paths = input_paths(&options.input)?;
        let order = if cfg!(target_endian = "little") { "little-endian" } else { "big-endian" };
        let mut mesh = named_values(&options.input, "input", &["files"])?;
        mesh.extend(named_values(&options.triangulation, "triangulation", &["backend"])?);
        // The points' own colours are read only if they are wanted.
        let own = matches!(options.output.color, ColorChoice::Auto | ColorChoice::Rgb);
        mesh.insert("[output] color".into(), own.into());
        Ok(Fingerprint {
            program: format!("gdt-batch {}, layout {LAYOUT}, {order}", env!("CARGO_PKG_VERSION")),
            mesh,
            style: named_values(&options.output, "output", &["directory"])?,
            memory: options.limits.memory.0,
            files: paths.par_iter().map(|path| InputIdentity::of(path)).collect::<Result<_>>()?,
        })
    }

    /// Returns what tells the content of the inputs from that of others, whatever their names.
    pub fn of_inputs(&self) -> String {
        fingerprint_of(self.files.iter().map(|file| file.content).collect())
    }

    /// Returns what has changed since `earlier`.
    pub fn since(&self, earlier: &Fingerprint) -> JobChange {
        if self.program != earlier.program {
            return JobChange::Mesh(format!("the program ({}, now {})", earlier.program, self.program));
        }
        let mut mesh = changed_values(&earlier.mesh, &self.mesh);
        mesh.extend(changed_files(&earlier.files, &self.files));
        let style = changed_values(&earlier.style, &self.style);
        match (mesh.is_empty(), style.is_empty()) {
            (false, _) => JobChange::Mesh(first_few(mesh)),
            (true, false) => JobChange::Style(first_few(style)),
            (true, true) => JobChange::Nothing,
        }
    }
}

/// Returns the options of a table by the names that the user knows.
fn named_values(table: &impl Serialize, name: &str, without: &[&str]) -> Result<Map<String, Value>> {
    let Ok(Value::Object(values)) = serde_json::to_value(table) else {
        return Err(Error::Broken(format!("[{name}] cannot be written down")));
    };
    let wanted = values.into_iter().filter(|(key, _)| !without.contains(&key.as_str()));
    Ok(wanted.map(|(key, value)| (format!("[{name}] {key}"), value)).collect())
}

fn changed_values(earlier: &Map<String, Value>, now: &Map<String, Value>) -> Vec<String> {
    let differs = |key: &&String| earlier.get(*key) != now.get(*key);
    let gone = earlier.keys().filter(|key| !now.contains_key(*key));
    now.keys().filter(differs).chain(gone).cloned().collect()
}

fn changed_files(earlier: &[InputIdentity], now: &[InputIdentity]) -> Vec<String> {
    let by_path = |files: &'_ [InputIdentity]| files.iter().map(|file| (file.path.clone(), file.clone())).collect();
    let (known, present): (HashMap<_, _>, HashMap<_, _>) = (by_path(earlier), by_path(now));
    let change = |file: &InputIdentity| match known.get(&file.path) {
        Some(other) if other == file => None,
        Some(_) => Some(file.path.display().to_string()),
        None => Some(format!("{} (new)", file.path.display())),
    };
    let gone = earlier.iter().filter(|file| !present.contains_key(&file.path));
    let gone = gone.map(|file| format!("{} (gone)", file.path.display()));
    let changed: Vec<String> = now.iter().filter_map(change).chain(gone).collect();
    let reordered = changed.is_empty() && earlier != now;
    if reordered { vec!["the order of the inputs".into()] } else { changed }
}

/// Returns the first few of `names` as a text.
fn first_few(names: Vec<String>) -> String {
    const MAX_NAMES: usize = 5;
    let more = names.len().saturating_sub(MAX_NAMES);
    let named = names[..names.len() - more].join(", ");
    if more > 0 { format!("{named} and {more} more") } else { named }
}

impl InputIdentity {
    fn of(path: &Path) -> Result<InputIdentity> {
        let data = path.metadata().map_err(Error::io("read", path))?;
        let modified = data.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
        Ok(InputIdentity {
            path: path.to_path_buf(),
            modified: modified.map_or(0, |age| age.as_nanos() as u64),
            content: FileSamples::of(path)?,
        })
    }
}
