//! The results of a finished job: what they are, and the exact vertices and triangles of each tile.

use crate::error::{Error, Result};
use crate::source_grid::SourceGrid;
use crate::system::TerrainSystem;
use lattice::Lattice;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use sys::disk;
use tiles::checksums::{Checksum, parse_list, read_file, seal};
use tiles::file_names::OutputFiles;
use tiles::frame::Extras;
use tiles::gltf::read::{held_bytes, read_extras, read_surface_of};

/// What to do about results that are not as the job wrote them.
const RUN_AGAIN: &str = "run the job again (gdt-batch verify lists what else is wrong)";

/// The results of a finished job.
#[derive(Clone, Debug)]
pub struct FinishedTerrain {
    directory: PathBuf,
    /// All files that the list names, by their paths from the directory.
    files: BTreeMap<String, Checksum>,
    /// The tiles in the order of their names, with their checksums.
    tiles: Vec<(PathBuf, Checksum)>,
    extras: Extras,
    grid: SourceGrid,
    lattice: Lattice,
    system: TerrainSystem,
}

/// A part of a tile: vertices on the lattice, and triangles between them.
#[derive(Clone, Debug)]
pub struct LatticePart {
    /// x, y and z in steps of the terrain's lattice.
    pub points: Vec<[i32; 3]>,
    /// The corners of each triangle: numbers of points.
    pub triangles: Vec<[u32; 3]>,
}

/// What is needed of `report.json`.
#[derive(Deserialize)]
struct ReportFacts {
    lattice: Option<Lattice>,
    file_list: Option<Checksum>,
}

/// Refuses results among which some may be of one job and some of another: a job has a journal until all its results are in place,
/// and removes the report of the job before first.
///
/// # Errors
/// [`Error::Unfinished`], or [`sys::Error::Io`] if the system cannot tell.
pub fn refuse_unfinished(directory: &Path) -> Result<()> {
    let output = OutputFiles::new(directory);
    let is_there = |path: PathBuf| disk::exists(&path).map_err(sys::Error::io("read", &path));
    if is_there(output.journal())? && !is_there(output.report())? {
        return Err(Error::Unfinished { directory: directory.into() });
    }
    Ok(())
}

impl FinishedTerrain {
    /// Opens the results in the output `directory` of a job, and compares the report and the list of files with their checksums.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if it is no output directory, [`Error::Unfinished`] if the job is not finished, [`sys::Error::Input`] if
    /// something is not as the job wrote it, [`sys::Error::Io`].
    pub fn open(directory: &Path) -> Result<FinishedTerrain> {
        if !directory.is_dir() {
            let what = if directory.exists() { "is a file" } else { "is not there" };
            return Err(no_output(directory, what).into());
        }
        refuse_unfinished(directory)?;
        let output = OutputFiles::new(directory);
        let facts = read_report(&output)?;
        let files = read_list(&output, facts.file_list)?;
        let is_tile = |path: &Path| path.starts_with(output.tiles());
        let with_paths = files.iter().map(|(name, checksum)| (directory.join(name), *checksum));
        let mut tiles: Vec<(PathBuf, Checksum)> = with_paths.filter(|(path, _)| is_tile(path)).collect();
        tiles.sort_unstable_by(|a, b| a.0.cmp(&b.0));
        if let Some((gone, _)) = tiles.iter().find(|(path, _)| !path.exists()) {
            return Err(sys::Error::input(gone, format!("the tile is missing: {RUN_AGAIN}")).into());
        }
        let Some((first, _)) = tiles.first() else { return Err(no_output(directory, "has no tiles").into()) };
        let extras = read_extras(first)?;
        let damaged = |what: String| sys::Error::input(first, format!("{what}: {RUN_AGAIN}"));
        let grid = SourceGrid::new(&extras).map_err(|error| damaged(error.to_string()))?;
        let lattice = match facts.lattice {
            Some(lattice) if is_lattice_of(&lattice, &extras) => lattice,
            _ => return Err(damaged("it lies on another lattice than that of report.json".into()).into()),
        };
        let georeference = listed_file(&output.georeference(), directory, &files)?;
        let system = TerrainSystem::new(&extras, georeference.as_deref());
        let files = files.into_iter().collect();
        Ok(FinishedTerrain { directory: directory.into(), files, tiles, extras, grid, lattice, system })
    }

    /// Returns the output directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Returns the number of tiles.
    pub fn count(&self) -> usize {
        self.tiles.len()
    }

    /// Returns the numbers that lead from a scene back to the source.
    pub fn extras(&self) -> &Extras {
        &self.extras
    }

    /// Returns the lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Returns the CRS and the units.
    pub fn system(&self) -> &TerrainSystem {
        &self.system
    }

    /// Returns the files of the terrain but its report, by their paths from the directory with slashes, in the order of their names.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    /// Reads one of [`files`](FinishedTerrain::files), and compares it with its checksum.
    ///
    /// # Errors
    /// [`sys::Error::Input`] if it is not as the job wrote it, [`sys::Error::Io`].
    pub fn read_file(&self, name: &str) -> sys::Result<Vec<u8>> {
        let path = self.directory.join(name);
        match self.files.get(name) {
            Some(wanted) => read_checked(&path, *wanted, GONE),
            None => Err(sys::Error::input(&path, format!("it is not one of the results: {RUN_AGAIN}"))),
        }
    }

