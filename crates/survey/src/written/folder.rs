//! The folder of a written difference. Its files get their names when all of them are whole, and nothing of anybody else is overwritten.

use serde::Deserialize;
use std::path::{Path, PathBuf};
use sys::{Error, Result, disk};
use tiles::file_names::is_number;

/// What a written difference may have in its folder.
const OWN: [&str; 7] = [RASTER, TILESET, TILESETS, TILES, LEVELS, SUMMARY, PARTIAL];

/// The raster of differences.
pub(crate) const RASTER: &str = "difference.tif";

pub(crate) const TILESET: &str = "tileset.json";
pub(crate) const TILESETS: &str = "tilesets";
pub(crate) const TILES: &str = "tiles";
pub(crate) const LEVELS: &str = "levels";

/// All figures. It is written last, so its folder is that of a whole difference.
pub(crate) const SUMMARY: &str = "difference.json";

/// The folder where files wait until all of them are whole.
const PARTIAL: &str = "difference.partial";

/// A folder that a difference is being written to.
#[derive(Debug)]
pub(crate) struct DifferenceFolder {
    path: PathBuf,
}

/// What tells a summary of this program from other files of that name.
#[derive(Deserialize)]
struct SummaryHead {
    generator: String,
}

impl DifferenceFolder {
    /// Looks at the folder at `path`, and changes nothing.
    ///
    /// # Errors
    /// [`Error::Config`] if there is something else than an earlier difference, [`Error::Io`].
    pub(crate) fn at(path: &Path) -> Result<DifferenceFolder> {
        let refuse = |what: String| {
            Err(Error::Config(format!(
                "{} {what}, and diff overwrites only what diff has written: name a new folder with --output",
                path.display()
            )))
        };
        let unread = |error| Error::io("read", path)(error);
        if disk::exists(path).map_err(unread)? && !disk::is_folder(path).map_err(unread)? {
            return refuse("is a file".into());
        }
        let entries = disk::list(path).map_err(unread)?;
        let is_own = |entry: &Path| entry.file_name().is_some_and(|name| OWN.iter().any(|own| name == *own));
        if let Some(other) = entries.iter().filter(|entry| !is_own(entry)).min() {
            return refuse(format!("has {} in it", other.file_name().unwrap_or_default().display()));
        }
        for name in [TILESETS, TILES, LEVELS] {
            if let Some(other) = foreign_below(&path.join(name))? {
                return refuse(format!("has {} in it", other.strip_prefix(path).unwrap_or(&other).display()));
            }
        }
        let folder = DifferenceFolder { path: path.into() };
        let is_stopped = disk::is_folder(&folder.partial()).map_err(unread)?;
        if entries.is_empty() || is_stopped || folder.has_summary() {
            return Ok(folder);
        }
        refuse(format!("has files of a terrain in it and no {SUMMARY} of gdt-batch"))
    }

    fn has_summary(&self) -> bool {
        let text = std::fs::read(self.path.join(SUMMARY)).unwrap_or_default();
        serde_json::from_slice::<SummaryHead>(&text).is_ok_and(|head| head.generator.starts_with("gdt-batch "))
    }

    fn partial(&self) -> PathBuf {
        self.path.join(PARTIAL)
    }

    /// Makes the folder, and removes what a run that was stopped has left.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn begin(&self) -> Result<()> {
        let partial = self.partial();
        disk::remove_tree(&partial).map_err(Error::io("remove", &partial))?;
        disk::create_folder(&partial).map_err(Error::io("create", &partial))
    }

    /// Returns where the file that will be called `name` is written. Its folder is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn waiting(&self, name: &str) -> Result<PathBuf> {
        let path = self.partial().join(name);
        if let Some(folder) = path.parent() {
            disk::create_folder(folder).map_err(Error::io("create", folder))?;
        }
        Ok(path)
    }

    /// Writes the file that will be called `name`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.waiting(name)?;
        let write = || {
            let file = disk::create(&path)?;
            disk::write_all_at(&file, bytes, 0)?;
            disk::sync(&file)
        };
        write().map_err(Error::io("write", &path))
    }

    /// Gives all files their names, in place of those of an earlier difference: the summary last. If it is interrupted, the folder still is one
    /// that diff may write to.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn publish(&self) -> Result<()> {
        let partial = self.partial();
        for name in OWN.iter().filter(|name| **name != PARTIAL).rev() {
            let path = self.path.join(name);
            let is_folder = disk::is_folder(&path).map_err(Error::io("read", &path))?;
            let remove = if is_folder { disk::remove_tree } else { disk::remove_file };
            remove(&path).map_err(Error::io("remove", &path))?;
        }
        for name in OWN.iter().filter(|name| **name != PARTIAL) {
            let (from, to) = (partial.join(name), self.path.join(name));
            if disk::exists(&from).map_err(Error::io("read", &from))? {
                disk::rename(&from, &to).map_err(Error::io("rename the finished file to", &to))?;
            }
        }
        disk::remove_folder(&partial).map_err(Error::io("remove", &partial))?;
        disk::sync_folder(&self.path).map_err(Error::io("write", &self.path))
    }
}

