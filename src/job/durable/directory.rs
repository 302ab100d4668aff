//! The job directory, which holds everything that a job needs to go on, and the results beside it.

use crate::job::durable::atomic_file::{partial_path, remove_file};
use crate::job::durable::lock::{Lock, lock_file};
use crate::output::file_names::OutputFiles;
use crate::{Error, Result, fault};
use rayon::prelude::*;
use serde_json::Value;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The number of files that the records of a store are dealt out to.
pub const STORE_FILES: usize = 8;

/// The files of one job: its results, and what it keeps for itself in `job`.
#[derive(Clone, Debug)]
pub struct JobDirectory {
    output: OutputFiles,
    job: PathBuf,
}

impl JobDirectory {
    /// Returns the directory of the job that writes to `output`.
    pub fn new(output: &Path) -> JobDirectory {
        let output = OutputFiles::new(output);
        JobDirectory { job: output.job(), output }
    }

    /// Returns the paths of the results.
    pub fn output(&self) -> &OutputFiles {
        &self.output
    }

    /// Returns the job directory itself.
    pub fn job(&self) -> &Path {
        &self.job
    }

    /// Returns the path of the plan.
    pub fn plan(&self) -> PathBuf {
        self.job.join("plan.json")
    }

    /// Returns the path of the journal of finished steps.
    pub fn journal(&self) -> PathBuf {
        self.job.join("journal")
    }

    /// Returns the path of the file that holds the points between reading and triangulating.
    pub fn points(&self) -> PathBuf {
        self.job.join("points")
    }

    /// Returns the paths of the store's files.
    pub fn store(&self) -> [PathBuf; STORE_FILES] {
        std::array::from_fn(|file| self.job.join(format!("steps.{file}.store")))
    }

    /// Returns the name that the journal gives to the file at `path`: its path from the output directory.
    pub fn name(&self, path: &Path) -> PathBuf {
        path.strip_prefix(self.output.directory()).unwrap_or(path).to_path_buf()
    }

    /// Returns the path of the file with this name.
    pub fn file(&self, name: &Path) -> PathBuf {
        self.output.directory().join(name)
    }

    /// Takes the lock of the job directory, which it creates if need be.
    ///
    /// # Errors
    /// As [`Lock::take`].
    pub fn lock(&self) -> Result<Lock> {
        Lock::take(&self.job)
    }

    /// Takes the lock and removes everything that an earlier job left.
    ///
    /// # Errors
    /// As [`JobDirectory::lock`] and [`JobDirectory::remove_results`].
    pub fn create(&self) -> Result<Lock> {
        let lock = self.lock()?;
        remove_file(&self.journal())?;
        self.remove_job_files(&HashSet::new())?;
        self.remove_results(&HashSet::new())?;
        Ok(lock)
    }

    /// Removes what an earlier run left for its steps, except the files that `keep` names as the journal does.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be removed.
    pub fn remove_job_files(&self, keep: &HashSet<PathBuf>) -> Result<()> {
        let entries = fs::read_dir(&self.job).map_err(Error::io("read", &self.job))?;
        let paths = entries.map(|entry| Ok(entry.map_err(Error::io("read", &self.job))?.path()));
        let mut paths = paths.collect::<Result<Vec<PathBuf>>>()?;
        // All names go, because other versions of the program use other names.
        let stays = [self.journal(), lock_file(&self.job)];
        paths.retain(|path| !stays.contains(path) && !path.is_dir());
        self.remove_unless_kept(&paths, keep)
    }

    /// Creates the folder of the tiles, and removes the results of an earlier run, whole or partial, except the files that `keep`
    /// names.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be made or a file cannot be removed.
    pub fn remove_results(&self, keep: &HashSet<PathBuf>) -> Result<()> {
        create_folder(&self.output.tiles())?;
        let results = self.existing_results()?;
        let partials: Vec<PathBuf> = results.iter().map(|path| partial_path(path)).collect();
        self.remove_unless_kept(&results, keep)?;
        self.remove_unless_kept(&partials, keep)?;
        // This fails, as it should, where a folder holds files that the job keeps or that somebody else owns.
        let _ = fs::remove_dir(self.output.cut());
        let _ = fs::remove_dir(self.output.levels());
        Ok(())
    }

    /// Removes the results of a run that has failed for good.
    ///
    /// # Errors
    /// As [`JobDirectory::remove_results`].
    pub fn withdraw_results(&self) -> Result<()> {
        self.remove_results(&HashSet::new())?;
        let _ = fs::remove_dir(self.output.tiles());
        Ok(())
    }

    fn remove_unless_kept(&self, paths: &[PathBuf], keep: &HashSet<PathBuf>) -> Result<()> {
        paths.iter().filter(|path| !keep.contains(&self.name(path))).try_for_each(|path| remove_file(path))
    }

    /// Returns the paths of all results that may exist: the fixed names, and the numbered files that do.
    fn existing_results(&self) -> Result<Vec<PathBuf>> {
        let output = &self.output;
        let numbered = output.glb_folders().into_iter().filter(|folder| folder.is_dir());
        let numbered = numbered.map(|folder| numbered_files(&folder)).collect::<Result<Vec<_>>>()?;
        // The report comes first: wherever a removal is cut off, results beside a report are complete.
        let mut results = vec![
            output.report(),
            output.checksums(),
            output.terrain(),
            output.tileset(),
            output.georeference(),
            output.preview(),
        ];
        results.extend(numbered.concat());
        Ok(results)
    }

