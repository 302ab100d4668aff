//! The height of a geoid above the WGS 84 ellipsoid: what is added to heights above the sea before they are placed on the globe.
//!
//! A number is the same everywhere. A model is known at the nodes of a grid and bilinear between them, so it has no steps where tiles
//! meet. Between nodes there are only IEEE basic operations, and the values at nodes are the same on every machine.

mod block_cache;
mod egm96;
pub mod errors;
mod geotiff;
mod geotiff_tags;
mod gtx;
mod node_grid;
pub mod option;

use crate::geoid::egm96::Egm96;
use crate::geoid::errors::{bad_file, not_opened, refused};
use crate::geoid::geotiff::GeoTiff;
use crate::geoid::gtx::Gtx;
use crate::geoid::node_grid::{NodeGrid, NodeValues, Nodes};
use crate::geoid::option::HeightOffset;
use std::fs::File;
use std::path::Path;
use sys::Error;

/// What is added to heights, place by place.
pub struct Geoid(Source);

enum Source {
    Metres(f64),
    Model { name: String, grid: NodeGrid, values: Box<dyn NodeValues> },
}

impl Geoid {
    /// Returns what `option` says, or 0 everywhere without one. Of a file it reads the header only.
    ///
    /// # Errors
    /// [`Error::Config`] if the file is not there, or is no grid that can be read; [`Error::Io`] if reading fails.
    pub fn open(option: Option<&HeightOffset>) -> Result<Geoid, Error> {
        let (name, (grid, values)) = match option {
            None => return Ok(Geoid(Source::Metres(0.0))),
            Some(HeightOffset::Metres(metres)) => return Ok(Geoid(Source::Metres(*metres))),
            Some(HeightOffset::Egm96) => ("egm96".into(), Egm96::nodes()?),
            Some(HeightOffset::Grid(path)) => {
                (path.file_name().unwrap_or_default().to_string_lossy().into_owned(), open_grid(path)?)
            }
        };
        Ok(Geoid(Source::Model { name, grid, values }))
    }

    /// Returns the metres to add to heights at a place in degrees.
    ///
    /// # Errors
    /// [`Error::Config`] if the model has no height there, or its file is damaged; [`Error::Io`] if reading it fails.
    pub fn at(&self, longitude: f64, latitude: f64) -> Result<f64, Error> {
        let Source::Model { name, grid, values } = &self.0 else { return Ok(self.metres()) };
        grid.interpolate(longitude, latitude, &**values)?.ok_or_else(|| {
            let (why, remedy) = match grid.covers(longitude, latitude) {
                true => (
                    ": it covers the place, but a neighbouring node has NaN, the value for no height, or more than a kilometre".into(),
                    "repair the grid, or take another one",
                ),
                false => (grid.extent(), "take a grid that covers the terrain"),
            };
            refused(&format!(
                "{name} has no height at longitude {longitude:.5}, latitude {latitude:.5}, where the terrain is{why}; {remedy}, \
                 \"egm96\" or a number of metres"
            ))
        })
    }

    /// Returns the name of the model; `None` for a number.
    pub fn model(&self) -> Option<&str> {
        match &self.0 {
            Source::Metres(_) => None,
            Source::Model { name, .. } => Some(name),
        }
    }

    fn metres(&self) -> f64 {
        if let Source::Metres(metres) = self.0 { metres } else { 0.0 }
    }
}

/// Refuses what is no file. Opening a pipe would wait until another process writes to it.
///
/// # Errors
/// [`Error::Config`], or [`Error::Io`] if the system cannot tell.
pub fn require_file(path: &Path) -> Result<(), Error> {
    match path.metadata().map_err(|e| not_opened(path, e))?.is_file() {
        true => Ok(()),
        false => Err(bad_file(path, "it is not a file; name a geoid grid (.gtx or .tif)")),
    }
}

/// Opens a file as what its first bytes say that it is.
fn open_grid(path: &Path) -> Result<Nodes, Error> {
    require_file(path)?;
    let file = File::open(path).map_err(|e| not_opened(path, e))?;
    if geotiff::is_tiff(&file).map_err(Error::io("read", path))? {
        let (grid, values) = GeoTiff::open(path, file)?;
        return Ok((grid, Box::new(values)));
    }
    let (grid, values) = Gtx::open(path, file)?;
    Ok((grid, Box::new(values)))
}

#[cfg(test)]
mod tests;