/// Returns a file below a folder that no difference has, if there is one: anything but tiles and tilesets by their numbers.
fn foreign_below(folder: &Path) -> Result<Option<PathBuf>> {
    for entry in disk::list(folder).map_err(Error::io("read", folder))? {
        let is_folder = disk::is_folder(&entry).map_err(Error::io("read", &entry))?;
        let is_numbered = entry.file_stem().is_some_and(|stem| is_number(&stem.to_string_lossy()));
        let is_own = match entry.extension() {
            None => is_folder,
            Some(ending) => !is_folder && (ending == "glb" || ending == "json"),
        };
        if !is_numbered || !is_own {
            return Ok(Some(entry));
        }
        if is_folder && let Some(other) = foreign_below(&entry)? {
            return Ok(Some(other));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const OURS: &str = "{\"generator\": \"gdt-batch 9\"}";

    #[test]
    fn a_new_folder_and_an_earlier_difference_are_written_to() {
        let top = tempfile::tempdir().unwrap();
        let path = top.path().join("a/b");
        let folder = DifferenceFolder::at(&path).unwrap();
        assert!(!path.exists());
        for round in ["first", "second"] {
            DifferenceFolder::at(&path).unwrap();
            folder.begin().unwrap();
            folder.write("tiles/000000.glb", round.as_bytes()).unwrap();
            folder.write(SUMMARY, OURS.as_bytes()).unwrap();
            folder.publish().unwrap();
            assert_eq!(fs::read_to_string(path.join("tiles/000000.glb")).unwrap(), round);
            assert_eq!(fs::read_dir(&path).unwrap().count(), 2);
        }
        // A run that was stopped when it had removed the summary.
        folder.begin().unwrap();
        fs::remove_file(path.join(SUMMARY)).unwrap();
        DifferenceFolder::at(&path).unwrap();
    }

    #[test]
    fn what_others_have_written_is_refused() {
        let top = tempfile::tempdir().unwrap();
        let refused = |path: &Path| {
            let error = DifferenceFolder::at(path).unwrap_err();
            assert_eq!(error.kind(), sys::ErrorKind::Usage, "{error}");
            error.to_string()
        };
        fs::write(top.path().join("file"), "").unwrap();
        assert!(refused(&top.path().join("file")).contains("is a file"));
        assert!(refused(top.path()).contains("has file in it"));
        // Beside the tiles of an earlier difference too.
        for foreign in ["tiles/mine.glb", "levels/001/notes.txt", "tilesets/old/000001.json"] {
            let earlier = tempfile::tempdir().unwrap();
            for (name, text) in [("tiles/000000.glb", "tile"), (SUMMARY, OURS), (foreign, "theirs")] {
                let path = earlier.path().join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, text).unwrap();
            }
            let told = refused(earlier.path());
            assert!(foreign.starts_with(told.split(" has ").nth(1).unwrap().split(" in it").next().unwrap()), "{told}");
        }
        let terrain = top.path().join("terrain");
        fs::create_dir_all(terrain.join("tiles")).unwrap();
        assert!(refused(&terrain).contains("no difference.json"));
        fs::write(terrain.join(SUMMARY), "{\"generator\": \"other\"}").unwrap();
        assert!(refused(&terrain).contains("no difference.json"));
        fs::write(terrain.join(SUMMARY), OURS).unwrap();
        DifferenceFolder::at(&terrain).unwrap();
        fs::write(terrain.join("report.json"), "").unwrap();
        assert!(refused(&terrain).contains("report.json"));
    }
}
