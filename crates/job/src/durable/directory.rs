//! The job directory, which holds everything that a job needs to go on, and the results beside it.

use crate::durable::atomic_file::{remove_file, remove_tree};
use crate::durable::listing::{Leftovers, entries, is_folder};
use crate::durable::lock::lock_file;
use crate::durable::replacement::replace;
use crate::index::PartIndex;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use sys::Result;
use tiles::file_names::OutputFiles;

/// The number of files that the records of a store are dealt out to.
pub const STORE_FILES: usize = 8;

/// The files of one job: its results, and what it keeps for itself in `job`. Results wait there too until all are whole; then
/// [`JobDirectory::replace_results`] puts them in the place of those of an earlier job.
#[derive(Clone, Debug)]
pub struct JobDirectory {
    results: OutputFiles,
    waiting: OutputFiles,
    job: PathBuf,
    points: PathBuf,
}

impl JobDirectory {
    /// Returns the directory of the job that writes to `output`.
    pub fn new(output: &Path) -> JobDirectory {
        let results = OutputFiles::new(output);
        let job = results.job();
        JobDirectory {
            waiting: OutputFiles::new(&job.join("results")),
            points: job.join("points-by-part"),
            job,
            results,
        }
    }

    /// Returns the directory in which a part of the job keeps its steps. Its results are those of the job.
    pub fn part(&self, part: PartIndex) -> JobDirectory {
        let points = self.points_by_part().join(part.to_string());
        JobDirectory { job: self.parts().join(part.to_string()), points, ..self.clone() }
    }

    /// Returns the directory in which the nodes above the parts keep their steps. Their results are those of the job.
    pub fn join(&self) -> JobDirectory {
        JobDirectory { job: self.job.join("join"), ..self.clone() }
    }

    /// Returns the directories of all parts that have one, and that of the nodes above the parts.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if they cannot be listed.
    pub fn folders_of_parts(&self) -> Result<Vec<JobDirectory>> {
        let number = |path: PathBuf| path.file_name()?.to_str()?.parse().ok().map(PartIndex);
        let parts = entries(&self.parts())?.into_iter().filter_map(number).map(|part| self.part(part));
        Ok(parts.chain([self.join()]).collect())
    }

    /// Returns the folder of the parts' own folders.
    pub fn parts(&self) -> PathBuf {
        self.job.join("parts")
    }

    /// Returns the folder of the points by part.
    pub fn points_by_part(&self) -> PathBuf {
        self.job.join("points-by-part")
    }

    /// Returns the paths of the results while the job is under way: that is where steps write and find them.
    pub fn output(&self) -> &OutputFiles {
        &self.waiting
    }

    /// Returns the paths of the results of a finished job.
    pub fn results(&self) -> &OutputFiles {
        &self.results
    }

    /// Returns the job directory itself.
    pub fn job(&self) -> &Path {
        &self.job
    }

    /// Returns the path of the plan.
    pub fn plan(&self) -> PathBuf {
        self.job.join("plan.json")
    }

    /// Returns the path of the plan of the first run of a job with `--update`.
    pub fn first_plan(&self) -> PathBuf {
        self.job.join("first-plan.json")
    }

    /// Returns the path where the list of what an update has changed waits.
    pub fn changes(&self) -> PathBuf {
        self.job.join("update.json")
    }

    /// Returns the path of the mark that all results of the last run with `--update` came into their places. It goes when a run begins.
    pub(crate) fn placed_mark(&self) -> PathBuf {
        self.job.join("placed")
    }

    /// Returns the path of a result on its way from where it waits to its place, where it stays in both.
    pub(crate) fn on_the_way(&self) -> PathBuf {
        self.job.join("result")
    }

    /// Returns the path of a file of this name in which a step keeps something until its results are written.
    pub fn scratch(&self, name: &str) -> PathBuf {
        self.job.join(name)
    }

    /// Returns the path of the journal of complete phases.
    pub fn journal(&self) -> PathBuf {
        self.job.join("journal")
    }

