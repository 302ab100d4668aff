//! The tiles of a terrain as meshes on a common lattice.

use crate::common_lattice::{LatticeWay, TOO_FINE};
use overlay::{MeshError, Rectangle, TriangleMesh};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use sys::{Error, Result, interrupt};
use terrain::FinishedTerrain;

/// The meshes of a terrain's tiles.
pub(crate) struct TileMeshes<'a> {
    pub(crate) terrain: &'a FinishedTerrain,
    way: LatticeWay,
}

impl<'a> TileMeshes<'a> {
    pub(crate) fn new(terrain: &'a FinishedTerrain, way: LatticeWay) -> TileMeshes<'a> {
        TileMeshes { terrain, way }
    }

    /// Reads tile number `number`.
    ///
    /// # Errors
    /// [`Error::Input`] if it is not as the job wrote it, [`Error::Io`], [`Error::Interrupted`].
    pub(crate) fn read(&self, number: usize) -> Result<TriangleMesh> {
        interrupt::check()?;
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for part in self.terrain.read_tile(number)? {
            let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
            vertices.extend(part.points.iter().map(|point| self.way.point(*point)));
            triangles.extend(part.triangles.iter().map(|corners| corners.map(|v| v.saturating_add(first))));
        }
        let directory = self.terrain.directory();
        TriangleMesh::new(vertices, triangles).map_err(|error| match error {
            MeshError::TooFar => Error::Config(format!(
                "{}: {error}, on the lattice that has the points of both terrains: {TOO_FINE}",
                directory.display()
            )),
            _ => Error::input(directory, format!("tile {number}: {error}")),
        })
    }
}

/// Meshes that were read lately.
pub(crate) struct MeshCache<'a> {
    meshes: &'a TileMeshes<'a>,
    capacity: usize,
    held: Mutex<Held>,
}

#[derive(Default)]
struct Held {
    /// By number of the tile, with the time of the last use.
    meshes: HashMap<usize, (u64, Arc<TriangleMesh>)>,
    time: u64,
}

impl<'a> MeshCache<'a> {
    pub(crate) fn new(meshes: &'a TileMeshes<'a>, capacity: usize) -> MeshCache<'a> {
        MeshCache { meshes, capacity: capacity.max(1), held: Mutex::default() }
    }

    /// Returns the mesh of tile number `number`. Two threads that miss it at the same time may both read it.
    ///
    /// # Errors
    /// Those of [`TileMeshes::read`].
    pub(crate) fn get(&self, number: usize) -> Result<Arc<TriangleMesh>> {
        if let Some(mesh) = self.held.lock().unwrap_or_else(PoisonError::into_inner).used(number) {
            return Ok(mesh);
        }
        let mesh = Arc::new(self.meshes.read(number)?);
        self.held.lock().unwrap_or_else(PoisonError::into_inner).add(number, &mesh, self.capacity);
        Ok(mesh)
    }
}

impl Held {
    fn used(&mut self, number: usize) -> Option<Arc<TriangleMesh>> {
        self.time += 1;
        let (last_use, mesh) = self.meshes.get_mut(&number)?;
        *last_use = self.time;
        Some(mesh.clone())
    }

    fn add(&mut self, number: usize, mesh: &Arc<TriangleMesh>, capacity: usize) {
        while self.meshes.len() >= capacity {
            let oldest = self.meshes.iter().min_by_key(|(_, (last_use, _))| *last_use).map(|(number, _)| *number);
            oldest.map(|number| self.meshes.remove(&number));
        }
        self.meshes.insert(number, (self.time, mesh.clone()));
    }
}

/// What is known of a tile after it has been read once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileFacts {
    pub(crate) bounds: Rectangle,
    pub(crate) double_area: i128,
    pub(crate) triangles: u64,
}

impl TileFacts {
    pub(crate) fn of(mesh: &TriangleMesh) -> TileFacts {
        TileFacts { bounds: mesh.bounds(), double_area: mesh.double_area(), triangles: mesh.len() as u64 }
    }
}
