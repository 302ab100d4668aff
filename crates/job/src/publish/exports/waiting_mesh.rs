//! The numbered mesh, in files of its own until all formats are written.

use exports::{MeshSource, NumberedTile};
use std::fs::File;
use std::ops::Range;
use std::path::PathBuf;
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault};

/// Bytes of a vertex or a triangle: three numbers.
const ELEMENT: u64 = 12;

/// Bytes of a colour.
const COLOR: u64 = 3;

/// A file of elements of the same size.
struct StoredElements {
    path: PathBuf,
    file: File,
    bytes: u64,
    /// Bytes of an element.
    element: u64,
}

impl StoredElements {
    fn create(path: PathBuf, element: u64) -> Result<StoredElements> {
        let file = disk::create(&path).map_err(Error::io("create", &path))?;
        Ok(StoredElements { path, file, bytes: 0, element })
    }

    fn add(&mut self, elements: &[u8]) -> Result<()> {
        disk::write_all_at(&self.file, elements, self.bytes).map_err(Error::io("write", &self.path))?;
        self.bytes += elements.len() as u64;
        Ok(())
    }

    fn read(&self, range: &Range<u64>, elements: &mut [u8]) -> Result<()> {
        let mut read = || read_exact_at(&self.file, elements, range.start * self.element);
        fault::read("read-result").and_then(|()| read()).map_err(Error::io("read", &self.path))
    }

    fn remove(self) -> Result<()> {
        drop(self.file);
        disk::remove_file(&self.path).map_err(Error::io("remove", &self.path))
    }
}

/// The vertices and triangles of a numbered mesh.
pub(crate) struct WaitingMesh<'a> {
    vertices: StoredElements,
    triangles: StoredElements,
    /// `None` if no format wants colours, or tiles have none.
    colors: Option<StoredElements>,
    /// Is told of triangles that were read.
    done: &'a (dyn Fn(u64) + Sync),
}

impl<'a> WaitingMesh<'a> {
    /// Makes the files at these paths: of vertices, triangles and, if wanted, colours.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn create(
        [vertices, triangles, colors]: [PathBuf; 3],
        has_colors: bool,
        done: &'a (dyn Fn(u64) + Sync),
    ) -> Result<WaitingMesh<'a>> {
        Ok(WaitingMesh {
            vertices: StoredElements::create(vertices, ELEMENT)?,
            triangles: StoredElements::create(triangles, ELEMENT)?,
            colors: has_colors.then(|| StoredElements::create(colors, COLOR)).transpose()?,
            done,
        })
    }

    /// Tells whether vertices have colours.
    pub(crate) fn has_colors(&self) -> bool {
        self.colors.is_some()
    }

    /// Adds the next tile. `colors` are those of the positions that its surface was made of.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&mut self, tile: &NumberedTile, colors: &[[u8; 3]]) -> Result<()> {
        if let Some(stored) = &mut self.colors {
            let of_new: Vec<[u8; 3]> = tile.origins.iter().map(|&origin| colors[origin as usize]).collect();
            stored.add(of_new.as_flattened())?;
        }
        self.vertices.add(bytemuck::cast_slice(&tile.new_vertices))?;
        self.triangles.add(bytemuck::cast_slice(&tile.triangles))
    }

    /// Removes the files.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn remove(self) -> Result<()> {
        self.colors.map_or(Ok(()), StoredElements::remove)?;
        self.vertices.remove()?;
        self.triangles.remove()
    }
}

fn length(range: &Range<u64>) -> usize {
    (range.end - range.start) as usize
}

impl MeshSource for WaitingMesh<'_> {
    fn vertices(&self, numbers: Range<u64>) -> Result<Vec<[i32; 3]>> {
        let mut vertices = vec![[0; 3]; length(&numbers)];
        self.vertices.read(&numbers, bytemuck::cast_slice_mut(&mut vertices))?;
        Ok(vertices)
    }

    fn triangles(&self, numbers: Range<u64>) -> Result<Vec<[u32; 3]>> {
        let mut triangles = vec![[0; 3]; length(&numbers)];
        self.triangles.read(&numbers, bytemuck::cast_slice_mut(&mut triangles))?;
        (self.done)(triangles.len() as u64);
        Ok(triangles)
    }

    fn colors(&self, numbers: Range<u64>) -> Result<Option<Vec<[u8; 3]>>> {
        let Some(stored) = &self.colors else { return Ok(None) };
        let mut colors = vec![[0; 3]; length(&numbers)];
        stored.read(&numbers, colors.as_flattened_mut())?;
        Ok(Some(colors))
    }
}
