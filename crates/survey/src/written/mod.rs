//! A difference as files: a raster of signed differences, and the later terrain with colours that show them.
//!
//! Both are made tile by tile and window by window, so memory stays bounded. They wait in a folder of their own until all of them are whole
//! (`folder.rs`).

pub(crate) mod folder;
pub(crate) mod ramp;
pub(crate) mod waiting_blocks;

mod colored_tiles;
pub(crate) mod compared;
mod raster;

use crate::written::colored_tiles::ColoredTiles;
use crate::written::compared::Compared;
use crate::written::folder::DifferenceFolder;
use crate::written::ramp::Legend;
use crate::written::raster::DifferenceRaster;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use sys::{Result, Warnings};

/// What is to be written.
#[derive(Clone, Debug)]
pub struct DifferenceOutput {
    /// The folder: a new one, or that of an earlier difference.
    pub directory: PathBuf,
    /// The side of a cell of the raster in units of x and y; `None` for one that suits the spacing of the points.
    pub resolution: Option<f64>,
    /// The change with the strongest colours in units of heights; `None` for one that suits the changes.
    pub range: Option<f64>,
}

/// The files of a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WrittenDifference {
    /// The folder.
    pub directory: String,
    /// The raster of differences; `None` if the terrains do not overlap.
    pub raster: Option<WrittenRaster>,
    /// The later terrain in colours; `None` if it has no tileset.
    pub mesh: Option<WrittenMesh>,
}

/// A raster of differences.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WrittenRaster {
    /// The path of the file.
    pub file: String,
    /// The side of a cell in units of x and y.
    pub resolution: f64,
    /// The unit of x and y.
    pub unit: String,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Cells with a difference.
    pub cells: u64,
}

/// A terrain in the colours of a difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WrittenMesh {
    /// The path of the tileset.
    pub file: String,
    /// The number of its tiles, of all levels.
    pub tiles: u64,
    /// What the colours mean.
    pub legend: Legend,
}

impl Compared<'_> {
    /// Writes all files.
    ///
    /// # Errors
    /// [`Error::Config`] if the raster has too many cells, [`Error::Input`] if a tile is not as the job wrote it, [`Error::Io`],
    /// [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        output: &DifferenceOutput,
        folder: &DifferenceFolder,
        warnings: &mut Warnings,
    ) -> Result<WrittenDifference> {
        folder.begin()?;
        let resolution = output.resolution.unwrap_or_else(|| self.usual_resolution());
        let drawn = match DifferenceRaster::new(self, resolution)? {
            Some(raster) => Some(raster.write(folder)?),
            None => None,
        };
        let [unit, unit_z] = self.terrains[1].system().units();
        let range = output.range.unwrap_or_else(|| self.usual_range(drawn.as_ref().map(|drawn| &drawn.changes)));
        let legend = Legend::new(range, self.threshold, unit_z);
        let tiles = ColoredTiles::new(self, legend).write(folder)?;
        if tiles.is_none() {
            warnings.push(
                "the later terrain has no tileset.json, so there is no mesh in colours; fix: run its job with [output] format = [\"3dtiles\"]",
            );
        }
        let path = |name: &str| shown(&output.directory.join(name));
        let raster = drawn.map(|drawn| WrittenRaster {
            file: path(folder::RASTER),
            resolution,
            unit,
            size: drawn.size,
            cells: drawn.changes.total(),
        });
        let mesh = tiles.map(|(tiles, legend)| WrittenMesh { file: path(folder::TILESET), tiles, legend });
        Ok(WrittenDifference { directory: shown(&output.directory), raster, mesh })
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

impl fmt::Display for WrittenDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f)?;
        if let Some(WrittenRaster { file, resolution, unit, size: [columns, rows], .. }) = &self.raster {
            writeln!(
                f,
                "{:<24}{file}, {columns} x {rows} cells, side {resolution} {}",
                "raster of differences",
                short_name(unit)
            )?;
        }
        if let Some(WrittenMesh { file, legend: Legend { range, threshold, unit, .. }, .. }) = &self.mesh {
            writeln!(f, "{:<24}{file}; to see it: gdt-batch view {}", "mesh in colours", self.directory)?;
            let unit = short_name(unit);
            writeln!(f, "{:<24}from red (cut of {range} {unit} or more) over white to blue (fill)", "colours")?;
            if *threshold > 0.0 {
                writeln!(f, "{:<24}light grey below {threshold} {unit}, grey outside of the common area", "")?;
            } else {
                writeln!(f, "{:<24}grey outside of the common area", "")?;
            }
        }
        Ok(())
    }
}

/// Returns a unit of length as tables have it.
pub(crate) fn short_name(unit: &str) -> &str {
    match unit {
        "foot" => "ft",
        "US survey foot" => "US ft",
        "kilometre" => "km",
        other => other,
    }
}
