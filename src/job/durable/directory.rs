//! The job directory: everything a job knows, on disk, and where the results go. Any step can be run again from it.

use crate::job::durable::store::Store;
use crate::{Error, Result, fault};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeSet, HashSet};
use std::fs::{self, File, TryLockError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::thread::ScopedJoinHandle;
use xxhash_rust::xxh3::Xxh3;

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

    /// Makes the job directory, if it is not there, and keeps other processes out of it until the lock is dropped.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made, [`Error::InUse`] if another process has it, [`Error::Config`] if it is somebody
    /// else's.
    pub fn lock(&self) -> Result<Lock> {
        // A kill can leave an empty one.
        let is_new = fs::read_dir(&self.job).map_or(true, |mut entries| entries.next().is_none());
        create_directory(&self.job)?;
        Lock::take(&self.job, is_new)
    }

    /// Takes the lock, and leaves nothing of an earlier job.
    ///
    /// # Errors
    /// As [`Directory::lock`] and [`Directory::sweep_results`].
    pub fn create(&self) -> Result<Lock> {
        let lock = self.lock()?;
        remove_file(&self.journal())?;
        self.sweep_job(&HashSet::new())?;
        self.sweep_results(&HashSet::new())?;
        Ok(lock)
    }

    /// Removes what an earlier run has left for its steps, but for the files of `keep`, named as in the journal.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be removed.
    pub fn sweep_job(&self, keep: &HashSet<PathBuf>) -> Result<()> {
        let entries = fs::read_dir(&self.job).map_err(Error::io("read", &self.job))?;
        let paths = entries.map(|entry| Ok(entry.map_err(Error::io("read", &self.job))?.path()));
        let mut paths = paths.collect::<Result<Vec<PathBuf>>>()?;
        // Whatever they are called: other versions have other files.
        paths.retain(|path| *path != self.journal() && *path != lock_file(&self.job) && !path.is_dir());
        self.remove_all(&paths, keep)
    }

    /// Makes the folder of the tiles, and removes the results of an earlier run, whole or not, but for the files of `keep`.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be made or a file cannot be removed.
    pub fn sweep_results(&self, keep: &HashSet<PathBuf>) -> Result<()> {
        create_directory(&self.tiles())?;
        let results = self.results()?;
        let partials: Vec<PathBuf> = results.iter().map(|path| partial(path)).collect();
        self.remove_all(&results, keep)?;
        self.remove_all(&partials, keep)?;
        // What is somebody else's in them stays, and so do triangles that are kept.
        let _ = fs::remove_dir(self.cut());
        let _ = fs::remove_dir(self.levels());
        Ok(())
    }

    /// Removes the results of a run that has failed for good.
    ///
    /// # Errors
    /// As [`Directory::sweep_results`].
    pub fn withdraw(&self) -> Result<()> {
        self.sweep_results(&HashSet::new())?;
        let _ = fs::remove_dir(self.tiles());
        Ok(())
    }

    fn remove_all(&self, paths: &[PathBuf], keep: &HashSet<PathBuf>) -> Result<()> {
        paths.iter().filter(|path| !keep.contains(&self.name(path))).try_for_each(|path| remove_file(path))
    }

    /// What has the name of a result, whole or not.
    fn results(&self) -> Result<Vec<PathBuf>> {
        let folders = [self.tiles(), self.levels(), self.cut()];
        let numbered = folders.iter().filter(|folder| folder.is_dir()).map(|folder| numbered_files(folder));
        // The report comes first: what stands beside one is complete, whenever a removal is cut off.
        let mut results = vec![self.report(), self.terrain(), self.tileset(), self.georeference(), self.preview()];
        results.extend(numbered.collect::<Result<Vec<_>>>()?.concat());
        Ok(results)
    }

    /// Makes sure that there is no file, nor a link that leads nowhere, where a job needs a folder, and no folder where it writes a
    /// file.
    ///
    /// # Errors
    /// [`Error::Config`] if something is in the way.
    pub fn nothing_is_in_the_way(&self) -> Result<()> {
        let folders = [self.job.clone(), self.tiles(), self.levels(), self.cut()];
        let mut folders = self.output.ancestors().chain(folders.iter().map(PathBuf::as_path));
        let is_in_the_way = |path: &&Path| path.symlink_metadata().is_ok() && !path.is_dir();
        let (found, what, wanted) = if let Some(found) = folders.find(is_in_the_way) {
            let what = if found.exists() { "is not a directory" } else { "is a link that leads nowhere" };
            (found.to_path_buf(), what, "a directory")
        } else if let Some(found) = self.results()?.into_iter().find(|path| path.is_dir()) {
            (found, "is a directory", "a file")
        } else {
            return Ok(());
        };
        Err(Error::Config(format!(
            "{} {what}, and the job needs {wanted} there: move it away, or choose another [output] directory",
            found.display()
        )))
    }

    /// Makes sure that what a job would remove or write over is an earlier job's.
    ///
    /// # Errors
    /// [`Error::Config`] if there are such files and nothing says that a job has written them.
    pub fn is_not_somebody_elses(&self) -> Result<()> {
        let report = fs::read(self.report()).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok());
        let wrote_it = |report: &Value| report["generator"].as_str().is_some_and(|by| by.starts_with("gdt-batch"));
        if self.journal().exists() || report.as_ref().is_some_and(wrote_it) {
            return Ok(());
        }
        let mut results = self.results()?.into_iter().flat_map(|path| [partial(&path), path]);
        match results.find(|path| path.symlink_metadata().is_ok()) {
            None => Ok(()),
            Some(found) => Err(Error::Config(format!(
                "{} is there, which a job would write over or remove, and nothing says that it is an earlier job's: choose another \
                 [output] directory, or move it away",
                found.display()
            ))),
        }
    }

    /// The job directory itself.
    pub fn job(&self) -> &Path {
        &self.job
    }

    /// The name of a file as the journal has it: relative to the output directory.
    pub fn name(&self, path: &Path) -> PathBuf {
        path.strip_prefix(&self.output).unwrap_or(path).to_path_buf()
    }

    /// The file of this name.
    pub fn file(&self, name: &Path) -> PathBuf {
        self.output.join(name)
    }

    /// Removes all that only the steps need.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn clean_up(&self) -> Result<()> {
        // Side by side: what large files have in memory takes a while to be freed.
        self.store().into_par_iter().chain([self.spill()]).try_for_each(|file| clean(&file))?;
        clean(&self.journal())?;
        // With the lock, which marks the directory as a job's own, last: a kill in between leaves what the next job may take.
        remove_directory(&self.job)
    }

    /// Which steps are finished, with what result.
    pub fn journal(&self) -> PathBuf {
        self.job.join("journal")
    }

    /// The points on their way from the inputs to the leaves.
    pub fn spill(&self) -> PathBuf {
        self.job.join("points.spill")
    }

    /// The files with the results of the steps.
    pub fn store(&self) -> [PathBuf; Store::PARTS] {
        std::array::from_fn(|part| self.job.join(format!("steps.{part}.store")))
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

    /// Makes the directory of the coarser tiles.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be made.
    pub fn create_levels(&self) -> Result<()> {
        create_directory(&self.levels())
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
        let path = lock_file(job);
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

/// A result of the job that a step has written. It waits under its [`partial`] name until [`publish`] has brought it to the
/// disk.
#[derive(Clone, Debug)]
pub struct Written {
    /// Where it will be.
    pub path: PathBuf,
    /// Its size in bytes.
    pub bytes: u64,
    /// The XXH3 of its content.
    pub hash: u64,
}

/// Writes a result of the job under its [`partial`] name.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_result(path: &Path, content: &[u8]) -> Result<Written> {
    write_pieces(path, &[content])
}

/// [`write_result`] for content in pieces.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_pieces(path: &Path, pieces: &[&[u8]]) -> Result<Written> {
    let partial = partial(path);
    let write = |mut file: File| pieces.iter().try_for_each(|piece| file.write_all(piece));
    File::create(&partial).and_then(write).map_err(Error::io("write", &partial))?;
    let mut hasher = Xxh3::new();
    pieces.iter().for_each(|piece| hasher.update(piece));
    let bytes = pieces.iter().map(|piece| piece.len() as u64).sum();
    Ok(Written { path: path.into(), bytes, hash: hasher.digest() })
}

