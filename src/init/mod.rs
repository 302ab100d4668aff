//! `gdt-batch init`: a configuration for point clouds that runs as it is, or says what the user has to decide, with what was found in
//! comments.
//!
//! The clouds are looked at as `check` does. If a job of them would be refused, `required_options.rs` tries what the message of the refusal names.

mod bad_files;
mod clouds;
mod config_file;
mod config_folder;
mod configuration;
mod draft;
mod findings;
mod offered_options;
mod page;
mod refusals;
mod required_options;
mod suspect_heights;
mod systems;
mod triangle;

use crate::config;
use crate::init::clouds::NamedClouds;
use crate::init::config_file::{check_is_no_cloud, check_may_be_written, write};
use crate::init::config_folder::ConfigFolder;
use crate::init::configuration::{choice_of, summary_of, text_of, units_of};
use crate::init::draft::options_of;
use crate::init::page::escape_controls;
use crate::init::refusals::with_way_out;
use crate::shell_word::quoted;
use job::durable::directory::JobDirectory;
use job::durable::obstacles::{check_nothing_in_the_way, check_results_are_ours};
use job::plan::inputs::input_paths;
use job::preflight::check::Preflight;
use job::progress::number_text::{grouped, mebibytes};
use job::{Error, Result};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use sys::ShownWarning;
use sys::terminal::is_obeyed;

pub(crate) use crate::init::config_file::is_configuration;
pub(crate) use crate::init::draft::Draft;
pub use crate::init::draft::NeededLine;
pub(crate) use crate::init::refusals::with_more;
pub(crate) use crate::init::required_options::runnable;

#[cfg(test)]
mod tests;

/// What stands for standard output.
const STANDARD_OUTPUT: &str = "-";

/// The first name of the output directory, and how many others are tried if something is in its way.
const DIRECTORY: &str = "out";
const MOST_DIRECTORIES: usize = 100;

/// The most bytes of a configuration's name that its output directory has in its own: no system takes more than 255, and others follow.
const LONGEST_STEM: usize = 100;

/// A configuration that was made.
#[derive(Debug, Serialize)]
pub struct NewConfiguration {
    /// Its file; `None` if it is for standard output.
    #[serde(serialize_with = "sys::path_text::shown_if_any")]
    pub file: Option<PathBuf>,
    /// The lines that the clouds need, or the machine.
    pub needed: Vec<NeededLine>,
    /// The lines without which the job stops, and on which the user decides: they are comments.
    pub choices: Vec<NeededLine>,
    /// About files that are left out.
    pub notes: Vec<String>,
    /// The units of coordinates.
    pub unit: String,
    /// What `check` says of the job.
    pub check: Preflight,
    /// Its text.
    #[serde(skip)]
    pub text: String,
    /// Why the job stops as it is: the user has to decide, or this machine has no room for it.
    #[serde(skip)]
    pub obstacle: Option<Error>,
}

/// What a configuration is to be made for.
#[derive(Debug, Default)]
pub struct ConfigRequest {
    /// Point clouds: files, folders, patterns or URLs. Without any, those of the current folder are meant.
    pub clouds: Vec<PathBuf>,
    /// The lines that the user has chosen.
    pub lines: Vec<NeededLine>,
    /// The output directory. Without one, a free one beside the configuration is taken.
    pub directory: Option<PathBuf>,
    /// The file whose polygons points are kept in.
    pub clip: Option<PathBuf>,
    /// Whether a bad file stops the job until the user has decided. Otherwise the configuration leaves it out, and says so.
    pub stops_at_bad_files: bool,
}

impl ConfigRequest {
    /// Returns the draft of a configuration at `file`, or of one without a file, and what to know about files that are left out.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if there are no clouds, or if no configuration can name one of them, or the output directory.
    pub(crate) fn draft(&self, file: Option<&Path>) -> Result<(Draft, Vec<String>)> {
        let folder = ConfigFolder::of(file)?;
        let NamedClouds { patterns, notes } =
            NamedClouds::of(&self.clouds, &folder).map_err(|error| with_way_out(error.into()))?;
        let directory = match &self.directory {
            Some(directory) => folder.directory(directory)?,
            None => free_directory(&folder.path, file)?,
        };
        config::check_directory(&directory, &folder.path)?;
        let clip = self.clip.as_ref().map(|clip| folder.file(clip)).transpose()?;
        let clip = clip.map(|clip| NeededLine::chosen("input", "clip", &clip.into()));
        let chosen = self.lines.iter().cloned().chain(clip).collect();
        let draft = Draft::new(patterns, directory, &folder);
        Ok((Draft { chosen, stops_at_bad_files: self.stops_at_bad_files, ..draft }, notes))
    }
}

