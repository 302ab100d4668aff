//! What identifies a job: whether a run may go on from what an earlier one left.

use crate::options::JobOptions;
use crate::plan::breaklines::line_files::line_paths;
use crate::plan::clip::clip_path;
use crate::plan::input_identity::{InputChange, InputIdentities, RenamedInputs};
use crate::plan::inputs::input_paths;
use crate::plan::lattice_choice::LatticeCoarsening;
use crate::records::JobStep;
use crs::geoid::errors::not_opened;
use crs::geoid::option::HeightOffset;
use crs::geoid::require_file;
use orthophoto::require_file as require_picture;
use points::is_url;
use points::lines::files_of_lines;
use points::samples::fingerprint_of;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use sys::{Error, Result};
use tiles::checksums::Checksum;
use tiles::options::OutputOptions;

/// The first line of a job's journal.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JobHeader {
    /// What identifies the job.
    pub fingerprint: Fingerprint,
    /// How much coarser than the inputs ask for the lattice is.
    pub coarsening: LatticeCoarsening,
    /// Tells the folders of this job's parts from those of others.
    #[serde(default)]
    pub id: u64,
    /// The submission that started it over; 0 if none did.
    #[serde(default)]
    pub submission: u64,
    /// When the job was begun: before tasks looked at its inputs.
    #[serde(default)]
    pub begun: Option<SystemTime>,
}

impl JobHeader {
    /// Returns how the input that had the path `known` differs from what it was when tasks planned the job. It is at `path` now.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read.
    pub(crate) fn change_of(&self, known: &Path, path: &Path) -> Result<InputChange> {
        self.fingerprint.files.change_of(known, path, self.begun.unwrap_or_else(SystemTime::now))
    }
}

/// What tells a job from others in its report.
#[derive(Clone, Debug, Default)]
pub struct JobIdentity {
    /// Tells the options, as far as results depend on them, from others.
    pub options: Checksum,
    /// Tells the options and the inputs from others.
    pub job: Checksum,
    /// Tells what the inputs hold from what others do.
    pub inputs: String,
    /// The submission that started it over; 0 if none did.
    pub submission: u64,
}

/// Version of the records in the store, of the plan, of the names and bytes of results, and of which nodes merge. It changes with every
/// change of these, so that no run misreads what another version left, or mixes its results with them.
pub(crate) const LAYOUT: u32 = 48;

/// What the results of a job depend on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Program, version, [`LAYOUT`] and byte order: the files in the job directory are not for exchange.
    program: String,
    /// The options that the mesh depends on, as the user knows them.
    mesh: Map<String, Value>,
    /// The options that only the style of the tiles depends on.
    style: Map<String, Value>,
    /// The inputs.
    files: InputIdentities,
    /// The files of lines and the one of the clip, with those that belong to them.
    #[serde(default)]
    lines: InputIdentities,
    /// The memory limit in bytes. Only the number of levels depends on it.
    pub memory: u64,
}

/// The names of options among those of the style that no tile depends on: what they ask for is made from the finished tiles, each by a step
/// of its own.
const FROM_TILES: [(&str, &[JobStep]); 5] = [
    // Map tiles are made from the raster.
    ("[output] raster", &[JobStep::Raster, JobStep::MapTiles]),
    (MAP_TILES, &[JobStep::MapTiles]),
    ("[output] contours", &[JobStep::Contours]),
    ("[output] export", &[JobStep::Exports]),
    ("[output] terrain", &[JobStep::Terrain]),
];

/// The name of the option for map tiles, which stands in a table of its own: the raster stays when it changes.
const MAP_TILES: &str = "[output.raster] pmtiles";

/// Returns the steps that make what an option asks for from the finished tiles, if it is one of these.
fn steps_of(option: &str) -> Option<&'static [JobStep]> {
    FROM_TILES.iter().find(|(name, _)| *name == option).map(|(_, steps)| *steps)
}

/// The name of the option by which a job keeps what an update needs.
const UPDATES: &str = "--update";

/// What to do about a job that is no longer what tasks planned.
pub(crate) const PLAN_AGAIN: &str = "run the phase plan again, or let gdt-batch submit do it";