    /// Returns the folder that holds the points of a part between reading and triangulating, in a file for each reader.
    pub fn points(&self) -> &Path {
        &self.points
    }

    /// Returns the path of the point file with this number: that of the reader.
    pub fn point_file(&self, number: u16) -> PathBuf {
        self.points.join(format!("{number}.points"))
    }

    /// Returns the numbers and the paths of all point files.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if they cannot be listed.
    pub fn point_files(&self) -> Result<Vec<(u16, PathBuf)>> {
        let number = |path: &Path| path.file_name()?.to_str()?.strip_suffix(".points")?.parse().ok();
        Ok(entries(&self.points)?.into_iter().filter_map(|path| Some((number(&path)?, path))).collect())
    }

    /// Looks at what is in this folder. A network file system that remembers what was not there is right from then on.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the folder cannot be listed.
    pub fn probe(&self) -> Result<()> {
        entries(&self.job).map(|_| ())
    }

    /// Returns the paths of the store's files.
    pub fn store(&self) -> [PathBuf; STORE_FILES] {
        std::array::from_fn(|file| self.job.join(format!("steps.{file}.store")))
    }

    /// Returns the name that the journal gives to the file at `path`: the path that it has, or will have, from the output directory.
    pub fn name(&self, path: &Path) -> PathBuf {
        let name = path.strip_prefix(self.waiting.directory());
        name.or_else(|_| path.strip_prefix(self.results.directory())).unwrap_or(path).to_path_buf()
    }

    /// Returns the path of the file with this name while the job is under way.
    pub fn file(&self, name: &Path) -> PathBuf {
        let folder = if self.is_result(name) { self.waiting.directory() } else { self.results.directory() };
        folder.join(name)
    }

    /// Tells whether a file with this name is a result, not what a job keeps for itself.
    pub fn is_result(&self, name: &Path) -> bool {
        !self.results.directory().join(name).starts_with(&self.job)
    }

    /// Removes what an earlier run left for its steps, and the results that wait, except the files that `keep` names as the journal
    /// does.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if a file cannot be removed.
    pub fn clear(&self, keep: &HashSet<PathBuf>) -> Result<()> {
        self.remove_files_but(keep, &[self.journal()])?;
        let folders = [self.parts(), self.points_by_part(), self.join().job];
        folders.iter().try_for_each(|folder| remove_tree(folder))
    }

    /// Removes the results that wait, except those with these names, and the files that only a run needs that is under way.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if a file cannot be removed.
    pub(crate) fn keep_results(&self, names: &HashSet<PathBuf>) -> Result<()> {
        self.remove_files_but(names, &[self.journal(), self.plan(), self.first_plan()])
    }

    /// Removes the results that wait, and the files beside them, except those with these names, `own` and the lock.
    fn remove_files_but(&self, names: &HashSet<PathBuf>, own: &[PathBuf]) -> Result<()> {
        // All names go, because other versions of the program use other names.
        let mut files = Leftovers::of(&self.waiting)?.files;
        for path in entries(&self.job)? {
            if path != lock_file(&self.job) && !own.contains(&path) && !is_folder(&path)? {
                files.push(path);
            }
        }
        files.retain(|path| !names.contains(&self.name(path)));
        files.iter().try_for_each(|path| remove_file(path))
    }

    /// Puts the results with these `names`, which wait, in the place of the results of an earlier job. Goes on where an earlier call
    /// was cut off. If this succeeds, all of them are in place. With `--update` they stay where they wait, too.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if a file is missing, or cannot be renamed or removed.
    pub fn replace_results(&self, names: &HashSet<PathBuf>, keeps_waiting: bool) -> Result<()> {
        let on_the_way = keeps_waiting.then(|| self.on_the_way());
        replace(&self.results, &self.waiting, names, on_the_way.as_deref())
    }

    /// Returns the paths of all results of an earlier job that may exist.
    pub(crate) fn earlier_results(&self) -> Vec<PathBuf> {
        Leftovers::of(&self.results).unwrap_or_default().files
    }