    /// Returns the paths of all files that the job may read or write in its directory.
    fn existing_files(&self) -> Result<Vec<PathBuf>> {
        let mut files = vec![self.journal(), self.plan(), self.points(), lock_file(&self.job)];
        files.extend(self.store());
        files.extend(self.existing_results()?);
        let partials: Vec<PathBuf> = files.iter().map(|path| partial_path(path)).collect();
        files.extend(partials);
        Ok(files)
    }

    /// Checks that no file, and no dangling link, is where a job needs a folder, and that no folder, pipe or device is where it reads or
    /// writes a file: opening a pipe would wait for another process.
    ///
    /// # Errors
    /// [`Error::Config`] names what is in the way.
    pub fn check_nothing_in_the_way(&self) -> Result<()> {
        let mut folders = vec![self.job.clone()];
        folders.extend(self.output.glb_folders());
        let mut folders = self.output.directory().ancestors().chain(folders.iter().map(PathBuf::as_path));
        let is_in_the_way = |path: &&Path| path.symlink_metadata().is_ok() && !path.is_dir();
        let (found, what, wanted) = if let Some(found) = folders.find(is_in_the_way) {
            let what = if found.exists() { "is not a directory" } else { "is a link that leads nowhere" };
            (found.to_path_buf(), what, "a directory")
        } else if let Some(found) = self.existing_files()?.into_iter().find(|path| is_no_file(path)) {
            let what = if found.is_dir() { "is a directory" } else { "is a pipe or a device" };
            (found, what, "a file")
        } else {
            return Ok(());
        };
        Err(Error::Config(format!(
            "{} {what}, and the job needs {wanted} there: move it away, or choose another [output] directory",
            found.display()
        )))
    }

    /// Checks that a job wrote the files that this job would remove or overwrite.
    ///
    /// # Errors
    /// [`Error::Config`] if such files exist and nothing says that a job wrote them.
    pub fn check_results_are_ours(&self) -> Result<()> {
        let report = fs::read(self.output.report()).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok());
        let is_ours = |report: &Value| report["generator"].as_str().is_some_and(|by| by.starts_with("gdt-batch"));
        if self.journal().exists() || report.as_ref().is_some_and(is_ours) {
            return Ok(());
        }
        let mut results = self.existing_results()?.into_iter().flat_map(|path| [partial_path(&path), path]);
        match results.find(|path| path.symlink_metadata().is_ok()) {
            None => Ok(()),
            Some(found) => Err(Error::Config(format!(
                "{} exists, a job would overwrite or remove it, and nothing says that an earlier job wrote it: choose another \
                 [output] directory, or move it away",
                found.display()
            ))),
        }
    }

    /// Removes everything that only the steps need.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be removed.
    pub fn remove_job(&self) -> Result<()> {
        // In parallel, because the system takes a while to free the cache of large files.
        self.store().into_par_iter().chain([self.points()]).try_for_each(|file| remove_at_end(&file))?;
        remove_at_end(&self.plan())?;
        remove_at_end(&self.journal())?;
        // The lock goes last, because it marks the directory as a job's own: a kill before that leaves what the next job may take.
        match fs::remove_dir_all(&self.job) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", &self.job)(e)),
            _ => Ok(()),
        }
    }
}

/// Tells whether something other than a regular file, or a link to one, is at `path`.
fn is_no_file(path: &Path) -> bool {
    path.metadata().is_ok_and(|meta| !meta.is_file())
}

fn remove_at_end(file: &Path) -> Result<()> {
    remove_file(file)?;
    fault::point("cleaning");
    Ok(())
}

/// Creates the folder at `path`, and those above it, if need be.
///
/// # Errors
/// [`Error::Io`] if it cannot be made.
pub fn create_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(Error::io("create the directory", path))
}

/// Returns the files in `folder` that have the name of a numbered result, whole or partial.
fn numbered_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(Error::io("read", folder))?;
    let paths = entries.map(|entry| Ok(entry.map_err(Error::io("read", folder))?.path()));
    let is_numbered = |path: &PathBuf| {
        let number = path.file_stem().is_some_and(|s| s.to_string_lossy().bytes().all(|b| b.is_ascii_digit()));
        number && path.extension().is_some_and(|e| e == "glb" || e == "partial")
    };
    paths.filter(|path| path.as_ref().map_or(true, is_numbered)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_others_stay() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let tiles = directory.output().tiles();
        fs::create_dir_all(&tiles).unwrap();
        let [theirs, old] = ["roof.glb", "000007.glb"].map(|name| tiles.join(name));
        fs::write(&theirs, "x").unwrap();
        fs::write(&old, "x").unwrap();
        drop(directory.create().unwrap());
        assert!(theirs.exists() && !old.exists());
        // A kill may leave an empty job directory: the next job may take it.
        directory.remove_job().unwrap();
        fs::create_dir(output.path().join("job")).unwrap();
        drop(directory.create().unwrap());
        fs::rename(output.path().join("job/lock"), output.path().join("job/theirs")).unwrap();
        let error = directory.create().unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
    }

    #[test]
    fn a_second_job_in_one_directory_is_refused() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let lock = directory.create().unwrap();
        let error = directory.create().unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().contains(&std::process::id().to_string()), "{error}");
        drop(lock);
        directory.create().unwrap();
    }
}
