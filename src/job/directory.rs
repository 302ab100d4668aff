//! The job directory: everything a job knows, on disk, and where the results go. Any step can be run again from it.

use crate::{Error, Result};
use serde::Serialize;
use std::fs::{self, File, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// The paths of a job.
#[derive(Clone, Debug)]
pub struct Directory {
    output: PathBuf,
    job: PathBuf,
}

impl Directory {
    /// The directory of the job that writes to `output`.
    pub fn new(output: &Path) -> Directory {
        Directory { output: output.to_path_buf(), job: output.join("job") }
    }

    /// Makes the directories, empty of what an earlier job has left, and keeps other processes out until the lock is dropped.
    /// Removes nothing that a job has not written.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be made or emptied, [`Error::Config`] if they are somebody else's or in use.
    pub fn create(&self) -> Result<Lock> {
        if self.output.exists() && !self.output.is_dir() {
            return Err(Error::Config(format!("[output] directory: {} is a file", self.output.display())));
        }
        // A kill can leave an empty one.
        let is_new = fs::read_dir(&self.job).map_or(true, |mut entries| entries.next().is_none());
        fs::create_dir_all(&self.job).map_err(Error::io("create the directory", &self.job))?;
        let lock = Lock::take(&self.job, is_new)?;
        for tiles in [self.tiles(), self.levels()] {
            fs::create_dir_all(&tiles).map_err(Error::io("create the directory", &tiles))?;
            remove_old_tiles(&tiles)?;
        }
        if self.cut().is_dir() {
            remove_old_tiles(&self.cut())?;
            // What is somebody else's in it stays.
            let _ = fs::remove_dir(self.cut());
        }
        let results = [self.terrain(), self.tileset(), self.georeference(), self.report(), self.preview()];
        for stale in [self.spill(), self.store()].into_iter().chain(results) {
            remove_file(&stale)?;
        }
        Ok(lock)
    }

    /// Removes all that only the steps need.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn clean_up(&self) -> Result<()> {
        remove_file(&self.spill())?;
        remove_file(&self.store())?;
        // Only jobs with levels have use for it.
        let _ = fs::remove_dir(self.levels());
        // With the lock, which marks the directory as a job's own, last: a kill in between leaves what the next job may take.
        remove_directory(&self.job)
    }

    /// The points on their way from the inputs to the leaves.
    pub fn spill(&self) -> PathBuf {
        self.job.join("points.spill")
    }

    /// The results of the steps.
    pub fn store(&self) -> PathBuf {
        self.job.join("steps.store")
    }

    /// The directory of the tiles.
    pub fn tiles(&self) -> PathBuf {
        self.output.join("tiles")
    }

    /// The GLB of `tile`.
    pub fn tile(&self, tile: usize) -> PathBuf {
        self.tiles().join(format!("{tile:06}.glb"))
    }

    /// The directory of the coarser tiles.
    pub fn levels(&self) -> PathBuf {
        self.output.join("levels")
    }

    /// The GLB of the coarser tile at tree node `node`.
    pub fn level(&self, node: usize) -> PathBuf {
        self.levels().join(format!("{node:06}.glb"))
    }

    /// All tiles as 3D Tiles.
    pub fn tileset(&self) -> PathBuf {
        self.output.join("tileset.json")
    }

    /// The directory of the triangles that are left out.
    pub fn cut(&self) -> PathBuf {
        self.output.join("cut")
    }

    /// Makes the directory of the triangles that are left out.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create_cut(&self) -> Result<()> {
        fs::create_dir_all(self.cut()).map_err(Error::io("create the directory", self.cut()))
    }

    /// The GLB of what is left out of `tile`.
    pub fn cut_tile(&self, tile: usize) -> PathBuf {
        self.cut().join(format!("{tile:06}.glb"))
    }

    /// All tiles in one scene.
    pub fn terrain(&self) -> PathBuf {
        self.output.join("terrain.glb")
    }

    /// Offset, resolution, unit and CRS.
    pub fn georeference(&self) -> PathBuf {
        self.output.join("georeference.json")
    }

    /// The machine-readable report.
    pub fn report(&self) -> PathBuf {
        self.output.join("report.json")
    }

    /// The picture of the whole terrain.
    pub fn preview(&self) -> PathBuf {
        self.output.join("preview.png")
    }
}