    /// Returns the paths of all results that may wait.
    pub(crate) fn waiting_results(&self) -> Vec<PathBuf> {
        Leftovers::of(&self.waiting).unwrap_or_default().files
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::durable::cleaning::remove_job;
    use crate::durable::lock::Lock;
    use std::fs;
    use sys::ErrorKind;
    use tiles::checksums::{Checksum, list_text};

    fn names(names: &[&str]) -> HashSet<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    /// Writes the list of these results.
    fn write_list(output: &OutputFiles, names: &[&str]) {
        let files: Vec<_> = names.iter().map(|name| (name.to_string(), Checksum::default())).collect();
        fs::write(output.checksums(), list_text(&files)).unwrap();
    }

    /// Takes the lock, and removes everything that an interrupted run left.
    fn create(directory: &JobDirectory) -> crate::Result<Lock> {
        let lock = Lock::take(directory.job())?;
        remove_file(&directory.journal())?;
        directory.clear(&HashSet::new())?;
        Ok(lock)
    }

    #[test]
    fn files_of_others_stay() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        for (folder, _) in directory.results().numbered_folders() {
            fs::create_dir_all(folder).unwrap();
        }
        let names_of_theirs = ["cut/roof.glb", "tiles/123456.glb", "terrain.glb", "tiles/000008.partial"];
        let theirs = names_of_theirs.map(|name| output.path().join(name));
        let old = output.path().join("tiles/000007.glb");
        theirs.iter().chain([&old]).for_each(|path| fs::write(path, "x").unwrap());
        write_list(directory.results(), &["tiles/000007.glb"]);
        drop(create(&directory).unwrap());
        assert!(theirs.iter().all(|path| path.exists()) && old.exists());
        fs::create_dir_all(directory.output().directory()).unwrap();
        fs::write(directory.output().report(), "{}").unwrap();
        directory.replace_results(&names(&["report.json"]), false).unwrap();
        assert!(theirs.iter().all(|path| path.exists()));
        assert!(!old.exists() && !directory.results().levels().exists() && !directory.results().checksums().exists());
        // A kill may leave an empty job directory: the next job may take it.
        remove_job(&directory).unwrap();
        fs::create_dir(output.path().join("job")).unwrap();
        drop(create(&directory).unwrap());
        fs::rename(output.path().join("job/lock"), output.path().join("job/theirs")).unwrap();
        let error = create(&directory).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage, "{error}");
    }

    /// Wherever it was cut off, replacing goes on to the same end, and as long as it is not there, no report tells of results.
    #[test]
    fn replacing_goes_on_where_it_was_cut_off() {
        let new = [
            "tiles/000000.glb",
            "tiles/001/000300.glb",
            "levels/000001.glb",
            "tilesets/000000.json",
            "tileset.json",
            "XXH128SUMS",
            "report.json",
        ];
        for done in 0..=new.len() {
            let output = tempfile::tempdir().unwrap();
            let directory = JobDirectory::new(output.path());
            let _lock = create(&directory).unwrap();
            let write = |folder: &OutputFiles, name: &str, text: &str| {
                let path = folder.directory().join(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, text).unwrap();
            };
            let old = [
                "tiles/000000.glb",
                // An earlier version had no folders below.
                "tiles/000300.glb",
                "tiles/256/300/076800.glb",
                "levels/001/000256.glb",
                "cut/002/000512.glb",
                "terrain.glb",
                "report.json",
            ];
            old.iter().for_each(|name| write(directory.results(), name, "old"));
            write_list(directory.results(), &old[..6]);
            new.iter().for_each(|name| write(directory.output(), name, "new"));
            write_list(directory.output(), &new[..5]);
            let list = fs::read(directory.output().checksums()).unwrap();
            if done > 0 {
                fs::remove_file(directory.results().report()).unwrap();
            }
            if done >= 6 {
                // The list goes when all that it names and that is outdated is gone.
                ["tiles/256", "levels/001", "cut"]
                    .iter()
                    .for_each(|folder| fs::remove_dir_all(output.path().join(folder)).unwrap());
                ["terrain.glb", "tiles/000300.glb"]
                    .iter()
                    .for_each(|name| fs::remove_file(output.path().join(name)).unwrap());
            }
            for name in &new[..done] {
                fs::create_dir_all(output.path().join(name).parent().unwrap()).unwrap();
                fs::rename(directory.file(Path::new(name)), output.path().join(name)).unwrap();
            }
            directory.replace_results(&names(&new), false).unwrap();
            let found = Leftovers::of(directory.results()).unwrap().files.into_iter().filter(|path| path.exists());
            let found: HashSet<PathBuf> = found.map(|path| directory.name(&path)).collect();
            // The report goes last. When it is there, nothing more is done.
            if done < new.len() {
                assert_eq!(found, names(&new), "cut off after {done}");
            }
            let is_new = |name: &&str| fs::read(output.path().join(name)).unwrap() == b"new";
            assert!(new.iter().filter(|name| **name != "XXH128SUMS").all(is_new), "{done}");
            assert!(fs::read(directory.results().checksums()).unwrap() == list, "{done}");
            if done < new.len() {
                let gone = ["tiles/256", "levels/001", "cut"];
                assert!(gone.iter().all(|folder| !output.path().join(folder).exists()), "cut off after {done}");
            }
        }
    }

    #[test]
    fn a_page_that_somebody_put_there_during_the_job_stays() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let _lock = create(&directory).unwrap();
        fs::create_dir_all(directory.output().directory()).unwrap();
        fs::write(directory.output().page(), "<html data-terrain=\"tileset.json\">").unwrap();
        fs::write(directory.output().report(), "{}").unwrap();
        fs::write(directory.results().page(), "theirs").unwrap();
        let names = names(&["index.html", "report.json"]);
        let error = directory.replace_results(&names, false).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("move it away"), "{error}");
        assert_eq!(fs::read(directory.results().page()).unwrap(), b"theirs");
        fs::remove_file(directory.results().page()).unwrap();
        directory.replace_results(&names, false).unwrap();
        assert!(fs::read_to_string(directory.results().page()).unwrap().contains("data-terrain"));
    }

    #[test]
    fn a_file_that_somebody_put_in_the_place_of_a_result_stays() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let _lock = create(&directory).unwrap();
        [directory.output(), directory.results()].iter().for_each(|folder| fs::create_dir_all(folder.tiles()).unwrap());
        for (folder, text) in [(directory.output(), "new"), (directory.results(), "theirs")] {
            fs::write(folder.tile(0), text).unwrap();
        }
        fs::write(directory.output().tile(1), "new").unwrap();
        // An interrupted run has put this one in its place already, and another has written it again.
        fs::write(directory.results().tile(1), "new").unwrap();
        fs::write(directory.output().report(), "{}").unwrap();
        write_list(directory.output(), &["tiles/000000.glb", "tiles/000001.glb"]);
        let names = names(&["tiles/000000.glb", "tiles/000001.glb", "XXH128SUMS", "report.json"]);
        let error = directory.replace_results(&names, false).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(
            error.to_string().contains("000000.glb appeared during the job, and is not one of its results"),
            "{error}"
        );
        assert_eq!(fs::read(directory.results().tile(0)).unwrap(), b"theirs");
        fs::remove_file(directory.results().tile(0)).unwrap();
        directory.replace_results(&names, false).unwrap();
        assert_eq!(fs::read(directory.results().tile(0)).unwrap(), b"new");
    }

    #[test]
    fn a_second_job_in_one_directory_is_refused() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let lock = create(&directory).unwrap();
        let error = create(&directory).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Retry);
        assert!(error.to_string().contains(&std::process::id().to_string()), "{error}");
        drop(lock);
        create(&directory).unwrap();
    }
}
