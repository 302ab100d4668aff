//! Triangles on the lattice.

use crate::rectangle::Rectangle;

/// x, y and z in lattice steps.
pub type Point = [i64; 3];

/// Coordinates lie within this many steps of zero, so that no number in a decision overflows an `i128`.
pub const REACH: i64 = 1 << 40;

/// Why corners and triangles are no mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A coordinate is beyond [`REACH`].
    #[error("a vertex lies more than 2^40 lattice steps from the origin")]
    TooFar,
    /// A triangle names a vertex that does not exist.
    #[error("a triangle has a corner that is no vertex")]
    NoVertex,
    /// A triangle has no area, or runs clockwise.
    #[error("a triangle is not counterclockwise")]
    NotCounterclockwise,
}

/// Triangles without common area, such as those of a tile.
#[derive(Clone, Debug)]
pub struct TriangleMesh {
    vertices: Vec<Point>,
    /// Counterclockwise, from the corner with the least (x, y) on.
    triangles: Vec<[u32; 3]>,
    boxes: Vec<Rectangle>,
    bounds: Rectangle,
    /// The least and the greatest height.
    heights: [i64; 2],
    double_area: i128,
}

impl TriangleMesh {
    /// Returns the mesh of these triangles, given by the numbers of their corners.
    ///
    /// # Errors
    /// [`MeshError`] if a corner or a triangle cannot be used.
    pub fn new(vertices: Vec<Point>, mut triangles: Vec<[u32; 3]>) -> Result<TriangleMesh, MeshError> {
        if vertices.iter().flatten().any(|value| !(-REACH..=REACH).contains(value)) {
            return Err(MeshError::TooFar);
        }
        let (mut boxes, mut bounds, mut double_area) = (Vec::with_capacity(triangles.len()), Rectangle::EMPTY, 0i128);
        for triangle in &mut triangles {
            let corner = |v: u32| vertices.get(v as usize).copied().ok_or(MeshError::NoVertex);
            let corners = [corner(triangle[0])?, corner(triangle[1])?, corner(triangle[2])?];
            let area = double_area_of(&corners);
            if area <= 0 {
                return Err(MeshError::NotCounterclockwise);
            }
            double_area += area;
            let first = (0..3).min_by_key(|k| [corners[*k][0], corners[*k][1]]).unwrap_or(0);
            triangle.rotate_left(first);
            let rectangle = Rectangle::around(corners.map(|[x, y, _]| [x, y]));
            bounds = bounds.joined(rectangle);
            boxes.push(rectangle);
        }
        let heights = vertices.iter().map(|v| v[2]);
        let heights = heights.fold([i64::MAX, i64::MIN], |[low, high], z| [low.min(z), high.max(z)]);
        Ok(TriangleMesh { vertices, triangles, boxes, bounds, heights, double_area })
    }

    /// Returns the number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Tells whether there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Returns the smallest rectangle around all triangles.
    pub fn bounds(&self) -> Rectangle {
        self.bounds
    }

    /// Returns twice the area of all triangles, in square steps.
    pub fn double_area(&self) -> i128 {
        self.double_area
    }

    /// Returns the least and the greatest height, in steps. Of no vertex, the least is the greater one.
    pub fn heights(&self) -> [i64; 2] {
        self.heights
    }

    /// Returns the corners of triangle `t`, counterclockwise from the one with the least (x, y) on.
    #[inline(always)]
    pub fn corners(&self, t: u32) -> [Point; 3] {
        self.triangles[t as usize].map(|v| self.vertices[v as usize])
    }

    /// Returns the rectangle around triangle `t`.
    #[inline(always)]
    pub fn rectangle(&self, t: u32) -> &Rectangle {
        &self.boxes[t as usize]
    }

    /// Returns about how many bytes the mesh takes.
    pub fn bytes(&self) -> u64 {
        let of = |count: usize, size: usize| (count * size) as u64;
        of(self.vertices.len(), size_of::<Point>())
            + of(self.triangles.len(), size_of::<[u32; 3]>() + size_of::<Rectangle>())
    }
}

/// Returns twice the area of the triangle, above 0 if it is counterclockwise.
pub(crate) fn double_area_of(corners: &[Point; 3]) -> i128 {
    let [a, b, c] = corners;
    let along = |p: &Point, axis: usize| i128::from(p[axis] - a[axis]);
    along(b, 0) * along(c, 1) - along(b, 1) * along(c, 0)
}