/// How a job differs from an earlier one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JobChange {
    /// In nothing that matters.
    Nothing,
    /// In files alone that are made from the finished tiles, such as the raster.
    FromTiles {
        /// Says in what.
        what: String,
        /// The steps that make the files that are others.
        steps: Vec<JobStep>,
    },
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
        let files = InputIdentities::of(&input_paths(&options.input)?)?;
        let of_lines = line_paths(&options.breaklines)?.into_iter().map(|(_, path)| path);
        let of_clip = clip_path(&options.input)?.map(Path::to_path_buf);
        let lines: Vec<PathBuf> = of_lines.chain(of_clip).flat_map(|path| files_of_lines(&path)).collect();
        Fingerprint::of_files(options, files, InputIdentities::of(&lines)?)
    }

    fn of_files(options: &JobOptions, files: InputIdentities, lines: InputIdentities) -> Result<Fingerprint> {
        let order = if cfg!(target_endian = "little") { "little-endian" } else { "big-endian" };
        let mut mesh = named_values(&options.input, "input", &["files", "clip"])?;
        mesh.insert("[input] clip".into(), options.input.clip.is_some().into());
        mesh.extend(named_values(&options.triangulation, "triangulation", &["backend"])?);
        for (number, lines) in (1..).zip(&options.breaklines) {
            mesh.extend(named_values(lines, &format!("breaklines {number}"), &["files"])?);
        }
        if options.updates {
            // A run without the option must not continue the journals of one with it, and the other way round.
            mesh.insert(UPDATES.into(), true.into());
        }
        // The points' own colours are read only if they are wanted.
        mesh.insert("[output] color".into(), options.output.color.may_be_own().into());
        mesh.insert("[output] max_error".into(), toml::Value::from(options.output.max_error).to_string().into());
        // So are intensities. Classes are always read.
        mesh.insert("[output] attributes".into(), options.output.attributes.intensity.into());
        Ok(Fingerprint {
            program: format!("gdt-batch {}, layout {LAYOUT}, {order}", env!("CARGO_PKG_VERSION")),
            mesh,
            style: style_of(&options.output)?,
            memory: options.limits.memory.0,
            files,
            lines,
        })
    }

    /// Returns what has changed in the program and the options since this fingerprint was made. It looks at no input.
    ///
    /// # Errors
    /// [`Error::Broken`] if the options cannot be written down.
    pub(crate) fn changed_options(&self, options: &JobOptions) -> Result<Option<String>> {
        let now = Fingerprint::of_files(options, InputIdentities::default(), InputIdentities::default())?;
        let (files, lines) = (InputIdentities::default(), InputIdentities::default());
        let same_files = Fingerprint { files, lines, ..self.clone() };
        Ok(now.since_planned(&same_files))
    }

    /// Tells whether a job that was planned is the same, and no input seems to have been modified since.
    pub(crate) fn is_same_job(&self, planned: &JobHeader) -> bool {
        self.since_planned(&planned.fingerprint).is_none() && self.modified_since(planned).is_none()
    }

    /// Returns the paths of the inputs that seem to have been modified since a job was planned. All else about them must be as it was.
    pub(crate) fn modified_since(&self, JobHeader { fingerprint: planned, begun, .. }: &JobHeader) -> Option<String> {
        let begun = (*begun)?;
        let [files, lines] = [(&self.files, &planned.files), (&self.lines, &planned.lines)]
            .map(|(now, then)| now.modified_since(then, begun));
        let paths = [files, lines].concat();
        (!paths.is_empty()).then(|| first_few(paths))
    }

    /// Returns the paths of the inputs whose times are others than when a job was planned. All else about them must be as it was.
    pub(crate) fn with_other_times(&self, planned: &Fingerprint) -> Option<String> {
        let paths = [self.files.with_other_times(&planned.files), self.lines.with_other_times(&planned.lines)].concat();
        (!paths.is_empty()).then(|| first_few(paths))
    }

    /// Returns what has changed since a job was planned with the fingerprint `planned`, besides the times of files: machines may see
    /// different ones.
    pub(crate) fn since_planned(&self, planned: &Fingerprint) -> Option<String> {
        let without_times = |this: &Fingerprint| {
            let (files, lines) = (this.files.without_times(), this.lines.without_times());
            Fingerprint { files, lines, ..this.clone() }
        };
        match without_times(self).since(&without_times(planned)) {
            JobChange::Nothing if self.memory == planned.memory => None,
            JobChange::Nothing => Some("[limits] memory".into()),
            JobChange::FromTiles { what, .. } | JobChange::Style(what) | JobChange::Mesh(what) => Some(what),
        }
    }

    /// Returns the present names of the inputs at `paths`, which are those that the options name now; `None` if they are other files.
    pub(crate) fn present_names(&self, paths: &[PathBuf]) -> Option<RenamedInputs> {
        self.files.present_names(paths)
    }

    /// Returns what tells options from others that lead to other bytes. It looks at no input, and not at paths.
    ///
    /// # Errors
    /// [`Error::Broken`] if the options cannot be written down.
    pub(crate) fn of_options(options: &JobOptions) -> Result<Checksum> {
        let Fingerprint { program, mesh, style, memory, .. } =
            Fingerprint::of_files(options, InputIdentities::default(), InputIdentities::default())?;
        let [mesh, style] = [&mesh, &style].map(|values| values.iter().collect::<BTreeMap<_, _>>());
        let text = serde_json::to_vec(&(program, mesh, style, memory));
        Ok(Checksum::of(&text.map_err(|e| Error::Broken(format!("the options: {e}")))?))
    }

    /// Returns what tells a job from others that lead to other bytes. `options` is what [`Fingerprint::of_options`] says of its options.
    pub(crate) fn of_job(&self, options: Checksum) -> Checksum {
        Checksum::of(format!("{options} {}{}", self.files.text(), self.lines.text()).as_bytes())
    }

    /// Returns what tells the job with these `options` from others.
    ///
    /// # Errors
    /// As [`Fingerprint::of_options`].
    pub(crate) fn identity(&self, options: &JobOptions, submission: u64) -> Result<JobIdentity> {
        let options = Fingerprint::of_options(options)?;
        Ok(JobIdentity { options, job: self.of_job(options), inputs: self.of_inputs(), submission })
    }

    /// Returns what tells the content of the inputs from that of others, whatever their names.
    pub fn of_inputs(&self) -> String {
        fingerprint_of(self.files.samples())
    }

    /// Returns what tells the content of the input at `path` from others.
    pub(crate) fn content_of(&self, path: &Path) -> Option<[u64; 3]> {
        self.files.content_of(path)
    }

    /// Tells whether the job keeps what an update needs.
    pub(crate) fn updates(&self) -> bool {
        self.mesh.contains_key(UPDATES)
    }

    /// Tells whether an update leads from `earlier` to this: nothing has changed that the mesh depends on but the inputs.
    pub(crate) fn may_update(&self, earlier: &Fingerprint) -> bool {
        !matches!(self.with_files_of(earlier).since(earlier), JobChange::Mesh(_))
    }

    /// Returns what has changed since `earlier` that tiles depend on besides their mesh.
    pub(crate) fn style_since(&self, earlier: &Fingerprint) -> Option<String> {
        match self.with_files_of(earlier).since(earlier) {
            JobChange::Style(what) => Some(what),
            _ => None,
        }
    }

    /// Returns the names of the inputs that are other than those of `earlier`.
    pub(crate) fn inputs_since(&self, earlier: &Fingerprint) -> Vec<String> {
        self.files.since(&earlier.files)
    }

    /// Returns this fingerprint with the inputs of `earlier`.
    fn with_files_of(&self, earlier: &Fingerprint) -> Fingerprint {
        Fingerprint { files: earlier.files.clone(), ..self.clone() }
    }

    /// Returns what has changed since `earlier`.
    pub fn since(&self, earlier: &Fingerprint) -> JobChange {
        if self.program != earlier.program {
            return JobChange::Mesh(format!("the program ({}, now {})", earlier.program, self.program));
        }
        let mut mesh = changed_values(&earlier.mesh, &self.mesh);
        mesh.extend(self.files.since(&earlier.files));
        mesh.extend(self.lines.since(&earlier.lines));
        let style = changed_values(&earlier.style, &self.style);
        match (mesh.is_empty(), style.is_empty()) {
            (false, _) => JobChange::Mesh(first_few(mesh)),
            (true, false) if style.iter().all(|name| steps_of(name).is_some()) => {
                let steps = style.iter().filter_map(|name| steps_of(name)).flatten().copied().collect();
                JobChange::FromTiles { what: first_few(style), steps }
            }
            (true, false) => JobChange::Style(first_few(style)),
            (true, true) => JobChange::Nothing,
        }
    }

    /// Returns what the inputs are called by now, where nothing else about them has changed since `earlier`.
    pub(crate) fn renamed_inputs(&self, earlier: &Fingerprint) -> RenamedInputs {
        self.files.renamed_since(&earlier.files).and(self.lines.renamed_since(&earlier.lines))
    }

    /// Returns this fingerprint with the inputs called as in `earlier`: what an earlier run wrote calls them so.
    pub(crate) fn with_names_of(&self, earlier: &Fingerprint) -> Fingerprint {
        Fingerprint { files: earlier.files.clone(), lines: earlier.lines.clone(), ..self.clone() }
    }
}

