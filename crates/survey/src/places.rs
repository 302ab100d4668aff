//! Files of lines and areas, brought into the CRS of a terrain.

use crs::DatumRule;
use points::lines::line_crs::{SystemOfPoints, bring_to_points};
use points::lines::options::LineOptions;
use points::lines::{LineFile, read_lines};
use std::path::Path;
use sys::{Error, Result, Warnings};
use terrain::TerrainSystem;

/// Reads the lines and areas of a file, with their names, in the CRS of the terrain.
///
/// # Errors
/// [`sys::Error::Input`] if the file is bad, [`sys::Error::Config`] if there is no way from its CRS to that of the terrain, [`sys::Error::Io`].
pub(crate) fn read_places(
    path: &Path,
    system: &TerrainSystem,
    memory: u64,
    warnings: &mut Warnings,
) -> Result<LineFile> {
    if !path.is_file() {
        let what = if path.exists() { "is no file" } else { "is not there" };
        return Err(Error::Config(format!("{} {what}: name a Shapefile, GeoPackage or GeoJSON file", path.display())));
    }
    let options = LineOptions::of_named_places(path);
    let mut file = read_lines(path, &options, memory)?;
    let to = SystemOfPoints { crs: &system.crs, height_metres: system.crs.vertical, datums: DatumRule::Close };
    bring_to_points(&mut file, &options, &to)?;
    warnings.extend_from_file(path, &file.warnings);
    Ok(file)
}
