//! Writing the exports.

use crate::durable::atomic_file::{PendingFile, PendingWriter};
use crate::durable::directory::JobDirectory;
use crate::plan::job_plan::Plan;
use crate::publish::exports::export_limits::too_large;
use crate::publish::exports::waiting_mesh::WaitingMesh;
use crate::publish::raster::tile_meshes::{TileBox, boxes, colored_lattice_mesh, lattice_mesh};
use crate::publish::side_files::EachTile;
use crate::tiles::write_tile::TileStats;
use breaklines::Breaklines;
use crs::Unit;
use exports::{
    LengthUnit, Mesh, ObjOffset, SystemNames, TileSurface, Units, VertexNumbers, polylines, write_dxf, write_landxml,
    write_obj, write_ply,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sys::{Error, Result, interrupt};
use tiles::frame::Frame;
use tiles::gltf::read::read_tile;
use tiles::options::ExportFormat;

/// A file with the exact mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExportedFile {
    /// Its name.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// The number of vertices.
    pub vertices: u64,
    /// The number of triangles.
    pub triangles: u64,
    /// What to add to its x, y and z for source coordinates, in source units; `None` if they are source coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<[i64; 3]>,
}

/// What came of the exports.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Exports {
    /// The files that are written.
    pub(crate) files: Vec<ExportedFile>,
    /// What the user should know.
    pub(crate) warnings: Vec<String>,
}

/// The files in which the numbered mesh waits: vertices, triangles and colours.
const FILES: [&str; 3] = ["exports.vertices", "exports.triangles", "exports.colors"];

/// The exports that are to be written.
pub(crate) struct ExportWork<'a> {
    plan: &'a Plan,
    frame: &'a Frame,
    formats: Vec<ExportFormat>,
    tiles: Vec<TileBox>,
    triangles: u64,
    warnings: Vec<String>,
}

