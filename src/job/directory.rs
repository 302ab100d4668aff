//! The job directory: everything a job knows, on disk, and where the results go. Any step can be run again from it.

use crate::{Error, Result};
use serde::{Serialize, de::DeserializeOwned};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The paths of a job. Files of a step that is called by index carry that index.
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

    /// Makes the directories, empty of what an earlier job may have left.
    ///
    /// # Errors
    /// [`Error::Io`] if they cannot be made or emptied.
    pub fn create(&self) -> Result<()> {
        remove_directory(&self.job)?;
        remove_directory(&self.tiles())?;
        for stale in [self.terrain(), self.georeference(), self.report(), self.preview()] {
            remove_file(&stale)?;
        }
        for directory in
            ["leaves", "nodes", "rims", "preview"].map(|name| self.job.join(name)).into_iter().chain([self.tiles()])
        {
            fs::create_dir_all(&directory).map_err(Error::io("create the directory", &directory))?;
        }
        Ok(())
    }

    /// Removes all that only the steps need.
    ///
    /// # Errors
    /// [`Error::Io`] if that fails.
    pub fn clean_up(&self) -> Result<()> {
        remove_directory(&self.job)
    }

    /// The directory of all results.
    pub fn output(&self) -> &Path {
        &self.output
    }

    /// What scan decided: lattice, units, sources.
    pub fn plan(&self) -> PathBuf {
        self.job.join("plan.json")
    }

    /// The points on their way from the inputs to the leaves.
    pub fn spill(&self) -> PathBuf {
        self.job.join("points.spill")
    }

    /// The k-d tree and where the spill holds each leaf's points.
    pub fn tree(&self) -> PathBuf {
        self.job.join("tree.json")
    }

    /// The sites and closed triangles of leaf `tile`.
    pub fn leaf(&self, tile: usize) -> PathBuf {
        self.job.join(format!("leaves/{tile:06}.leaf"))
    }

    /// What tree node `node` hands to its parent.
    pub fn frontier(&self, node: usize) -> PathBuf {
        self.job.join(format!("nodes/{node:06}.frontier"))
    }

    /// The triangles that inner node `node` contributes.
    pub fn seam(&self, node: usize) -> PathBuf {
        self.job.join(format!("nodes/{node:06}.seam"))
    }

    /// The frontier of leaf `tile` as far as the leaf knows it.
    pub fn rim_draft(&self, tile: usize) -> PathBuf {
        self.job.join(format!("rims/{tile:06}.draft"))
    }

    /// The finished rim vertices of leaf `tile`.
    pub fn rim(&self, tile: usize) -> PathBuf {
        self.job.join(format!("rims/{tile:06}.rim"))
    }

    /// The pixels of the preview that `tile` covers.
    pub fn preview_fragment(&self, tile: usize) -> PathBuf {
        self.job.join(format!("preview/{tile:06}.pixels"))
    }

    /// The directory of the tiles.
    pub fn tiles(&self) -> PathBuf {
        self.output.join("tiles")
    }

    /// The GLB of `tile`.
    pub fn tile(&self, tile: usize) -> PathBuf {
        self.tiles().join(format!("{tile:06}.glb"))
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

/// Reads what [`write_json`] wrote.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, [`Error::Broken`] if it is not what a step writes.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = fs::read(path).map_err(Error::io("read", path))?;
    serde_json::from_slice(&text).map_err(|e| Error::Broken(format!("{}: {e}", path.display())))
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