/// Makes the configuration for `request`, and writes it to `file`, unless that is `-`.
///
/// # Errors
/// [`sys::Error::Config`] if the file is there and may not be replaced, or there are no clouds; that of `check` if no configuration makes a
/// job of them; [`sys::Error::Io`] if it cannot be written. A file is replaced only if it is a configuration.
pub fn init(request: &ConfigRequest, file: &Path, replace: bool) -> Result<NewConfiguration> {
    let file = Some(file).filter(|file| *file != Path::new(STANDARD_OUTPUT));
    if let Some(file) = file {
        check_may_be_written(file, replace)?;
    }
    let (draft, notes) = request.draft(file)?;
    refuse_queries(&draft.files)?;
    if let Some(file) = file.filter(|file| file.exists()) {
        check_is_no_cloud(file, &input_paths(&draft.options()?.input)?)?;
    }
    let found = runnable(draft).map_err(with_way_out)?;
    let text = text_of(&found, file.map(as_argument).as_deref(), &notes);
    options_of(&text, &found.draft.folder)?;
    if let Some(file) = file {
        write(file, &text, replace)?;
    }
    Ok(NewConfiguration {
        file: file.map(Path::to_path_buf),
        needed: found.draft.needed,
        choices: found.draft.choices,
        notes,
        unit: units_of(&found.preflight, &found.plan),
        check: found.preflight,
        text,
        obstacle: found.stop.or(found.obstacle),
    })
}

/// Refuses to write down the query of a URL, which may be a secret.
fn refuse_queries(files: &[String]) -> sys::Result<()> {
    let place = |file: &String| file.split_once('?').map(|(place, _)| place.to_string());
    match files.iter().filter(|file| points::is_url(file)).find_map(place) {
        Some(place) => Err(sys::Error::Config(format!(
            "{place}?...: the query of this URL may be a secret, so it is not written to a file: write the URL into [input] files yourself"
        ))),
        None => Ok(()),
    }
}

/// Returns an output directory in which nothing is in the way of a job, except the results of an earlier one. A configuration that is not
/// called job.toml has one of its own, so that two of them can stand in one folder.
fn free_directory(folder: &Path, file: Option<&Path>) -> sys::Result<String> {
    let stem = file.and_then(Path::file_stem).and_then(|stem| stem.to_str()).map_or("job".into(), plain);
    let first = if stem == "job" { DIRECTORY.to_string() } else { format!("{DIRECTORY}-{stem}") };
    let is_free = |name: &String| {
        let directory = JobDirectory::new(&folder.join(name));
        check_nothing_in_the_way(&directory).and_then(|()| check_results_are_ours(&directory, true))
    };
    let names = (2..=MOST_DIRECTORIES).map(|number| format!("{first}-{number}"));
    let free = std::iter::once(first.clone()).chain(names).find(|name| is_free(name).is_ok());
    match free {
        Some(name) => Ok(name),
        None => is_free(&first).map(|()| first),
    }
}

/// Returns the beginning of a name without signs that mean something in a configuration, in a shell or to a system.
pub(crate) fn plain(name: &str) -> String {
    // Accents may be signs of their own.
    let is_plain = |sign: char| match sign.is_ascii() {
        true => sign.is_alphanumeric() || "-_.+=, ".contains(sign),
        false => !is_obeyed(sign),
    };
    let signs = name.char_indices().take_while(|(at, sign)| at + sign.len_utf8() <= LONGEST_STEM);
    let name: String = signs.map(|(_, sign)| if is_plain(sign) { sign } else { '_' }).collect();
    name.trim_end_matches([' ', '.']).into()
}

/// Returns a file as an argument of a command that a shell reads.
pub fn as_argument(file: &Path) -> String {
    let name = file.display().to_string();
    quoted(&if name.starts_with('-') { format!("./{name}") } else { name })
}

impl fmt::Display for NewConfiguration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Preflight { files, records, crs, surface, memory, disk, warnings, .. } = &self.check;
        let mut row = |name: &str, value: String| writeln!(f, "{name:<9} {}", escape_controls(&value));
        row("files", format!("{} with {} points", grouped(files.len() as u64), grouped(*records)))?;
        row("unit", self.unit.clone())?;
        row("crs", crs.clone().unwrap_or_else(|| "none".into()))?;
        if let Some(surface) = surface {
            row("surface", surface.clone())?;
        }
        row("takes", format!("about {} of memory, {} of disk", mebibytes(*memory), mebibytes(*disk)))?;
        self.needed.iter().try_for_each(|line| row("set", summary_of(line)))?;
        self.choices.iter().try_for_each(|line| row("decide", choice_of(line)))?;
        self.notes.iter().try_for_each(|note| row("note", note.clone()))?;
        for warning in warnings.iter() {
            writeln!(f, "{}", ShownWarning(warning))?;
        }
        match &self.file {
            Some(file) => {
                let name = file.display().to_string();
                writeln!(
                    f,
                    "written to {}; run it: gdt-batch {}",
                    escape_controls(&name),
                    escape_controls(&as_argument(file))
                )
            }
            None => Ok(()),
        }
    }
}
