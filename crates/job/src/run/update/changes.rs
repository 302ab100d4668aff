//! `update.json`: which results of an update are other than those of the run before it, for a web server or a cache.

use crate::durable::atomic_file::{publish, remove_file, write_pending};
use crate::durable::directory::JobDirectory;
use crate::durable::listing::{exists, read_if_there};
use crate::publish::side_files::EachTile;
use crate::records::{ExactTile, StepRecord, Store};
use crate::report::change_counts::ChangeCounts;
use lattice::Lattice;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;
use sys::{Error, Result, disk};
use tiles::checksums::{Checksum, parse_list};

/// What has changed. Paths are from the output directory, with slashes.
#[derive(Debug, Default, PartialEq, Serialize)]
struct Changes {
    /// Results that were there before and hold something else now.
    changed: Vec<String>,
    /// Results that were not there.
    added: Vec<String>,
    /// Results that are no longer there.
    removed: Vec<String>,
    /// The rectangles of the exact tiles among those that are changed or added: the least x and y, and the greatest, in the units of the points.
    areas: Vec<[[f64; 2]; 2]>,
}

/// Writes what has changed since the results that are in place, and returns how many have; `None` if there are none. It waits in the job
/// directory. `new` is the list of all results.
///
/// # Errors
/// [`Error::Io`] on the lists or the stores of the parts.
pub(crate) fn write_changes(
    directory: &JobDirectory,
    lattice: &Lattice,
    tiles: &dyn EachTile,
    new: &[(String, Checksum)],
) -> Result<Option<ChangeCounts>> {
    let old = read_if_there(&directory.results().checksums())?.and_then(|text| parse_list(&text));
    let Some(old) = old.map(|files| files.into_iter().collect::<BTreeMap<_, _>>()) else { return Ok(None) };
    let mut changes = Changes::between(&old, new);
    let other: HashSet<&Path> = changes.changed.iter().chain(&changes.added).map(Path::new).collect();
    let mut areas = Vec::new();
    tiles.visit(&mut |store: &Store, tile| {
        let name = directory.name(&directory.output().tile(tile.number()));
        if other.contains(name.as_path()) && store.has(StepRecord::Tile(tile)) {
            let corners = ExactTile::load(store, tile)?.summary.bounds().map(|bounds| [bounds.min, bounds.max]);
            let world = |[x, y, _]: [i32; 3]| [lattice.world(0, x), lattice.world(1, y)];
            areas.extend(corners.map(|corners| corners.map(world)));
        }
        Ok(())
    })?;
    changes.areas = areas;
    changes.write(directory)?;
    let [changed, added, removed] =
        [&changes.changed, &changes.added, &changes.removed].map(|names| names.len() as u64);
    Ok(Some(ChangeCounts { changed, added, removed }))
}

/// Ends a run that has found nothing changed. Unless the list of a run waits that was interrupted while its results took their places, the list in
/// place becomes empty. Returns whether one did.
///
/// # Errors
/// [`Error::Io`] if the list cannot be written.
pub(crate) fn end_without_changes(directory: &JobDirectory) -> Result<bool> {
    let waits = directory.changes();
    let was_interrupted = exists(&waits)?;
    if !was_interrupted {
        Changes::default().write(directory)?;
    }
    place_changes(directory)?;
    remove_file(&waits)?;
    mark_placed(directory)?;
    Ok(was_interrupted)
}

/// Marks that all results are in their places: what differs there from now on was changed by others.
///
/// # Errors
/// [`Error::Io`] if the mark cannot be made.
pub(crate) fn mark_placed(directory: &JobDirectory) -> Result<()> {
    let mark = directory.placed_mark();
    disk::open_or_create(&mark).map(drop).map_err(Error::io("create", &mark))
}

/// Puts the list of changes in its place, if one waits.
///
/// # Errors
/// [`Error::Io`] if it cannot be put there.
pub(crate) fn place_changes(directory: &JobDirectory) -> Result<()> {
    let (waits, place) = (directory.changes(), directory.results().changes());
    match exists(&waits)? {
        true => disk::link(&waits, &place, &directory.on_the_way()).map_err(Error::io("write", &place)),
        false => Ok(()),
    }
}

impl Changes {
    fn write(&self, directory: &JobDirectory) -> Result<()> {
        let path = directory.changes();
        let text = serde_json::to_vec_pretty(self).map_err(|e| Error::Broken(format!("{}: {e}", path.display())))?;
        write_pending(&path, &text)?;
        publish(std::slice::from_ref(&path))
    }

    fn between(old: &BTreeMap<String, Checksum>, new: &[(String, Checksum)]) -> Changes {
        let names: BTreeSet<&String> = new.iter().map(|(name, _)| name).collect();
        let those = |is_wanted: &dyn Fn(&String, &Checksum) -> bool| {
            let wanted = new.iter().filter(|(name, checksum)| is_wanted(name, checksum));
            wanted.map(|(name, _)| name.clone()).collect()
        };
        Changes {
            changed: those(&|name, checksum| old.get(name).is_some_and(|known| known != checksum)),
            added: those(&|name, _| !old.contains_key(name)),
            removed: old.keys().filter(|name| !names.contains(name)).cloned().collect(),
            areas: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_changed_added_or_removed() {
        let file = |name: &str, text: &str| (name.to_string(), Checksum::of(text.as_bytes()));
        let old = [file("tiles/000000.glb", "a"), file("tiles/000001.glb", "b"), file("tileset.json", "c")];
        let new = [file("tiles/000000.glb", "a"), file("tiles/000002.glb", "d"), file("tileset.json", "e")];
        let changes = Changes::between(&old.into_iter().collect(), &new);
        let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
        let expected = [names(&["tileset.json"]), names(&["tiles/000002.glb"]), names(&["tiles/000001.glb"])];
        assert_eq!([changes.changed, changes.added, changes.removed], expected);
    }
}
