//! Areas of the plane within which volumes are summed up, as triangles.

use crate::join::for_each_pair;
use crate::mesh::{Point, TriangleMesh};
use crate::pair::have_common_area;

/// Zones, cut into triangles. Zones may overlap.
#[derive(Clone, Debug)]
pub struct Zones {
    /// The triangles of each zone.
    meshes: Vec<TriangleMesh>,
}

/// The triangles of zones that have an area in common with each triangle of a mesh.
#[derive(Clone, Debug, Default)]
pub struct ZoneTriangles {
    /// The number of a triangle of the mesh, that of a zone, and the corners of a triangle of the zone, sorted by the first.
    found: Vec<(u32, usize, [Point; 3])>,
}

impl Zones {
    /// Returns zones, each given by its triangles.
    pub fn new(meshes: Vec<TriangleMesh>) -> Zones {
        Zones { meshes }
    }

    /// Returns the number of zones.
    pub fn count(&self) -> usize {
        self.meshes.len()
    }

    /// Returns what each triangle of `mesh` meets.
    pub fn of(&self, mesh: &TriangleMesh) -> ZoneTriangles {
        let mut found = Vec::new();
        for (zone, triangles) in self.meshes.iter().enumerate() {
            for_each_pair(triangles, mesh, |z, t| {
                let corners = triangles.corners(z);
                if have_common_area(&corners, &mesh.corners(t)) {
                    found.push((t, zone, corners));
                }
            });
        }
        found.sort_unstable_by_key(|(triangle, ..)| *triangle);
        ZoneTriangles { found }
    }
}

impl ZoneTriangles {
    /// Returns the zones and their triangles that triangle `t` meets.
    pub(crate) fn of(&self, t: u32) -> impl Iterator<Item = (usize, &[Point; 3])> {
        let start = self.found.partition_point(|(triangle, ..)| *triangle < t);
        let of_it = self.found[start..].iter().take_while(move |(triangle, ..)| *triangle == t);
        of_it.map(|(_, zone, corners)| (*zone, corners))
    }
}