impl<'a> ExportWork<'a> {
    /// Looks at what is to be exported of a job whose tiles have the scene of `frame`; `None` if the user wants nothing.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on a store.
    pub(crate) fn of(
        plan: &'a Plan,
        frame: &'a Frame,
        tiles: &dyn EachTile,
        written: &TileStats,
    ) -> Result<Option<ExportWork<'a>>> {
        let output = &plan.options.output;
        let (mut formats, mut warnings) = (Vec::new(), Vec::new());
        for format in output.export.formats() {
            match too_large(format, written.triangles, output.max_error) {
                Some(warning) => warnings.push(warning),
                None => formats.push(format),
            }
        }
        if output.export.is_empty() {
            return Ok(None);
        }
        let tiles = if formats.is_empty() { Vec::new() } else { boxes(tiles)? };
        let mut work = ExportWork { plan, frame, formats, tiles, triangles: written.triangles, warnings };
        work.warnings.extend(work.unit_warning());
        Ok(Some(work))
    }

    /// Returns how often a triangle is read.
    pub(crate) fn reads(&self) -> u64 {
        match self.formats.len() as u64 {
            0 => 0,
            formats => self.triangles * (formats + 1),
        }
    }

    /// Writes the files from the tiles, which must have their names. Calls `done` with numbers of triangles that were read.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a file, [`Error::Interrupted`].
    pub(crate) fn write(
        &self,
        directory: &JobDirectory,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<(Exports, Vec<PendingFile>)> {
        let mut exports = Exports { files: Vec::new(), warnings: self.warnings.clone() };
        if self.formats.is_empty() {
            return Ok((exports, Vec::new()));
        }
        let has_colors = self.formats.contains(&ExportFormat::Ply) && self.tiles_have_colors(directory)?;
        let mut source = WaitingMesh::create(FILES.map(|name| directory.scratch(name)), has_colors, done)?;
        let numbers = self.number(directory, &mut source, done)?;
        let lines = self.plan.built_breaklines()?.as_deref().map(lines_of).unwrap_or_default();
        let mesh = Mesh {
            source: &source,
            summary: numbers.summary(),
            lattice: &self.plan.lattice,
            units: self.units(),
            system: self.system(),
            lines: &lines,
            copyright: self.plan.options.output.copyright(),
        };
        let mut pending = Vec::new();
        for &format in &self.formats {
            let (file, offset) = write_file(&mesh, format, directory)?;
            let (name, bytes) = (format.file_name().to_owned(), file.bytes);
            let (vertices, triangles) = (mesh.summary.vertices.into(), mesh.summary.triangles);
            exports.files.push(ExportedFile { file: name, bytes, vertices, triangles, offset });
            pending.push(file);
        }
        source.remove()?;
        Ok((exports, pending))
    }

    /// Numbers the vertices of all tiles, and adds their triangles to `mesh`. As many tiles as there are threads are in memory at a time.
    fn number(
        &self,
        directory: &JobDirectory,
        mesh: &mut WaitingMesh,
        done: &(dyn Fn(u64) + Sync),
    ) -> Result<VertexNumbers> {
        let mut numbers = VertexNumbers::default();
        for tiles in self.tiles.chunks(rayon::current_num_threads().max(1)) {
            interrupt::check()?;
            let has_colors = mesh.has_colors();
            let read = |tile: &TileBox| {
                let path = directory.output().tile(tile.tile.number());
                let (mesh, colors) = match has_colors {
                    true => colored_lattice_mesh(&path, self.frame)?,
                    false => (lattice_mesh(&path, self.frame)?, Vec::new()),
                };
                Ok((TileSurface::new(&mesh.positions, &mesh.triangles), colors))
            };
            let surfaces: Vec<(TileSurface, Vec<[u8; 3]>)> =
                tiles.par_iter().with_max_len(1).map(read).collect::<Result<_>>()?;
            for (surface, colors) in &surfaces {
                let too_many = |_| Error::Broken("a terrain to export has more vertices than triangles allow".into());
                let tile = numbers.add(surface).map_err(too_many)?;
                mesh.add(&tile, colors)?;
                done(tile.triangles.len() as u64);
            }
        }
        Ok(numbers)
    }

    /// Tells whether vertices have colours. All tiles of a job have some, or none has.
    fn tiles_have_colors(&self, directory: &JobDirectory) -> Result<bool> {
        let Some(first) = self.tiles.first() else { return Ok(false) };
        let tile = read_tile(&directory.output().tile(first.tile.number()))?;
        Ok(tile.parts.iter().all(|part| part.colors.is_some()))
    }

    fn units(&self) -> Units {
        let extras = self.frame.extras();
        let unit = |metres| Unit::from_metres(Some(metres));
        let (plane, heights) = (unit(extras.metres_per_unit), unit(extras.metres_per_unit_z));
        Units { plane: length_unit(self.frame), plane_name: plane.name(), height_name: heights.name() }
    }

    /// Warns about heights in another unit than x and y: no format can say that.
    fn unit_warning(&self) -> Option<String> {
        let Units { plane_name, height_name, .. } = self.units();
        (plane_name != height_name && !self.formats.is_empty()).then(|| {
            let names: Vec<&str> = self.formats.iter().map(|format| format.file_name()).collect();
            format!(
                "{}: heights are in {height_name}, x and y in {plane_name}, and programs expect one unit for all; fix: scale the heights \
                 there",
                names.join(", ")
            )
        })
    }

    fn system(&self) -> SystemNames {
        let (crs, metres_z) = (&self.plan.crs, self.frame.extras().metres_per_unit_z);
        let heights = crs.vertical_system.as_ref();
        SystemNames {
            name: crs.name.clone(),
            code: crs.undisputed_code(),
            vertical_name: crs.vertical_name(),
            vertical_code: heights.and_then(|system| system.system_code(metres_z)),
        }
    }
}

/// Returns the unit of x and y as formats name it.
pub(crate) fn length_unit(frame: &Frame) -> LengthUnit {
    match Unit::from_metres(Some(frame.extras().metres_per_unit)) {
        Unit::Metre => LengthUnit::Metre,
        Unit::Foot => LengthUnit::Foot,
        Unit::UsFoot => LengthUnit::UsFoot,
        _ => LengthUnit::Other,
    }
}

/// Writes a file, and returns what its coordinates count from, if that is no source coordinates.
fn write_file(mesh: &Mesh, format: ExportFormat, directory: &JobDirectory) -> Result<(PendingFile, Option<[i64; 3]>)> {
    let mut file = PendingWriter::create(&directory.output().export(format))?;
    let mut out = |bytes: &[u8]| file.write(bytes);
    let mut offset = None;
    match format {
        ExportFormat::Landxml => write_landxml(mesh, &mut out)?,
        ExportFormat::Dxf => write_dxf(mesh, &mut out)?,
        ExportFormat::Ply => write_ply(mesh, &mut out)?,
        ExportFormat::Obj => {
            let from = ObjOffset::of(mesh)?;
            offset = Some(from.0);
            write_obj(mesh, from, &mut out)?;
        }
    }
    Ok((file.finish()?, offset))
}

/// Returns the breaklines as lines in lattice steps.
fn lines_of(breaklines: &Breaklines) -> Vec<Vec<[i32; 3]>> {
    let sites = breaklines.sites();
    let place = |number: u32| {
        let site = &sites[number as usize];
        [site.place[0], site.place[1], site.z.unwrap_or_default()]
    };
    let lines = polylines(breaklines.subsegments(), sites.len());
    lines.into_iter().map(|line| line.into_iter().map(place).collect()).collect()
}
