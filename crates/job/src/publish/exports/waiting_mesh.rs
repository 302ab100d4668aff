//! The numbered mesh, in two files of its own until all formats are written.

use exports::{MeshSource, NumberedTile};
use std::fs::File;
use std::ops::Range;
use std::path::PathBuf;
use sys::positional_io::read_exact_at;
use sys::{Error, Result, disk, fault};

/// Bytes of a vertex or a triangle: three numbers.
const ELEMENT: u64 = 12;

/// A file of elements with three numbers each.
struct StoredElements {
    path: PathBuf,
    file: File,
    bytes: u64,
}

impl StoredElements {
    fn create(path: PathBuf) -> Result<StoredElements> {
        let file = disk::create(&path).map_err(Error::io("create", &path))?;
        Ok(StoredElements { path, file, bytes: 0 })
    }

    fn add(&mut self, elements: &[u8]) -> Result<()> {
        disk::write_all_at(&self.file, elements, self.bytes).map_err(Error::io("write", &self.path))?;
        self.bytes += elements.len() as u64;
        Ok(())
    }

    fn read(&self, range: &Range<u64>, elements: &mut [u8]) -> Result<()> {
        let mut read = || read_exact_at(&self.file, elements, range.start * ELEMENT);
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
    /// Is told of triangles that were read.
    done: &'a (dyn Fn(u64) + Sync),
}

impl<'a> WaitingMesh<'a> {
    /// Makes the files at these paths.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn create(
        [vertices, triangles]: [PathBuf; 2],
        done: &'a (dyn Fn(u64) + Sync),
    ) -> Result<WaitingMesh<'a>> {
        Ok(WaitingMesh {
            vertices: StoredElements::create(vertices)?,
            triangles: StoredElements::create(triangles)?,
            done,
        })
    }

    /// Adds the next tile.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn add(&mut self, tile: &NumberedTile) -> Result<()> {
        self.vertices.add(bytemuck::cast_slice(&tile.new_vertices))?;
        self.triangles.add(bytemuck::cast_slice(&tile.triangles))
    }

    /// Removes the files.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn remove(self) -> Result<()> {
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
}