/// Writes `value` as JSON under the [`partial`] name of the result at `path`.
///
/// # Errors
/// [`Error::Io`] if writing fails.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<Written> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| Error::Broken(format!("{}: {e}", path.display())))?;
    text.push(b'\n');
    write_result(path, &text)
}

/// The result at `path` that has been written under its [`partial`] name by other means.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub fn written_result(path: &Path) -> Result<Written> {
    let (bytes, hash) = digest(&partial(path))?;
    Ok(Written { path: path.into(), bytes, hash })
}

/// The size and the XXH3 of the file at `path`.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub fn digest(path: &Path) -> Result<(u64, u64)> {
    let mut file = File::open(path).map_err(Error::io("open", path))?;
    let (mut hasher, mut bytes, mut buffer) = (Xxh3::new(), 0, vec![0; 1 << 18]);
    loop {
        let count = file.read(&mut buffer).map_err(Error::io("read", path))?;
        if count == 0 {
            return Ok((bytes, hasher.digest()));
        }
        hasher.update(&buffer[..count]);
        bytes += count as u64;
    }
}

/// The name under which the file at `path` waits until it is whole.
pub fn partial(path: &Path) -> PathBuf {
    path.with_extension("partial")
}

/// Files that are brought to the disk side by side.
const SYNCS_AT_ONCE: usize = 8;

