//! Which triangles of a triangulation cover a terrain between some of whose vertices they are: those that have a point inside it.

use crate::lod::filling::Filling;
use crate::lod::outline::Outline;
use crate::lod::vertex_cells::plane;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;

/// Returns for each triangle of `filling` whether it has a point inside the terrain at `positions`, which has this `outline`. `places` has
/// a triangle around each vertex of the terrain. The filling covers the convex hull of the terrain.
pub(crate) fn covering(positions: &[[i32; 3]], outline: &Outline, filling: &Filling, places: &[u32]) -> Vec<bool> {
    let place = |v: u32| plane(positions[v as usize]);
    let mut covers = vec![None; filling.triangles()];
    let mut walk = Walk { filling, last: vec![u32::MAX; filling.triangles()], pending: Vec::new() };
    for (&[from, to], number) in outline.edges.iter().zip(0..) {
        let edge = OutlineEdge { from: place(from), to: place(to) };
        walk.along(number, &edge, places[from as usize] as usize, |triangle| covers[triangle] = Some(true));
    }
    // No edge of the outline enters the others, so each of them is inside as a whole, or outside.
    let around = EdgesAround::new(outline);
    let is_inside = |triangle: usize| {
        let corners = filling.corners(triangle).map(|site| filling.vertices[site as usize]);
        match corners.iter().find(|&&v| !outline.on[v as usize]) {
            Some(_) => true,
            None => around.terrain_is_left(corners[0], corners[1], place),
        }
    };
    covers.into_iter().enumerate().map(|(triangle, known)| known.unwrap_or_else(|| is_inside(triangle))).collect()
}

/// An edge of the outline. The terrain is on its left.
struct OutlineEdge {
    from: Site,
    to: Site,
}

impl OutlineEdge {
    /// Tells whether a triangle, counterclockwise, has a point in common with the edge or its ends.
    fn touches(&self, corners: &[Site; 3]) -> bool {
        let sides = corners.map(|corner| orient2d(self.from, self.to, corner));
        let is_beside = sides.iter().all(|&side| side > 0) || sides.iter().all(|&side| side < 0);
        !is_beside && !self.ends(corners).iter().any(|&[from, to]| from < 0 && to < 0)
    }

    /// Tells whether the triangle has a point close to the edge, on its left: that is inside the terrain.
    fn leads_inside(&self, corners: &[Site; 3]) -> bool {
        let sides = corners.map(|corner| orient2d(self.from, self.to, corner));
        let is_on_left = sides.iter().any(|&side| side > 0) && sides.iter().any(|&side| side <= 0);
        is_on_left && !self.ends(corners).iter().any(|&[from, to]| from <= 0 && to <= 0 && (from < 0 || to < 0))
    }

    /// Returns on which side of each side of the triangle the ends are: positive for the left.
    fn ends(&self, corners: &[Site; 3]) -> [[i64; 2]; 3] {
        [0, 1, 2].map(|k| [self.from, self.to].map(|end| orient2d(corners[k], corners[(k + 1) % 3], end)))
    }
}

/// Finds the triangles along edges.
struct Walk<'a> {
    filling: &'a Filling<'a>,
    /// The number of the last edge that came to each triangle.
    last: Vec<u32>,
    pending: Vec<usize>,
}

impl Walk<'_> {
    /// Calls `visit` with the triangles into which edge number `number` leads. Its first end is in the triangle `start`, or on its border.
    fn along(&mut self, number: u32, edge: &OutlineEdge, start: usize, mut visit: impl FnMut(usize)) {
        self.pending.push(start);
        while let Some(triangle) = self.pending.pop() {
            if std::mem::replace(&mut self.last[triangle], number) == number {
                continue;
            }
            let corners = self.filling.corners(triangle).map(|site| plane(self.filling.positions[site as usize]));
            if !edge.touches(&corners) {
                continue;
            }
            if edge.leads_inside(&corners) {
                visit(triangle);
            }
            self.pending.extend(self.filling.neighbours(triangle));
        }
    }
}

/// The edges of an outline by their ends.
struct EdgesAround {
    /// For each end of an edge that end, the other one, and whether the edge begins at it; sorted.
    ends: Vec<(u32, u32, bool)>,
}

impl EdgesAround {
    fn new(outline: &Outline) -> EdgesAround {
        let ends = |&[from, to]: &[u32; 2]| [(from, to, true), (to, from, false)];
        let mut ends: Vec<_> = outline.edges.iter().flat_map(ends).collect();
        ends.sort_unstable();
        EdgesAround { ends }
    }

    /// Tells whether the terrain, whose vertices have a `place`, is on the left of the way from `vertex` to `other`, close to `vertex`. It is if
    /// the first edge on the right of the way begins there: edges have the terrain on their left.
    fn terrain_is_left(&self, vertex: u32, other: u32, place: impl Fn(u32) -> Site) -> bool {
        let (here, ahead) = (place(vertex), place(other));
        let first = self.ends.partition_point(|end| end.0 < vertex);
        let around = self.ends[first..].iter().take_while(|end| end.0 == vertex);
        let quarter = |to: Site| match orient2d(here, ahead, to) {
            0 if is_ahead(here, ahead, to) => 0,
            0 => 2,
            side if side < 0 => 1,
            _ => 3,
        };
        let turned = |&&(_, a, _): &&(u32, u32, bool), &&(_, b, _): &&(u32, u32, bool)| {
            let (a, b) = (place(a), place(b));
            quarter(a).cmp(&quarter(b)).then_with(|| orient2d(here, a, b).cmp(&0))
        };
        around.min_by(turned).is_some_and(|&(_, _, begins)| begins)
    }
}

/// Tells whether `to` is in the direction of `ahead` from `here`, and not in the opposite one. All are on one line.
fn is_ahead(here: Site, ahead: Site, to: Site) -> bool {
    (0..2).any(|axis| {
        let along = |site: Site| (i64::from(site[axis]) - i64::from(here[axis])).signum();
        along(ahead) * along(to) > 0
    })
}