/// Returns the options that only the style of the tiles depends on. A geoid grid and an orthophoto count by their content: they may lie
/// elsewhere now.
fn style_of(output: &OutputOptions) -> Result<Map<String, Value>> {
    let mut style = named_values(output, "output", &["directory", "max_error"])?;
    let raster = style.get_mut("[output] raster").and_then(Value::as_object_mut);
    if let Some(encoding) = raster.and_then(|raster| raster.remove("pmtiles")) {
        style.insert(MAP_TILES.into(), encoding);
    }
    if let Some(grid) = output.height_offset.as_ref().and_then(HeightOffset::grid) {
        require_file(grid)?;
        let content = Checksum::of_file(grid).map_err(|e| not_opened(grid, e))?.1;
        style.insert("[output] height_offset".into(), format!("a grid with the checksum {content}").into());
    }
    if let Some(photo) = output.color.photo() {
        require_photo(photo)?;
        let content = fingerprint_of(InputIdentities::of(&[photo.to_path_buf()])?.samples());
        style.insert("[output] color".into(), format!("an orthophoto with the samples {content}").into());
    }
    Ok(style)
}

/// Checks that there is an orthophoto at `path`, if that is on this machine. A server tells when it is asked.
///
/// # Errors
/// As [`require_picture`].
pub(crate) fn require_photo(path: &Path) -> Result<()> {
    if path.to_str().is_some_and(is_url) { Ok(()) } else { require_picture(path) }
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

/// Returns the first few of `names` as a text.
pub(crate) fn first_few(names: Vec<String>) -> String {
    const MAX_NAMES: usize = 5;
    let more = names.len().saturating_sub(MAX_NAMES);
    let named = names[..names.len() - more].join(", ");
    if more > 0 { format!("{named} and {more} more") } else { named }
}
