//! The input files: which ones the options name, and what their headers say.

use crate::plan::folder_files::{FolderClouds, FolderFiles};
use crate::plan::input_identity::place;
use crate::plan::job_plan::SkippedInput;
use crate::plan::listed_inputs::{ListedAreas, ListedInputs};
use crate::plan::named_files::files_or_folders_of;
use points::options::{InputOptions, OnBadFile};
use points::{FileFormat, RowChoice, Source, is_url, listed_clouds, open_chosen, remote_files};
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::ErrorKind;
use std::path::PathBuf;
use sys::{Error, Result};

/// What messages call the option.
const FILES: &str = "[input] files";

/// The files that the options name.
#[derive(Debug, Default)]
pub struct NamedInputs {
    /// In their order, each once: two paths that lead to the same file count as one.
    pub paths: Vec<PathBuf>,
    /// What the user should know about files of folders and of lists that were left out.
    pub notes: Vec<String>,
    /// Files of lists that are not there, where bad files are to be left out.
    pub skipped: Vec<SkippedInput>,
}

/// Returns the files that the options name. An entry that is a folder stands for the point clouds in it, and one that is a list for those that
/// it names, without those that lie elsewhere by the list.
///
/// # Errors
/// [`Error::Config`] if an entry names none, [`Error::Input`] if a list is bad, [`Error::Io`] if a folder or a list cannot be read.
pub fn named_inputs(options: &InputOptions) -> Result<NamedInputs> {
    let (mut found, mut notes, mut lists) = (Vec::new(), Vec::new(), Vec::new());
    for entry in &options.files {
        let entry_has = files_of_entry(entry, options)?;
        if entry_has.clouds.is_empty() {
            return Err(Error::Config(format!("{FILES}: there is no file {entry}{}", what_to_do_about(entry))));
        }
        notes.extend(entry_has.notes);
        for path in entry_has.clouds {
            match listed_clouds(&path).map_err(of_option)? {
                None => found.push(Named::Cloud(path)),
                Some(clouds) => {
                    found.push(Named::List(lists.len()));
                    lists.push(ListedInputs { list: path, clouds });
                }
            }
        }
    }
    let (areas, mut known) = (ListedAreas::of(options, &lists), HashSet::new());
    let mut named = NamedInputs { paths: Vec::new(), notes, skipped: Vec::new() };
    for found in found {
        let paths = match found {
            Named::Cloud(path) => vec![path],
            Named::List(number) => named.wanted_of(&mut lists[number], &areas, options.on_bad_file)?,
        };
        // Paths with a double slash are one path, and URLs are two.
        named.paths.extend(paths.into_iter().filter(|path| known.insert(place(path).into_os_string())));
    }
    match (named.paths.is_empty() && named.skipped.is_empty(), lists.first()) {
        (true, Some(list)) => Err(Error::Config(format!(
            "{FILES}: by {}, no point cloud of a list meets [input] bounds or clip: correct these, or the list",
            list.list.display()
        ))),
        _ => Ok(named),
    }
}

/// What an entry names.
enum Named {
    Cloud(PathBuf),
    /// The list of this number.
    List(usize),
}

impl NamedInputs {
    /// Returns the clouds of a list that are opened, and notes which are not.
    ///
    /// # Errors
    /// [`Error::Input`] if a local one is not there, and bad files are not to be left out.
    fn wanted_of(
        &mut self,
        list: &mut ListedInputs,
        areas: &ListedAreas,
        on_bad_file: OnBadFile,
    ) -> Result<Vec<PathBuf>> {
        let all = list.clouds.len();
        self.notes.extend(areas.unusable_boxes(list));
        let (wanted, outside) = areas.wanted(std::mem::take(&mut list.clouds));
        if outside > 0 {
            self.notes.push(format!(
                "{}: {outside} of its {all} files lie outside [input] bounds or clip by the list, and were not opened",
                list.list.display()
            ));
        }
        let is_gone = |path: &PathBuf| {
            let is_local = !path.to_str().is_some_and(is_url);
            is_local && path.metadata().is_err_and(|error| error.kind() == ErrorKind::NotFound)
        };
        let (gone, there): (Vec<PathBuf>, Vec<PathBuf>) = wanted.into_iter().partition(is_gone);
        match gone.first() {
            Some(first) if on_bad_file == OnBadFile::Stop => Err(Error::input(
                &list.list,
                format!(
                    "names {}, which does not exist; fix: correct the list, copy the file, or set [input] on_bad_file = \"skip\"",
                    first.display()
                ),
            )),
            _ => {
                let why = format!("does not exist, but {} names it", list.list.display());
                self.skipped.extend(gone.into_iter().map(|file| SkippedInput { file, why: why.clone() }));
                Ok(there)
            }
        }
    }
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

/// Returns what to do about a path that leads nowhere. TOML makes one character of a backslash and a letter, as of `"C:\temp"`.
fn what_to_do_about(entry: &str) -> &'static str {
    match entry.contains(['\t', '\n', '\r', '\u{8}', '\u{c}', '\u{1b}']) {
        true => ": a backslash has a meaning of its own in double quotes; fix: write slashes, or single quotes",
        false => "; fix: correct the path, which is relative to the configuration",
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
    let start = format!("claims {records} records, but");
    if missing < records {
        let are = if *missing == 1 { "is" } else { "are" };
        return format!(
            "{start} {missing} {are} missing: the file is cut off or its header is wrong; fix: copy it again, or raise [input] \
             max_malformed_fraction to use what is there"
        );
    }
    let why = match format {
        FileFormat::Laz => "the file is cut off within its first compressed chunk",
        _ => "the file is cut off after its header, or its header is wrong",
    };
    format!("{start} all are missing: {why}; fix: copy it again, or leave it out with [input] on_bad_file = \"skip\"")
}
