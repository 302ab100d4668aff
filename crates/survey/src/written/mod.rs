//! A difference as files: a raster of signed differences, and the later terrain with colours that show them.
//!
//! Both are made tile by tile and window by window, so memory stays bounded. They wait in a folder of their own until all of them are whole
//! (`folder.rs`).

pub(crate) mod folder;
pub(crate) mod ramp;
pub(crate) mod waiting_blocks;

mod colored_tiles;
mod raster;

use crate::common_lattice::CommonLattice;
use crate::tile_meshes::{MeshCache, TileFacts};
use crate::written::colored_tiles::ColoredTiles;
use crate::written::folder::DifferenceFolder;
use crate::written::ramp::{Legend, round_up, spacing};
use crate::written::raster::{DifferenceRaster, DrawnRaster};
use overlay::{FixedSum, Rectangle};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use sys::{Error, Result, Warnings};
use terrain::FinishedTerrain;

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

/// Two terrains that have been compared.
pub(crate) struct Compared<'a> {
    pub(crate) terrains: [&'a FinishedTerrain; 2],
    pub(crate) lattice: &'a CommonLattice,
    /// Of all tiles of each terrain.
    pub(crate) facts: [&'a [TileFacts]; 2],
    /// The area of each in square steps.
    pub(crate) areas: [FixedSum; 2],
    /// Tiles of the earlier terrain.
    pub(crate) cache: &'a MeshCache<'a>,
    /// How many tiles may be in memory at the same time.
    pub(crate) lanes: usize,
    /// About how many bytes of memory may be used.
    pub(crate) memory: u64,
    /// Smaller changes count as none, in units of heights.
    pub(crate) threshold: f64,
    /// The greatest rise or fall, in steps.
    pub(crate) greatest: f64,
}

impl Compared<'_> {
    /// Returns the smallest rectangle around both terrains' common area, in steps of the common lattice, which may be empty.
    fn common_box(&self) -> Rectangle {
        let around = |facts: &[TileFacts]| facts.iter().fold(Rectangle::EMPTY, |all, tile| all.joined(tile.bounds));
        around(self.facts[0]).common(around(self.facts[1]))
    }

    /// Returns the side of a cell in units of x and y that suits the finer terrain.
    fn usual_resolution(&self) -> f64 {
        let of = |k: usize| spacing(self.areas[k], self.facts[k].iter().map(|tile| tile.triangles).sum());
        let steps = [0, 1].into_iter().filter_map(of).fold(f64::INFINITY, f64::min);
        round_up(if steps.is_finite() { steps } else { 1.0 } * self.lattice.step_lengths()[0])
    }

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
        let range = output.range.unwrap_or_else(|| self.usual_range(drawn.as_ref()));
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

    /// Returns the range of colours in units of heights: nearly all changes are below it, and none is far below.
    fn usual_range(&self, drawn: Option<&DrawnRaster>) -> f64 {
        let step = self.lattice.step_lengths()[1];
        let greatest = (self.greatest * step).max(step);
        let usual = drawn.and_then(|drawn| drawn.changes.usual_limit(self.threshold as f32));
        round_up(usual.map_or(greatest, |usual| f64::from(usual).min(greatest)).max(self.threshold).max(step))
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

/// Refuses a number of cells that no file holds.
pub(crate) fn refuse_too_many(resolution: f64, [width, height]: [f64; 2]) -> Result<()> {
    const MOST: f64 = (1u64 << 38) as f64;
    const MOST_ALONG: f64 = (i32::MAX - 2) as f64;
    let [columns, rows] = [width, height].map(|side| (side / resolution).ceil() + 1.0);
    if columns <= MOST_ALONG && rows <= MOST_ALONG && columns * rows <= MOST {
        return Ok(());
    }
    let factor = (columns * rows / MOST).sqrt().max(columns.max(rows) / MOST_ALONG);
    Err(Error::Config(format!(
        "--resolution {resolution} makes {columns:.0} x {rows:.0} cells, more than a file holds: give {} or more",
        round_up(resolution * factor)
    )))
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
