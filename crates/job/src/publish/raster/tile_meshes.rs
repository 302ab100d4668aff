//! The tiles that a raster is drawn from.

use crate::index::TileIndex;
use crate::publish::side_files::EachTile;
use crate::records::ExactTile;
use delaunay::geometry::Bounds;
use std::path::Path;
use sys::{Error, Result, interrupt};
use tiles::color::to_srgb;
use tiles::frame::Frame;
use tiles::gltf::read::{TileFile, read_surface, read_tile};
use tiles::raster::window::LatticeMesh;

/// A tile with triangles, and the box around them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileBox {
    pub(crate) tile: TileIndex,
    pub(crate) bounds: Bounds<2>,
    /// The lowest and the highest height.
    pub(crate) heights: [i32; 2],
}

/// Returns all tiles with triangles.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on a store.
pub(crate) fn boxes(tiles: &dyn EachTile) -> Result<Vec<TileBox>> {
    let mut boxes = Vec::new();
    tiles.visit(&mut |store, tile| {
        interrupt::check()?;
        if let Some(Bounds { min, max }) = ExactTile::load(store, tile)?.summary.bounds() {
            let bounds = Bounds { min: [min[0], min[1]], max: [max[0], max[1]] };
            boxes.push(TileBox { tile, bounds, heights: [min[2], max[2]] });
        }
        Ok(())
    })?;
    Ok(boxes)
}

/// Returns the mesh of the tile at `path` on the lattice, of which `frame` is the scene.
///
/// # Errors
/// [`Error::Io`] or [`Error::Input`] if the file cannot be read or is damaged.
pub(crate) fn lattice_mesh(path: &Path, frame: &Frame) -> Result<LatticeMesh> {
    mesh_of(&read_surface(path)?, path, frame)
}

/// As [`lattice_mesh`]. Also returns the sRGB colours of the vertices.
///
/// # Errors
/// As [`lattice_mesh`]; [`Error::Input`] if vertices have no colours.
pub(crate) fn colored_lattice_mesh(path: &Path, frame: &Frame) -> Result<(LatticeMesh, Vec<[u8; 3]>)> {
    let file = read_tile(path)?;
    let mut colors = Vec::new();
    for part in &file.parts {
        let of_part = part.colors.as_ref().ok_or_else(|| Error::input(path, "a mesh has no colours"))?;
        colors.extend(of_part.iter().map(|[red, green, blue, _]| [*red, *green, *blue].map(to_srgb)));
    }
    Ok((mesh_of(&file, path, frame)?, colors))
}

fn mesh_of(TileFile { parts, .. }: &TileFile, path: &Path, frame: &Frame) -> Result<LatticeMesh> {
    let mut mesh = LatticeMesh::default();
    for part in parts {
        let first = mesh.positions.len() as u32;
        let points = frame.points(&part.positions, part.translation, part.scale);
        let off_lattice = |world| Error::input(path, format!("the vertex at {world:?} is not on the job's lattice"));
        mesh.positions.extend(points.map_err(off_lattice)?);
        mesh.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|v| first + v)));
    }
    Ok(mesh)
}
