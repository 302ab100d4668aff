//! The normals of a tile as its file has them. What few vertices are asked for is not worth unpacking for all.

use multiversion::multiversion;

use crate::gltf::encoding::{from_long_octahedral, from_octahedral};

/// The normals of a mesh, in one of the forms that this program writes.
#[derive(Clone, Debug)]
pub enum StoredNormals {
    /// In single precision.
    Single(Vec<[f32; 3]>),
    /// In signed 16 bits, 32767 for 1. The fourth number is padding.
    Shorts(Vec<[i16; 4]>),
    /// In signed bytes, 127 for 1. The fourth byte is padding.
    Bytes(Vec<[i8; 4]>),
    /// In signed 16 bits on an octahedron, whose size is the third number.
    OctahedralShorts(Vec<[i16; 4]>),
    /// In signed bytes on an octahedron, whose size is the third byte.
    OctahedralBytes(Vec<[i8; 4]>),
}

impl StoredNormals {
    /// Returns the number of normals.
    pub(crate) fn count(&self) -> usize {
        match self {
            StoredNormals::Single(all) => all.len(),
            StoredNormals::Shorts(all) | StoredNormals::OctahedralShorts(all) => all.len(),
            StoredNormals::Bytes(all) | StoredNormals::OctahedralBytes(all) => all.len(),
        }
    }

    /// Returns the normal (x, y up, z) of vertex `v`. A viewer divides it by the scale of the node and makes it a unit vector.
    pub fn get(&self, v: usize) -> [f32; 3] {
        let of_shorts = |[x, y, z, _]: [i16; 4]| [x, y, z].map(|v| f32::from(v) / 32767.0);
        match self {
            StoredNormals::Single(all) => all[v],
            StoredNormals::Shorts(all) => of_shorts(all[v]),
            StoredNormals::Bytes(all) => of_bytes(all[v]),
            StoredNormals::OctahedralShorts(all) => of_shorts(from_long_octahedral(all[v])),
            StoredNormals::OctahedralBytes(all) => of_bytes(from_octahedral(all[v])),
        }
    }

    /// Returns the normals of these vertices, as [`StoredNormals::get`] does, many at a time.
    pub(crate) fn pick(&self, vertices: &[u32]) -> Vec<[f32; 3]> {
        match self {
            StoredNormals::OctahedralBytes(all) => {
                let picked: Vec<[i8; 4]> = vertices.iter().map(|&v| all[v as usize]).collect();
                from_octahedral_bytes(&picked)
            }
            _ => vertices.iter().map(|&v| self.get(v as usize)).collect(),
        }
    }

    /// Returns all normals, as [`StoredNormals::get`] does.
    pub fn iter(&self) -> impl Iterator<Item = [f32; 3]> {
        (0..self.count()).map(|v| self.get(v))
    }
}

#[inline(always)]
fn of_bytes([x, y, z, _]: [i8; 4]) -> [f32; 3] {
    [x, y, z].map(|v| f32::from(v) / 127.0)
}

#[multiversion(targets("x86_64+avx2"))]
fn from_octahedral_bytes(stored: &[[i8; 4]]) -> Vec<[f32; 3]> {
    stored.iter().map(|&normal| of_bytes(from_octahedral(normal))).collect()
}

/// Normals are the same if viewers see the same, in whichever form they are stored.
impl PartialEq for StoredNormals {
    fn eq(&self, other: &StoredNormals) -> bool {
        self.iter().eq(other.iter())
    }
}
