//! The input files: which ones the options name, and what their headers say.

use crate::plan::folder_files::{FolderClouds, FolderFiles};
use crate::plan::input_identity::place;
use crate::plan::job_plan::SkippedInput;
use crate::plan::named_files::files_or_folders_of;
use points::options::{InputOptions, OnBadFile};
use points::{FileFormat, RowChoice, Source, is_url, open_chosen, remote_files};
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::PathBuf;
use sys::{Error, Result};

/// What messages call the option.
const FILES: &str = "[input] files";

/// The files that the options name.
#[derive(Debug, Default)]
pub struct NamedInputs {
    /// In their order, each once: two paths that lead to the same file count as one.
    pub paths: Vec<PathBuf>,
    /// What the user should know about files of folders that were left out.
    pub notes: Vec<String>,
}

/// Returns the files that the options name. An entry that is a folder stands for the point clouds in it.
///
/// # Errors
/// [`Error::Config`] if an entry names none, [`Error::Io`] if a folder cannot be read.
pub fn named_inputs(options: &InputOptions) -> Result<NamedInputs> {
    let (mut named, mut known) = (NamedInputs::default(), HashSet::new());
    for entry in &options.files {
        let FolderClouds { clouds, notes } = files_of_entry(entry, options)?;
        if clouds.is_empty() {
            return Err(Error::Config(format!("{FILES}: there is no file {entry}{}", hint_of_escape(entry))));
        }
        // Paths with a double slash are one path, and URLs are two.
        named.paths.extend(clouds.into_iter().filter(|path| known.insert(place(path).into_os_string())));
        named.notes.extend(notes);
    }
    Ok(named)
}

/// Returns the paths of [`named_inputs`].
///
/// # Errors
/// As [`named_inputs`].
pub fn input_paths(options: &InputOptions) -> Result<Vec<PathBuf>> {
    named_inputs(options).map(|named| named.paths)
}

fn files_of_entry(entry: &str, options: &InputOptions) -> Result<FolderClouds> {
    if is_url(entry) {
        return Ok(FolderClouds { clouds: remote_files(entry)?, notes: Vec::new() });
    }
    let (files, folders) = files_or_folders_of(entry, FILES)?;
    let mut found = FolderClouds { clouds: files, notes: Vec::new() };
    for folder in folders {
        let of_folder = FolderFiles::of(&folder).and_then(|files| files.clouds(&options.csv)).map_err(of_option)?;
        found.clouds.extend(of_folder.clouds);
        found.notes.extend(of_folder.notes);
    }
    Ok(found)
}

/// Returns what to do if a path has a character that TOML has made of a backslash and a letter, as of `"C:\temp"`.
fn hint_of_escape(entry: &str) -> &'static str {
    match entry.contains(['\t', '\n', '\r', '\u{8}', '\u{c}', '\u{1b}']) {
        true => ": a backslash has a meaning of its own in double quotes; write slashes, or single quotes",
        false => "",
    }
}

/// Returns the error with the option that it is about.
fn of_option(error: Error) -> Error {
    match error {
        Error::Config(what) => Error::Config(format!("{FILES}: {what}")),
        error => error,
    }
}

/// Opens the inputs at `paths`, for the rows of `choice` in texts. Where bad files are to be left out, returns them apart.
///
/// # Errors
/// [`Error::Input`] if a file is bad and must not be left out, [`Error::Io`] if one cannot be read.
pub fn open_all(
    paths: &[PathBuf],
    options: &InputOptions,
    choice: &RowChoice,
) -> Result<(Vec<Source>, Vec<SkippedInput>)> {
    let opened: Vec<Result<Source>> = paths.par_iter().map(|path| open_chosen(path, &options.csv, choice)).collect();
    let (mut sources, mut skipped) = (Vec::with_capacity(opened.len()), Vec::new());
    for source in opened {
        match source {
            Err(Error::Input { path, what }) if options.on_bad_file == OnBadFile::Skip => {
                skipped.push(SkippedInput { file: path, why: what });
            }
            // A file that the system cannot read may be sound: the program must not decide to leave it out.
            source => sources.push(source?),
        }
    }
    Ok((sources, skipped))
}

/// Checks that the files hold enough of the records that they promise: all files together, or each by itself where bad files are
/// to be left out.
///
/// # Errors
/// [`Error::Input`] names the first file that holds too few.
pub fn check_missing_records(sources: &[Source], options: &InputOptions) -> Result<()> {
    let records = sources.iter().map(|source| source.records).sum();
    let is_too_much = |missing: u64, records: u64| missing as f64 > options.max_malformed_fraction.0 * records as f64;
    let lacking = match options.on_bad_file {
        OnBadFile::Skip => sources.iter().find(|s| is_too_much(s.missing, s.records)),
        OnBadFile::Stop if is_too_much(sources.iter().map(|s| s.missing).sum(), records) => {
            sources.iter().find(|s| s.missing > 0)
        }
        OnBadFile::Stop => None,
    };
    match lacking {
        Some(first) => Err(Error::input(&first.path, missing_records(first))),
        None => Ok(()),
    }
}

fn missing_records(Source { records, missing, format, .. }: &Source) -> String {
    let start = format!("says that it holds {records} records, but");
    if missing < records {
        return format!(
            "{start} {missing} of them are not there: the file is cut off or its header is wrong. Copy it again, or raise [input] \
             max_malformed_fraction to use what is there"
        );
    }
    let why = match format {
        FileFormat::Laz => {
            "the file is cut off before the end of its first compressed chunk, which cannot be read in part"
        }
        _ => "the file is cut off after its header, or its header is wrong",
    };
    format!("{start} none of them is there: {why}. Copy it again, or leave it out with [input] on_bad_file = \"skip\"")
}
