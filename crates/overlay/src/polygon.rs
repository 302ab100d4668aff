//! Convex polygons in floating point, with the difference of two heights at each vertex.

/// A triangle that is cut by six edges and by a line has at most this many vertices.
const MOST: usize = 10;

/// A vertex of a polygon.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vertex {
    /// The place from the polygon's origin, in lattice steps.
    pub(crate) at: [f64; 2],
    /// The height of the later terrain above the earlier one, in lattice steps.
    pub(crate) rise: f64,
    /// On which side of three edges it lies, and how far: above 0 is inside.
    pub(crate) sides: [f64; 3],
}

/// A convex polygon, counterclockwise.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Polygon {
    vertices: [Vertex; MOST],
    count: usize,
}

impl Vertex {
    /// Returns the place on the way from this vertex to the next, which is `t` of the way from here.
    #[inline]
    fn toward(&self, next: &Vertex, t: f64) -> Vertex {
        let between = |from: f64, to: f64| from + t * (to - from);
        Vertex {
            at: [0, 1].map(|k| between(self.at[k], next.at[k])),
            rise: between(self.rise, next.rise),
            sides: [0, 1, 2].map(|k| between(self.sides[k], next.sides[k])),
        }
    }
}

impl Polygon {
    pub(crate) fn triangle(corners: [Vertex; 3]) -> Polygon {
        let mut polygon = Polygon::default();
        corners.into_iter().for_each(|corner| polygon.push(corner));
        polygon
    }

    /// Rounding may leave the vertices of a thin polygon in no convex position; those beyond the last place are of no account.
    #[inline]
    fn push(&mut self, vertex: Vertex) {
        if let Some(place) = self.vertices.get_mut(self.count) {
            *place = vertex;
            self.count += 1;
        }
    }

    #[inline]
    pub(crate) fn vertices(&self) -> &[Vertex] {
        &self.vertices[..self.count]
    }

    #[inline]
    pub(crate) fn vertices_mut(&mut self) -> &mut [Vertex] {
        &mut self.vertices[..self.count]
    }

    /// Returns the part where `value`, which changes linearly, is not below 0. New vertices, where it is 0, are `settled`.
    #[inline]
    pub(crate) fn clipped(&self, value: impl Fn(&Vertex) -> f64, settled: impl Fn(&mut Vertex)) -> Polygon {
        let all = self.vertices();
        if all.iter().all(|vertex| value(vertex) >= 0.0) {
            return *self;
        }
        let mut kept = Polygon::default();
        for (index, vertex) in all.iter().enumerate() {
            let next = &all[if index + 1 == all.len() { 0 } else { index + 1 }];
            let [here, there] = [value(vertex), value(next)];
            if here >= 0.0 {
                kept.push(*vertex);
            }
            if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                let mut between = vertex.toward(next, here / (here - there));
                settled(&mut between);
                kept.push(between);
            }
        }
        kept
    }

    /// Returns the part inside all three edges that the sides of the vertices tell.
    #[inline]
    pub(crate) fn within_sides(&self) -> Polygon {
        let mut polygon = *self;
        for k in 0..3 {
            polygon = polygon.clipped(|vertex| vertex.sides[k], |vertex| vertex.sides[k] = 0.0);
        }
        polygon
    }

    /// Returns the area and the integral of the rise.
    #[inline]
    pub(crate) fn area_and_volume(&self) -> [f64; 2] {
        let Some((first, rest)) = self.vertices().split_first() else { return [0.0; 2] };
        let (mut double_area, mut sixfold_volume) = (0.0, 0.0);
        for pair in rest.windows(2) {
            let [a, b] = [&pair[0], &pair[1]].map(|v| [v.at[0] - first.at[0], v.at[1] - first.at[1]]);
            // A thin triangle may have an area below 0 by rounding.
            let area = (a[0] * b[1] - a[1] * b[0]).max(0.0);
            double_area += area;
            sixfold_volume += area * (first.rise + pair[0].rise + pair[1].rise);
        }
        [double_area / 2.0, sixfold_volume / 6.0]
    }
}