/// Keeps other processes out of a job directory, also after a kill: the system lets go of it with the process.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock file of `job`, which also marks the directory as a job's own.
    fn take(job: &Path, is_new: bool) -> Result<Lock> {
        let path = job.join("lock");
        if !is_new && !path.exists() {
            return Err(Error::Config(format!(
                "{} is there already and is no job directory of this program: choose another [output] directory",
                job.display()
            )));
        }
        let file = File::options().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = file.map_err(Error::io("open", &path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let mut holder = String::new();
                file.read_to_string(&mut holder).map_err(Error::io("read", &path))?;
                return Err(Error::InUse { directory: job.into(), holder });
            }
            // Some network file systems know no locks; there a second job is not noticed.
            Err(TryLockError::Error(e)) if e.kind() != std::io::ErrorKind::Unsupported => {
                return Err(Error::io("lock", &path)(e));
            }
            _ => {}
        }
        file.set_len(0).and_then(|()| write!(file, "{}", std::process::id())).map_err(Error::io("write", &path))?;
        Ok(Lock { _file: file })
    }
}

/// Writes `path` so that it appears under its name only when whole.
///
/// # Errors
/// [`Error::Io`] if writing or renaming fails, or what `fill` returns.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut File) -> std::io::Result<()>) -> Result<()> {
    let partial = path.with_extension("partial");
    let mut file = File::create(&partial).map_err(Error::io("create", &partial))?;
    fill(&mut file).map_err(Error::io("write", &partial))?;
    drop(file);
    fs::rename(&partial, path).map_err(Error::io("rename the finished file to", path))
}

/// Writes `value` as JSON to `path`, whole or not at all.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Error::Broken(format!("{}: {e}", path.display())))?;
    text.push(b'\n');
    write_whole(path, |file| file.write_all(&text))
}

/// Removes the tiles of an earlier job, whole or not: files named by a number.
fn remove_old_tiles(tiles: &Path) -> Result<()> {
    for entry in fs::read_dir(tiles).map_err(Error::io("read", tiles))? {
        let path = entry.map_err(Error::io("read", tiles))?.path();
        let is_numbered = path.file_stem().is_some_and(|s| s.to_string_lossy().bytes().all(|b| b.is_ascii_digit()));
        if is_numbered && path.extension().is_some_and(|e| e == "glb" || e == "partial") {
            remove_file(&path)?;
        }
    }
    Ok(())
}

fn remove_directory(path: &Path) -> Result<()> {
    match fs::remove_dir_all(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path)(e)),
        _ => Ok(()),
    }
}

/// Removes the file at `path` if there is one.
///
/// # Errors
/// [`Error::Io`] if it cannot be removed.
pub fn remove_file(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path)(e)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_jobs_own_stays() {
        let output = tempfile::tempdir().unwrap();
        let directory = Directory::new(output.path());
        fs::create_dir_all(directory.tiles()).unwrap();
        let [theirs, old] = ["roof.glb", "000007.glb"].map(|name| directory.tiles().join(name));
        fs::write(&theirs, "x").unwrap();
        fs::write(&old, "x").unwrap();
        drop(directory.create().unwrap());
        assert!(theirs.exists() && !old.exists());
        // As a kill may leave it: without the lock nothing else, and then it may be taken again.
        directory.clean_up().unwrap();
        fs::create_dir(output.path().join("job")).unwrap();
        drop(directory.create().unwrap());
        fs::rename(output.path().join("job/lock"), output.path().join("job/theirs")).unwrap();
        let error = directory.create().unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
    }

    #[test]
    fn two_jobs_in_one_directory_keep_out_of_each_others_way() {
        let output = tempfile::tempdir().unwrap();
        let directory = Directory::new(output.path());
        let lock = directory.create().unwrap();
        let error = directory.create().unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains(&std::process::id().to_string()), "{error}");
        drop(lock);
        directory.create().unwrap();
    }
}