/// Gives results their names: only once all of each is on the disk, and such that the names are there too.
///
/// # Errors
/// [`Error::Io`] if that fails.
pub fn publish(results: &[PathBuf]) -> Result<()> {
    sync_files(results)?;
    for path in results {
        fs::rename(partial(path), path).map_err(Error::io("rename the finished file to", path))?;
    }
    let folders: BTreeSet<&Path> = results.iter().filter_map(|path| path.parent()).collect();
    folders.into_iter().try_for_each(sync_directory)
}

/// Brings what waits to be `results` to the disk, several at a time: waits for the disk that overlap are hardly longer than one.
fn sync_files(results: &[PathBuf]) -> Result<()> {
    let share = results.len().div_ceil(SYNCS_AT_ONCE).max(1);
    let sync = |results: &[PathBuf]| results.iter().try_for_each(|path| sync_file(&partial(path)));
    std::thread::scope(|scope| {
        let mut shares = results.chunks(share);
        let own = shares.next().unwrap_or_default();
        let start = |share| std::thread::Builder::new().spawn_scoped(scope, move || sync(share)).map_err(|_| share);
        let others: Vec<_> = shares.map(start).collect();
        let own = sync(own);
        // What no thread could be had for is done here.
        let join = |other| match other {
            Ok(thread) => ScopedJoinHandle::join(thread).unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            Err(share) => sync(share),
        };
        others.into_iter().map(join).fold(own, Result::and)
    })
}

fn sync_file(path: &Path) -> Result<()> {
    let file = File::options().write(true).open(path).map_err(Error::io("open", path))?;
    file.sync_all().map_err(Error::io("write", path))
}

/// Brings the names in `directory` to the disk, where the system knows how.
///
/// # Errors
/// [`Error::Io`] if that fails.
pub fn sync_directory(directory: &Path) -> Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    let file = File::open(directory).map_err(Error::io("open", directory))?;
    file.sync_all().map_err(Error::io("write", directory))
}

fn create_directory(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(Error::io("create the directory", path))
}

/// The files in `folder` that are named as tiles are, whole or not.
fn numbered_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(Error::io("read", folder))?;
    let paths = entries.map(|entry| Ok(entry.map_err(Error::io("read", folder))?.path()));
    let is_numbered = |path: &PathBuf| {
        let number = path.file_stem().is_some_and(|s| s.to_string_lossy().bytes().all(|b| b.is_ascii_digit()));
        number && path.extension().is_some_and(|e| e == "glb" || e == "partial")
    };
    paths.filter(|path| path.as_ref().map_or(true, is_numbered)).collect()
}

fn remove_directory(path: &Path) -> Result<()> {
    match fs::remove_dir_all(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path)(e)),
        _ => Ok(()),
    }
}

fn lock_file(job: &Path) -> PathBuf {
    job.join("lock")
}

fn clean(file: &Path) -> Result<()> {
    remove_file(file)?;
    fault::point("cleaning");
    Ok(())
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
