//! Results of a finished run with `--update` that were changed, damaged or removed since. Each is there twice, in its place and where it
//! waited, so that one copy mends the other. What no copy has any more is computed again.

use crate::durable::atomic_file::{create_folder_of, publish, write_pending};
use crate::durable::directory::JobDirectory;
use crate::durable::journal::{PublishedFile, listed};
use crate::durable::listing::exists;
use crate::plan::fingerprint::first_few;
use crate::progress::stage::ProgressOutput;
use std::path::{Path, PathBuf};
use sys::disk::{is_one_file, link};
use sys::{Error, Result, interrupt};
use tiles::checksums::{list_text, parse_list, read_file};

/// What became of the results of a finished run. Paths are from the output directory.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Mended {
    /// Files that were put back from their other copy, or will be when the results take their places.
    put_back: Vec<PathBuf>,
    /// Results of which no copy is whole.
    lost: Vec<PathBuf>,
    /// Whether the run was interrupted before all its results were in place.
    pub(crate) is_interrupted: bool,
}

impl Mended {
    /// Mends the results `files` of a finished run, as its journals name them.
    ///
    /// # Errors
    /// [`Error::Io`] if a copy cannot be made.
    pub(crate) fn of(directory: &JobDirectory, mut files: Vec<PublishedFile>) -> Result<Mended> {
        files.sort_by(|a, b| a.name.cmp(&b.name));
        let is_interrupted = !exists(&directory.placed_mark())?;
        let mut mended = Mended { is_interrupted, ..Mended::default() };
        mended.write_list(directory, &files)?;
        for file in &files {
            interrupt::check()?;
            mended.mend(directory, file)?;
        }
        mended.place_list(directory, &files)?;
        Ok(mended)
    }

    /// Writes the list of the results once more from the journals, if no copy of it is whole. Without the list, nothing says which
    /// files are results.
    fn write_list(&mut self, directory: &JobDirectory, files: &[PublishedFile]) -> Result<()> {
        let (path, report) = (directory.output().checksums(), directory.name(&directory.output().report()));
        let name = directory.name(&path);
        let Some(list) = files.iter().find(|file| file.name == name) else { return Ok(()) };
        if list.is_whole(directory) || list.is_in_place(directory) {
            return Ok(());
        }
        let others = files.iter().filter(|file| file.name != name && file.name != report).cloned().collect();
        let text = list_text(&listed(directory, others));
        if list.holds(text.as_bytes()) {
            create_folder_of(&path)?;
            write_pending(&path, text.as_bytes())?;
            publish(std::slice::from_ref(&path))?;
            self.put_back.push(in_job(directory, &name));
        }
        Ok(())
    }

    fn mend(&mut self, directory: &JobDirectory, file: &PublishedFile) -> Result<()> {
        let (waits, place) = (directory.file(&file.name), directory.results().directory().join(&file.name));
        if file.is_whole(directory) {
            let is_one = exists(&place)? && is_one_file(&waits, &place).map_err(Error::io("read", &place))?;
            let is_placed = is_one || file.is_in_place(directory);
            self.put_back.extend((!is_placed && !self.is_interrupted).then(|| file.name.clone()));
        } else if file.is_in_place(directory) {
            create_folder_of(&waits)?;
            link(&place, &waits, &directory.on_the_way()).map_err(Error::io("write", &waits))?;
            self.put_back.push(in_job(directory, &file.name));
        } else {
            self.lost.push(file.name.clone());
        }
        Ok(())
    }

    /// Puts the list in its place, if that of no earlier run is there: it says that jobs wrote the files that will be replaced.
    fn place_list(&self, directory: &JobDirectory, files: &[PublishedFile]) -> Result<()> {
        let [waits, place] = [directory.output(), directory.results()].map(|output| output.checksums());
        let is_list = || read_file(&place).is_ok_and(|text| parse_list(&text).is_some());
        let list = files.iter().find(|file| file.name == directory.name(&waits));
        let is_needed = |list: &PublishedFile| {
            list.is_whole(directory) && !list.is_in_place(directory) && (!self.is_interrupted || !is_list())
        };
        match list.is_some_and(is_needed) {
            true => link(&waits, &place, &directory.on_the_way()).map_err(Error::io("write", &place)),
            false => Ok(()),
        }
    }

    /// Tells whether files were put back.
    pub(crate) fn has_put_back(&self) -> bool {
        !self.put_back.is_empty()
    }

    /// Tells the user what was wrong.
    pub(crate) fn tell(&self, progress: ProgressOutput) {
        for (files, what) in [
            (&self.put_back, "missing or changed since the last run, and put back"),
            (&self.lost, "damaged since the last run, and computed again"),
        ] {
            if !files.is_empty() {
                let names = files.iter().map(|name| name.display().to_string()).collect();
                progress.note(&format!("{what}: {}", first_few(names)));
            }
        }
    }
}

