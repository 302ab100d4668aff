//! The proof of a terrain whose tiles are checked one after the other, as a job writes them, and need not stay.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::Result;
use crate::border_matching::Borders;
use crate::failures::Failure;
use crate::findings::Findings;
use crate::mesh_check::check_mesh;
use crate::report::ReadReport;
use crate::terrain_tiles::TerrainTiles;
use crate::tile_files::TileFiles;
use crate::verdict::{CheckedMesh, Verdict};
use crate::watcher::Unwatched;
use crate::written_files::WrittenFiles;
use sys::Error;
use terrain::{SourceGrid, refuse_unfinished};
use tiles::checksums::Checksum;
use tiles::frame::Extras;
use tiles::gltf::read::{TileFile, read_extras, read_tile};

/// What [`verify`](crate::verify) proves, for tiles that come one after the other: each is checked once, and only its borders and its checksum
/// stay. Breaklines and inputs are not compared.
pub struct GrowingProof {
    memory: u64,
    extras: Extras,
    grid: SourceGrid,
    checked: Mutex<Checked>,
}

/// What stays of the tiles.
struct Checked {
    /// The names of the tiles, in the order in which they came.
    names: Vec<PathBuf>,
    checksums: HashMap<String, Checksum>,
    findings: Findings,
    borders: Borders,
}

impl GrowingProof {
    /// Begins the proof of the terrain that the tile `first` belongs to. It takes about `memory` bytes, and temporary files in the folder
    /// `scratch`.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Input`] if the tile cannot be read, [`crate::Error`] if it lies on no lattice.
    pub fn begin(first: &Path, scratch: &Path, memory: u64) -> Result<GrowingProof> {
        let extras = read_extras(first)?;
        let grid = SourceGrid::new(&extras).map_err(|error| Error::Config(format!("{}: {error}", first.display())))?;
        let (borders, findings) = (Borders::new(scratch, memory / 4), Findings::default());
        let checked = Mutex::new(Checked { names: Vec::new(), checksums: HashMap::new(), findings, borders });
        Ok(GrowingProof { memory, extras, grid, checked })
    }

    /// Checks the tile at `path`, which is no longer needed then. `name` is its name in the list of the results of the job.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the system cannot read it.
    pub fn check(&self, path: &Path, name: &str) -> Result<()> {
        let (_, checksum) = Checksum::of_file(path).map_err(Error::io("read", path))?;
        let tile = read_tile(path);
        let mut checked = self.checked();
        let number = checked.names.len();
        checked.names.push(PathBuf::from(name));
        checked.checksums.insert(name.into(), checksum);
        drop(checked);
        self.check_tile(number, name, tile, false)
    }

    fn checked(&self) -> MutexGuard<'_, Checked> {
        self.checked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn check_tile(&self, number: usize, name: &str, tile: sys::Result<TileFile>, is_cut: bool) -> Result<()> {
        let mut findings = Findings::default();
        let mut borders = Vec::new();
        match tile {
            Ok(tile) if tile.extras == self.extras => {
                for mesh in &tile.parts {
                    let (mut border, _) = check_mesh(mesh, number as u32, &self.grid, &mut findings);
                    if is_cut {
                        findings.cut_triangles += mesh.triangles.len() as u64;
                        border.sites.iter_mut().for_each(|site| site.unshaded = 1);
                    }
                    borders.push(border);
                }
            }
            Ok(_) => {
                let example = || format!("{name} comes from another job than the first tile");
                findings.failures.note(Failure::UnusableTile, number as u32, example);
            }
            Err(error @ Error::Input { .. }) => {
                findings.failures.note(Failure::UnusableTile, number as u32, || error.to_string());
            }
            Err(error) => return Err(error.into()),
        }
        let checked = &mut *self.checked();
        checked.findings = std::mem::take(&mut checked.findings).merge(findings);
        Ok(borders.iter().try_for_each(|border| checked.borders.add(border))?)
    }

    /// Concludes the proof, once all tiles of the finished job in `directory` have been checked. The verdict is that of
    /// [`verify`](crate::verify) on the same tiles.
    ///
    /// # Errors
    /// [`crate::Error::Unfinished`] if the results of the job are not all in place, [`sys::Error::Io`] on files.
    pub fn conclude(self, directory: &Path) -> Result<Verdict> {
        refuse_unfinished(directory)?;
        let report = ReadReport::read(directory);
        let tiles = self.checked().names.clone();
        let files = TileFiles::with_cut(tiles, self.extras.clone(), directory)?;
        let cut = files.paths.par_iter().enumerate().skip(files.terrain);
        cut.try_for_each(|(number, path)| self.check_tile(number, &files.name(number as u32), read_tile(path), true))?;
        let Checked { checksums, findings, borders, .. } =
            self.checked.into_inner().unwrap_or_else(PoisonError::into_inner);
        let written = WrittenFiles::check(directory, report.facts.file_list, &checksums, &Unwatched);
        let matches = borders.match_all(&self.grid, &files)?;
        let terrain = TerrainTiles::check(directory, self.memory)?;
        let mesh = CheckedMesh { files: &files, findings, matches, lines: None, terrain };
        Ok(Verdict::new(mesh, &report, &written, None))
    }
}
