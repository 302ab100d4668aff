//! What a job is: whether an interrupted one may be gone on with, and from where.

use crate::job::options::JobOptions;
use crate::job::plan::lattice_choice::Coarser;
use crate::job::plan::scan;
use crate::output::options::ColorChoice;
use crate::{Error, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use xxhash_rust::xxh3::Xxh3;

/// The first line of a journal.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Head {
    /// What the job is.
    pub fingerprint: Fingerprint,
    /// How much coarser than at first its lattice is.
    pub coarser: Coarser,
}

/// Of what steps leave for later steps, and of which nodes merge: raised with every change, so that no run goes on from what means
/// something else to it.
pub(crate) const LAYOUT: u32 = 4;

/// What the results of a job depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Program, version, [`LAYOUT`] and byte order: the files in the job directory are no exchange format.
    program: String,
    /// The options that the mesh depends on, as the user knows them.
    mesh: Map<String, Value>,
    /// Those that only the look of the tiles depends on.
    look: Map<String, Value>,
    /// The inputs.
    files: Vec<Identity>,
    /// Bytes of memory, which decide how many levels there are, and nothing else.
    pub memory: u64,
}

/// By what a file is known again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Identity {
    /// As the report names it.
    path: PathBuf,
    bytes: u64,
    /// When it was written, in nanoseconds since 1970.
    modified: u64,
    /// The XXH3 of its beginning, its end and samples between them.
    samples: u64,
}

/// What is no longer as it was.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing that matters.
    Nothing,
    /// How tiles look: what is named in words.
    Look(String),
    /// The mesh: what is named in words.
    Mesh(String),
}

/// Options of `[triangulation]` that say how, not what.
const MEANS: [&str; 4] = ["backend", "voronoi", "adapter", "texture"];

impl Fingerprint {
    /// Of the job of `config`.
    ///
    /// # Errors
    /// [`Error::Config`] if there are no inputs, [`Error::Io`] if one cannot be read.
    pub fn of(config: &JobOptions) -> Result<Fingerprint> {
        let paths = scan::inputs(config)?;
        let order = if cfg!(target_endian = "little") { "little-endian" } else { "big-endian" };
        let mut mesh = options(&config.input, "input", &["files"])?;
        mesh.extend(options(&config.triangulation, "triangulation", &MEANS)?);
        // Whether the points' own colours are read at all.
        let own = matches!(config.output.color, ColorChoice::Auto | ColorChoice::Rgb);
        mesh.insert("[output] color".into(), own.into());
        Ok(Fingerprint {
            program: format!("gdt-batch {}, layout {LAYOUT}, {order}", env!("CARGO_PKG_VERSION")),
            mesh,
            look: options(&config.output, "output", &["directory"])?,
            memory: config.limits.memory.0,
            files: paths.par_iter().map(|path| Identity::of(path)).collect::<Result<_>>()?,
        })
    }

    /// What has changed since `earlier`.
    pub fn since(&self, earlier: &Fingerprint) -> Change {
        if self.program != earlier.program {
            return Change::Mesh(format!("the program ({}, now {})", earlier.program, self.program));
        }
        let mut mesh = changed_options(&earlier.mesh, &self.mesh);
        mesh.extend(changed_files(&earlier.files, &self.files));
        let look = changed_options(&earlier.look, &self.look);
        match (mesh.is_empty(), look.is_empty()) {
            (false, _) => Change::Mesh(in_words(mesh)),
            (true, false) => Change::Look(in_words(look)),
            (true, true) => Change::Nothing,
        }
    }
}

fn options(section: &impl Serialize, name: &str, without: &[&str]) -> Result<Map<String, Value>> {
    let Ok(Value::Object(options)) = serde_json::to_value(section) else {
        return Err(Error::Broken(format!("[{name}] cannot be written down")));
    };
    let wanted = options.into_iter().filter(|(key, _)| !without.contains(&key.as_str()));
    Ok(wanted.map(|(key, value)| (format!("[{name}] {key}"), value)).collect())
}

fn changed_options(earlier: &Map<String, Value>, now: &Map<String, Value>) -> Vec<String> {
    let differs = |key: &&String| earlier.get(*key) != now.get(*key);
    let gone = earlier.keys().filter(|key| !now.contains_key(*key));
    now.keys().filter(differs).chain(gone).cloned().collect()
}

fn changed_files(earlier: &[Identity], now: &[Identity]) -> Vec<String> {
    let by_path = |files: &'_ [Identity]| files.iter().map(|file| (file.path.clone(), file.clone())).collect();
    let (known, present): (HashMap<_, _>, HashMap<_, _>) = (by_path(earlier), by_path(now));
    let state = |file: &Identity| match known.get(&file.path) {
        Some(other) if other == file => None,
        Some(_) => Some(file.path.display().to_string()),
        None => Some(format!("{} (new)", file.path.display())),
    };
    let gone = earlier.iter().filter(|file| !present.contains_key(&file.path));
    let gone = gone.map(|file| format!("{} (gone)", file.path.display()));
    let changed: Vec<String> = now.iter().filter_map(state).chain(gone).collect();
    let reordered = changed.is_empty() && earlier != now;
    if reordered { vec!["the order of the inputs".into()] } else { changed }
}

/// The first few of `names`.
fn in_words(names: Vec<String>) -> String {
    const MOST: usize = 5;
    let more = names.len().saturating_sub(MOST);
    let named = names[..names.len() - more].join(", ");
    if more > 0 { format!("{named} and {more} more") } else { named }
}

/// Bytes read at the beginning and at the end of a file, and of every sample between them.
const ENDS: u64 = 64 << 10;
const SAMPLE: u64 = 4 << 10;
const SAMPLES: u64 = 16;

impl Identity {
    fn of(path: &Path) -> Result<Identity> {
        let file = File::open(path).map_err(Error::io("read", path))?;
        let data = file.metadata().map_err(Error::io("read", path))?;
        let modified = data.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
        Ok(Identity {
            path: path.to_path_buf(),
            bytes: data.len(),
            modified: modified.map_or(0, |age| age.as_nanos() as u64),
            samples: samples(&file, data.len()).map_err(Error::io("read", path))?,
        })
    }
}

fn samples(file: &File, bytes: u64) -> std::io::Result<u64> {
    let last = bytes.saturating_sub(ENDS);
    let between = (1..=SAMPLES).map(|i| (last / (SAMPLES + 1) * i, SAMPLE));
    let (mut hasher, mut buffer) = (Xxh3::new(), Vec::new());
    for (at, length) in [(0, ENDS), (last, ENDS)].into_iter().chain(between) {
        buffer.resize(length.min(bytes - at) as usize, 0);
        crate::positional_io::read_exact_at(file, &mut buffer, at)?;
        hasher.update(&buffer);
    }
    Ok(hasher.digest())
}