    /// Returns the bytes that the meshes of the largest tile take, at most.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Input`] if the description of a tile cannot be read.
    pub fn largest_tile(&self) -> sys::Result<u64> {
        self.tiles.iter().try_fold(0, |most, (path, _)| Ok(most.max(held_bytes(path)?)))
    }

    /// Reads tile number `number` of [`count`](FinishedTerrain::count), and compares it with its checksum.
    ///
    /// # Errors
    /// [`sys::Error::Input`] if it is not as the job wrote it, [`sys::Error::Io`].
    pub fn read_tile(&self, number: usize) -> sys::Result<Vec<LatticePart>> {
        let Some((path, wanted)) = self.tiles.get(number) else { return Ok(Vec::new()) };
        let damaged = |what: &str| sys::Error::input(path, format!("{what}: {RUN_AGAIN}"));
        let bytes = read_checked(path, *wanted, "the tile is gone")?;
        let tile = read_surface_of(path, bytes)?;
        if tile.extras != self.extras {
            return Err(damaged("it comes from another job than the first tile"));
        }
        let part = |mesh: &tiles::gltf::read::TilePart| {
            let points = self.grid.points_of(mesh).ok_or_else(|| damaged("a vertex is not on the lattice"))?;
            Ok(LatticePart { points, triangles: mesh.triangles.clone() })
        };
        tile.parts.iter().map(part).collect()
    }
}

fn no_output(path: &Path, what: &str) -> sys::Error {
    sys::Error::Config(format!(
        "{} {what}: name the output directory of a finished job, such as the cloud-terrain that `gdt-batch cloud.laz` writes",
        path.display()
    ))
}

fn read_report(output: &OutputFiles) -> Result<ReportFacts> {
    let path = output.report();
    let text = match read_file(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(no_output(output.directory(), "has no report.json").into());
        }
        text => text.map_err(sys::Error::io("read", &path))?,
    };
    let is_whole = seal(&text).is_some_and(|(own, found)| own == found);
    let facts = serde_json::from_slice(&text).ok().filter(|_| is_whole);
    facts.ok_or_else(|| sys::Error::input(&path, format!("it is not as the job wrote it: {RUN_AGAIN}")).into())
}

fn read_list(output: &OutputFiles, wanted: Option<Checksum>) -> Result<Vec<(String, Checksum)>> {
    let path = output.checksums();
    let damaged = |what: &str| sys::Error::input(&path, format!("{what}: {RUN_AGAIN}"));
    let text = match read_file(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Err(damaged("the list of files is gone").into()),
        text => text.map_err(sys::Error::io("read", &path))?,
    };
    let stays_inside = |name: &str| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    let files = parse_list(&text).filter(|files| files.iter().all(|(name, _)| stays_inside(name)));
    let is_whole = wanted == Some(Checksum::of(&text));
    Ok(files.filter(|_| is_whole).ok_or_else(|| damaged("it is not as the job wrote it"))?)
}

/// Reads a file that the list may have; `None` if it has not.
fn listed_file(path: &Path, directory: &Path, files: &[(String, Checksum)]) -> Result<Option<Vec<u8>>> {
    let Some((_, wanted)) = files.iter().find(|(name, _)| directory.join(name) == path) else { return Ok(None) };
    Ok(Some(read_checked(path, *wanted, GONE)?))
}

const GONE: &str = "the file is gone";

/// Reads a file and compares it with its checksum. `gone` says that it is not there.
fn read_checked(path: &Path, wanted: Checksum, gone: &str) -> sys::Result<Vec<u8>> {
    let damaged = |what: &str| sys::Error::input(path, format!("{what}: {RUN_AGAIN}"));
    let bytes = read_file(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => damaged(gone),
        _ => sys::Error::io("read", path)(error),
    })?;
    match Checksum::of(&bytes) == wanted {
        true => Ok(bytes),
        false => Err(damaged("it is not as the job wrote it, by its checksum")),
    }
}

fn is_lattice_of(lattice: &Lattice, extras: &Extras) -> bool {
    let number = |decimal: rust_decimal::Decimal| decimal.to_string().parse::<f64>().unwrap_or(f64::NAN);
    lattice.offset.map(number) == extras.offset
        && [lattice.resolution, lattice.resolution_z].map(number) == [extras.resolution, extras.resolution_z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn what_is_no_finished_output_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |path: &Path| FinishedTerrain::open(path).unwrap_err();
        assert!(refused(&folder.path().join("none")).to_string().contains("is not there"));
        assert!(refused(folder.path()).to_string().contains("has no report.json"));
        fs::create_dir(folder.path().join("job")).unwrap();
        fs::write(folder.path().join("job/journal"), "").unwrap();
        assert!(matches!(refused(folder.path()), Error::Unfinished { .. }));
        fs::write(folder.path().join("report.json"), "{}").unwrap();
        let error = refused(folder.path());
        assert!(
            error.kind() == sys::ErrorKind::Input && error.to_string().contains("not as the job wrote it"),
            "{error}"
        );
    }
}
