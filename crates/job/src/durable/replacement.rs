//! Putting the results of a job in the place of those of an earlier one.
//!
//! Everything that can be found out, made or opened in advance is, while the earlier results are still whole: after that only
//! renames, removals and syncs are left that can fail. Between the removal of the old report and the arrival of the new one some
//! files are old and some are new, and there is no report. If a failure ends the run there, the next run goes on with it.

use crate::durable::atomic_file::{create_folder, remove_file, sync_folder};
use crate::durable::known_results::KnownResults;
use crate::durable::listing::{Leftovers, check_page_is_ours, exists};
use std::collections::{BTreeSet, HashSet};
use std::io;
use std::path::{Path, PathBuf};
use sys::disk::OpenFolder;
use sys::{Error, Result, disk, fault};
use tiles::checksums::Checksum;
use tiles::file_names::OutputFiles;

/// A file that waits, and its place.
type Move = (PathBuf, PathBuf);

/// Does what is to be done until the directory `results` holds the files with these `names` and no other results. Some of them are in `waiting`,
/// and some may be in their places already. `on_the_way` is a path for what is on its way, if the results stay where they wait, too.
///
/// # Errors
/// [`Error::Io`] if a file is in neither place, or the system does not tell; if a folder cannot be made or opened. [`Error::Config`]
/// if a foreign file is in the place of a result. No result has been touched then. [`Error::Io`] if a file cannot be renamed or removed, or a
/// folder cannot be synced.
pub(crate) fn replace(
    results: &OutputFiles,
    waiting: &OutputFiles,
    names: &HashSet<PathBuf>,
    on_the_way: Option<&Path>,
) -> Result<()> {
    let [report, new_report] = [results, waiting].map(OutputFiles::report);
    if !exists(&new_report)? && exists(&report)? {
        // It goes last.
        return Ok(());
    }
    if names.iter().any(|name| results.directory().join(name) == results.page()) {
        // Somebody may have put it there since the job wrote its own. The lists of results name that one by now.
        check_page_is_ours(results)?;
    }
    // The list that waits names every new result, also where a foreign file has come into its place. That of the earlier job stays
    // until all others are in place.
    let known = KnownResults::of(&[results])?;
    let mut moves = moves(results, waiting, names, &known, on_the_way.is_some())?;
    let outdated = outdated(results, names, &known, on_the_way.is_some())?;
    if on_the_way.is_some() && moves.is_empty() && outdated.is_empty() {
        return Ok(());
    }
    moves.retain(|(waits, _)| *waits != new_report);
    // That of the earlier job tells which files are outdated, so it stays until these are gone.
    let list = moves.iter().position(|(waits, _)| *waits == waiting.checksums()).map(|at| moves.remove(at));
    let folders: HashSet<&Path> = moves.iter().filter_map(|(_, place)| place.parent()).collect();
    folders.into_iter().try_for_each(create_folder)?;
    // Each after those in it. They can be opened, but they are too many to keep open.
    let numbered_folders = Leftovers::of(results)?.folders;
    numbered_folders.iter().try_for_each(|path| open(path).map(|_| ()))?;
    let directory = open(results.directory())?;
    remove_file(&report)?;
    sync(&directory)?;
    moves.iter().try_for_each(|moved| put(moved, on_the_way))?;
    outdated.iter().try_for_each(|path| remove_file(path))?;
    for folder in &numbered_folders {
        // This fails, as it should, where a folder holds files of this job or of somebody else.
        if disk::remove_folder(folder).is_err() {
            sync_folder(folder)?;
        }
    }
    sync(&directory)?;
    for moved in list.into_iter().chain([(new_report, report)]) {
        put(&moved, on_the_way)?;
        sync(&directory)?;
    }
    Ok(())
}

/// Returns the results that wait for their places. If they `stay`, without those that are there already.
fn moves(
    results: &OutputFiles,
    waiting: &OutputFiles,
    names: &HashSet<PathBuf>,
    known: &KnownResults,
    stay: bool,
) -> Result<Vec<Move>> {
    let mut moves = Vec::new();
    // Neither what is done nor which file a message names may depend on the order of a hash set.
    for name in names.iter().collect::<BTreeSet<_>>() {
        let [place, waits] = [results, waiting].map(|folder| folder.directory().join(name));
        if exists(&waits)? {
            known.check_place(name, &waits, results)?;
            if !stay || !is_in_place(&waits, &place)? {
                moves.push((waits, place));
            }
        } else if waits == waiting.report() || !exists(&place)? {
            let gone = io::Error::new(io::ErrorKind::NotFound, "it is gone, and it is not among the results either");
            return Err(Error::io("read", &waits)(gone));
        }
    }
    Ok(moves)
}

/// Returns the results of the earlier job that this one does not have.
fn outdated(results: &OutputFiles, names: &HashSet<PathBuf>, known: &KnownResults, stay: bool) -> Result<Vec<PathBuf>> {
    let mut outdated = Vec::new();
    for path in Leftovers::of(results)?.files {
        let name = path.strip_prefix(results.directory()).unwrap_or(&path);
        // An update replaces the list of changes of the one before itself.
        let stays = path == results.report() || stay && path == results.changes();
        // A file that no list names is foreign.
        if !stays && !names.contains(name) && known.contains(name) && exists(&path)? {
            outdated.push(path);
        }
    }
    Ok(outdated)
}

/// Puts a file in its place. It is replaced at once, so there is no moment without one.
fn put((waits, place): &Move, on_the_way: Option<&Path>) -> Result<()> {
    fault::point("replacing");
    let put = match on_the_way {
        Some(partial) => disk::link(waits, place, partial),
        None => disk::rename(waits, place),
    };
    put.map_err(Error::io("rename the finished file to", place))
}

/// Tells whether what waits is in its place already.
fn is_in_place(waits: &Path, place: &Path) -> Result<bool> {
    if !exists(place)? {
        return Ok(false);
    }
    let content = |path: &Path| Checksum::of_file(path).map_err(Error::io("read", path));
    Ok(disk::is_one_file(waits, place).map_err(Error::io("read", place))? || content(waits)? == content(place)?)
}

fn open(folder: &Path) -> Result<OpenFolder> {
    OpenFolder::open(folder).map_err(Error::io("open", folder))
}

fn sync(folder: &OpenFolder) -> Result<()> {
    folder.sync().map_err(Error::io("write", folder.path()))
}
