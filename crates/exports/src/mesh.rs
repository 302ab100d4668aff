//! The numbered mesh of all tiles, and what files say about it.

use crate::exact_axis::ExactAxis;
use lattice::Lattice;
use std::ops::Range;
use sys::Result;

/// Takes the bytes of a file, one piece after the other.
pub type Output<'a> = dyn FnMut(&[u8]) -> Result<()> + 'a;

/// Where the numbered mesh is.
pub trait MeshSource: Sync {
    /// Returns the vertices with these numbers, in lattice steps.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if they cannot be read.
    fn vertices(&self, numbers: Range<u64>) -> Result<Vec<[i32; 3]>>;

    /// Returns these triangles: the numbers of their corners, counterclockwise.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if they cannot be read.
    fn triangles(&self, numbers: Range<u64>) -> Result<Vec<[u32; 3]>>;

    /// Returns the sRGB colours of the vertices with these numbers; `None` if the mesh has none.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if they cannot be read.
    fn colors(&self, numbers: Range<u64>) -> Result<Option<Vec<[u8; 3]>>>;
}

/// Counts and measures of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshSummary {
    /// The number of vertices.
    pub vertices: u32,
    /// The number of triangles.
    pub triangles: u64,
    /// The least and the greatest coordinates of vertices, in lattice steps.
    pub bounds: [[i32; 3]; 2],
    /// Twice the area of all triangles in the plane, in square lattice steps.
    pub twice_area: u128,
}

impl Default for MeshSummary {
    fn default() -> MeshSummary {
        MeshSummary { vertices: 0, triangles: 0, bounds: [[i32::MAX; 3], [i32::MIN; 3]], twice_area: 0 }
    }
}

impl MeshSummary {
    /// Adds vertices, fewer than 2^32, and triangles.
    pub(crate) fn add(&mut self, vertices: &[[i32; 3]], triangles: u64, twice_area: u128) {
        self.vertices += vertices.len() as u32;
        self.triangles += triangles;
        self.twice_area += twice_area;
        let [low, high] = &mut self.bounds;
        for place in vertices {
            for axis in 0..3 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
    }
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthUnit {
    /// The metre.
    Metre,
    /// The international foot.
    Foot,
    /// The US survey foot.
    UsFoot,
    /// A unit that formats have no word for.
    Other,
}

/// The units of coordinates.
#[derive(Clone, Debug)]
pub struct Units {
    /// The unit of x and y.
    pub plane: LengthUnit,
    /// Its name.
    pub plane_name: String,
    /// The name of the unit of z.
    pub height_name: String,
}

impl Units {
    /// Returns the units in words.
    pub(crate) fn text(&self) -> String {
        match self.plane_name == self.height_name {
            true => format!("unit: {}", self.plane_name),
            false => format!("unit of x and y: {}, of heights: {}", self.plane_name, self.height_name),
        }
    }
}

/// What is known of the coordinate reference system.
#[derive(Clone, Debug, Default)]
pub struct SystemNames {
    /// The name of the system of x and y.
    pub name: Option<String>,
    /// Its EPSG code.
    pub code: Option<u32>,
    /// The name of the system of heights.
    pub vertical_name: Option<String>,
    /// Its EPSG code.
    pub vertical_code: Option<u32>,
}

impl SystemNames {
    /// Returns the systems in words, if there is anything to say.
    pub(crate) fn text(&self) -> Option<String> {
        let named = |name: &Option<String>, code: Option<u32>| match (name, code) {
            (Some(name), Some(code)) => Some(format!("{name} (EPSG:{code})")),
            (Some(name), None) => Some(name.clone()),
            (None, code) => code.map(|code| format!("EPSG:{code}")),
        };
        let plane = named(&self.name, self.code);
        let heights = named(&self.vertical_name, self.vertical_code).map(|heights| format!("heights: {heights}"));
        let all: Vec<String> = plane.into_iter().chain(heights).collect();
        (!all.is_empty()).then(|| format!("CRS: {}", all.join("; ")))
    }
}

/// A numbered mesh, and what files say about it.
pub struct Mesh<'a> {
    /// Vertices and triangles.
    pub source: &'a dyn MeshSource,
    /// Counts and measures.
    pub summary: MeshSummary,
    /// The lattice that the vertices are on.
    pub lattice: &'a Lattice,
    /// The units of coordinates.
    pub units: Units,
    /// The coordinate reference system.
    pub system: SystemNames,
    /// The breaklines, in lattice steps.
    pub lines: &'a [Vec<[i32; 3]>],
    /// Whose the data are, if the user says.
    pub copyright: Option<&'a str>,
}

impl Mesh<'_> {
    /// Returns the axes x, y and z.
    pub(crate) fn axes(&self) -> [ExactAxis; 3] {
        [0, 1, 2].map(|axis| ExactAxis::of(self.lattice, axis))
    }

    /// Returns what files say about the mesh in comments: lines of text.
    pub(crate) fn comments(&self) -> Vec<String> {
        let first = ["terrain of gdt-batch: an exact Delaunay triangulation".to_owned(), self.units.text()];
        let copyright = self.copyright.map(|text| format!("copyright: {text}"));
        first.into_iter().chain(self.system.text()).chain(copyright).collect()
    }
}
