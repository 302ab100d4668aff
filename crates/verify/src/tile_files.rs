//! The tile files of an output directory.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::file_search::files_below;
use sys::{Error, Result};
use tiles::file_names::OutputFiles;
use tiles::frame::Extras;
use tiles::gltf::read::{held_bytes, read_extras};

/// Checking a tile takes at most this many times the memory of its meshes.
const MEMORY_FACTOR: u64 = 5;

/// The files to check.
pub(super) struct TileFiles {
    /// The terrain's tiles, and after them the files of `cut/`, each in the order of their names.
    pub(super) paths: Vec<PathBuf>,
    /// The number of the terrain's tiles.
    pub(super) terrain: usize,
    /// The georeference of the first file that can be read. All others have to agree with it.
    pub(super) extras: Extras,
    /// The memory that the meshes of the largest file take, in bytes.
    largest: u64,
}

impl TileFiles {
    /// Finds the files in the output `directory` of a job.
    ///
    /// # Errors
    /// [`Error::Config`] if there are no tiles, [`Error::Io`] or [`Error::Input`] if no tile can be read.
    pub(super) fn find(directory: &Path) -> Result<TileFiles> {
        let layout = OutputFiles::new(directory);
        let folder = folder_of_tiles(&layout)?;
        let mut paths = glb_files(&folder)?;
        let terrain = paths.len();
        let Some(first) = paths.first() else {
            return Err(no_output(&folder, "has no .glb file"));
        };
        let readable = paths.iter().find_map(|path| read_extras(path).ok());
        let extras = readable.map_or_else(|| read_extras(first), Ok)?;
        let cut = layout.cut();
        if cut.is_dir() {
            paths.extend(glb_files(&cut)?);
        }
        // A file that cannot be read is reported when it is checked.
        let largest = paths.par_iter().map(|path| held_bytes(path).unwrap_or(0)).max().unwrap_or(0);
        Ok(TileFiles { paths, terrain, extras, largest })
    }

    /// Returns the files of a terrain whose `tiles` have been read already and need not be there any more, and those of `cut/` in the output
    /// `directory` of its job.
    ///
    /// # Errors
    /// [`Error::Io`] if `cut/` cannot be listed.
    pub(super) fn with_cut(tiles: Vec<PathBuf>, extras: Extras, directory: &Path) -> Result<TileFiles> {
        let (terrain, mut paths, cut) = (tiles.len(), tiles, OutputFiles::new(directory).cut());
        if cut.is_dir() {
            paths.extend(glb_files(&cut)?);
        }
        Ok(TileFiles { paths, terrain, extras, largest: 0 })
    }

    /// Returns the name of a file for people.
    pub(super) fn name(&self, number: u32) -> String {
        let number = number as usize;
        let name = self.paths.get(number).and_then(|path| path.file_name()).unwrap_or_default().to_string_lossy();
        if number < self.terrain { name.into_owned() } else { format!("cut/{name}") }
    }

    /// Returns how many files may be checked at the same time within `memory` bytes.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is not enough for one.
    pub(super) fn lanes(&self, memory: u64) -> Result<usize> {
        let each = self.largest.saturating_mul(MEMORY_FACTOR).max(1);
        match (memory / each) as usize {
            0 if each > 2 * memory => Err(Error::Memory(format!(
                "the largest tile takes about {} MiB to verify: set --memory \"{} MiB\" or more",
                each >> 20,
                each >> 20
            ))),
            lanes => Ok(lanes.clamp(1, rayon::current_num_threads())),
        }
    }
}

/// Returns the folder of the tiles.
fn folder_of_tiles(layout: &OutputFiles) -> Result<PathBuf> {
    let (directory, folder) = (layout.directory(), layout.tiles());
    match directory.metadata() {
        Err(e) if e.kind() == ErrorKind::NotFound => Err(no_output(directory, "is not there")),
        Err(e) => Err(Error::io("read", directory)(e)),
        Ok(meta) if !meta.is_dir() => Err(no_output(directory, "is not a directory")),
        Ok(_) if !folder.is_dir() => Err(no_output(directory, "has no folder named tiles")),
        Ok(_) => Ok(folder),
    }
}

fn no_output(path: &Path, what: &str) -> Error {
    Error::Config(format!("{} {what}: name the output directory of a finished job", path.display()))
}

/// Returns the GLB files in `folder` and in the folders in it, sorted by path.
fn glb_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let found = files_below(folder, "glb");
    let mut paths = found.map_err(|(folder, error)| Error::io("read", folder)(error))?;
    paths.sort_unstable();
    Ok(paths)
}