/// Returns the name of the copy of a result that waits, from the output directory.
fn in_job(directory: &JobDirectory, name: &Path) -> PathBuf {
    let path = directory.file(name);
    path.strip_prefix(directory.results().directory()).map(Path::to_path_buf).unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::durable::atomic_file::find_pending;
    use crate::run::update::changes::mark_placed;
    use std::collections::BTreeMap;
    use std::fs;

    const NAMES: [&str; 4] = ["tiles/000000.glb", "tiles/000001.glb", "XXH128SUMS", "report.json"];

    /// The results of a run, as its journals name them, in the places `into`.
    fn results(directory: &JobDirectory, into: &[&Path]) -> Vec<PublishedFile> {
        let waits = directory.output().directory();
        fs::create_dir_all(waits.join("tiles")).unwrap();
        let mut files = Vec::new();
        for name in NAMES {
            let text = match name {
                "XXH128SUMS" => list_text(&listed(directory, files.clone())),
                name => format!("the content of {name}"),
            };
            let file = write_pending(&waits.join(name), text.as_bytes()).unwrap();
            assert_eq!(find_pending(&file.path).unwrap().checksum, file.checksum);
            publish(std::slice::from_ref(&file.path)).unwrap();
            files.push(PublishedFile::of(directory, &file));
            for folder in into {
                fs::create_dir_all(folder.join("tiles")).unwrap();
                fs::hard_link(&file.path, folder.join(name)).unwrap();
            }
        }
        files
    }

    /// Returns what both copies of all results hold.
    fn contents(directory: &JobDirectory) -> BTreeMap<PathBuf, Vec<u8>> {
        let folders = [directory.output(), directory.results()].map(|output| output.directory().to_path_buf());
        let paths = folders.iter().flat_map(|folder| NAMES.map(|name| folder.join(name)));
        paths.map(|path| (path.clone(), fs::read(&path).unwrap_or_default())).collect()
    }

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    /// Writes something else under a path alone, or into the file that other paths lead to as well.
    fn damage(path: &Path, is_alone: bool) {
        if is_alone {
            fs::remove_file(path).unwrap();
        }
        fs::write(path, "damaged").unwrap();
    }

    #[test]
    fn a_whole_copy_mends_the_other() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let files = results(&directory, &[output.path()]);
        mark_placed(&directory).unwrap();
        let whole = contents(&directory);
        let mended = || Mended::of(&directory, files.clone()).unwrap();
        assert_eq!(mended(), Mended::default());
        damage(&directory.output().tile(0), true);
        damage(&directory.output().report(), true);
        fs::remove_file(directory.results().tile(1)).unwrap();
        let put_back = paths(&["job/results/report.json", "job/results/tiles/000000.glb", "tiles/000001.glb"]);
        assert_eq!(mended(), Mended { put_back, ..Mended::default() });
        let names = NAMES.map(PathBuf::from).into();
        directory.replace_results(&names, true).unwrap();
        assert_eq!(contents(&directory), whole);
    }

    #[test]
    fn the_list_is_written_again_when_all_results_are_damaged() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let mut files = results(&directory, &[output.path()]);
        mark_placed(&directory).unwrap();
        let list = fs::read(directory.results().checksums()).unwrap();
        NAMES.iter().for_each(|name| damage(&directory.output().directory().join(name), false));
        let mended = Mended::of(&directory, files.clone()).unwrap();
        assert_eq!(mended.lost, paths(&["report.json", "tiles/000000.glb", "tiles/000001.glb"]));
        assert!(mended.has_put_back() && !mended.is_interrupted);
        assert!([directory.output(), directory.results()].iter().all(|at| fs::read(at.checksums()).unwrap() == list));
        // A journal that lacks a file does not make up another list.
        NAMES.iter().for_each(|name| damage(&directory.output().directory().join(name), false));
        damage(&directory.results().checksums(), true);
        files.remove(0);
        let mended = Mended::of(&directory, files).unwrap();
        assert!(mended.lost.contains(&"XXH128SUMS".into()), "{mended:?}");
    }

    #[test]
    fn results_of_an_earlier_run_are_no_damage() {
        let output = tempfile::tempdir().unwrap();
        let directory = JobDirectory::new(output.path());
        let files = results(&directory, &[]);
        fs::write(directory.results().checksums(), "").unwrap();
        let mended = || Mended::of(&directory, files.clone()).unwrap();
        assert_eq!(mended(), Mended { is_interrupted: true, ..Mended::default() });
        assert_eq!(fs::read(directory.results().checksums()).unwrap(), b"", "it tells what is outdated");
        mark_placed(&directory).unwrap();
        let put_back = paths(&["XXH128SUMS", "report.json", "tiles/000000.glb", "tiles/000001.glb"]);
        assert_eq!(mended(), Mended { put_back, ..Mended::default() });
        assert_ne!(fs::read(directory.results().checksums()).unwrap(), b"");
    }
}
