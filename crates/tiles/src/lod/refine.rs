//! Which vertices a simplified terrain takes in beyond its first ones: those with the greatest error, in a few rounds (Garland and Heckbert
//! 1995, "Fast polygonal approximation of terrains and height fields"). The error of a vertex is the square of its vertical distance times its
//! share of the ground. So each choice lowers the mean square over the ground, and where long triangles span ground without points, their corners
//! come before the vertices of a dense row.

use crate::lod::cell_grid::CellGrid;
use crate::lod::filling::Filling;
use crate::lod::vertex_cells::vertical_distance;
use sys::{Result, interrupt};

/// The rounds: each looks at one of this many vertices. The first rounds choose few. The last ones are for places where many vertices stand
/// out of one triangle, of which a round takes in one.
const LOOKED_AT: [usize; 5] = [4, 2, 1, 1, 1];

/// Steps of the walks to the vertices, on average, before the search gives up. Terrains need far fewer.
const STEPS_PER_VERTEX: u64 = 64;

/// Triangles in a cell, from one of which a walk starts.
const TRIANGLES_PER_CELL: usize = 4;

/// Where the vertices of a terrain are in a triangulation of some of them.
pub(crate) struct Places {
    /// For every vertex a triangle that holds it or is near it.
    triangles: Vec<u32>,
    /// The steps that walks may still take.
    steps: u64,
}

impl Places {
    /// Returns places near the vertices at `positions`.
    pub(crate) fn new(positions: &[[i32; 3]], filling: &Filling) -> Places {
        let starts = StartCells::new(filling);
        let triangles = positions.iter().map(|p| starts.near(p) as u32).collect();
        Places { triangles, steps: 4 * STEPS_PER_VERTEX * (positions.len() as u64 + 1000) }
    }

    /// Returns the triangle of `filling` that holds vertex `v`: `None` if that takes far longer than usual, where nearly all triangles are
    /// slivers.
    #[inline(always)]
    fn locate(&mut self, v: u32, filling: &Filling) -> Option<usize> {
        let start = self.triangles[v as usize] as usize;
        let found = filling.locate(v, start, &mut self.steps)?;
        self.triangles[v as usize] = found as u32;
        Some(found)
    }

    /// Returns the triangle of `filling` for each vertex, as far as [`Places::locate`] gets.
    pub(crate) fn locate_all(&mut self, filling: &Filling) -> &[u32] {
        let all = self.triangles.len();
        let located = (0..all as u32).position(|v| self.locate(v, filling).is_none()).unwrap_or(all);
        &self.triangles[..located]
    }

    /// Takes vertex `v` into `filling`. `note` gets the triangles that change.
    pub(crate) fn insert(&mut self, v: u32, filling: &mut Filling, note: impl FnMut(usize)) {
        let start = self.triangles[v as usize] as usize;
        filling.insert(v, start, &mut self.steps, note);
    }
}

/// Takes vertices of the terrain at `positions`, with these `weights`, into `filling` until it has `wanted`. Those that it has are `kept`;
/// `allows` tells which others may be.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(crate) fn refine(
    (positions, weights): (&[[i32; 3]], &[f64]),
    kept: &mut [bool],
    allows: impl Fn(usize) -> bool,
    filling: &mut Filling,
    places: &mut Places,
    wanted: usize,
) -> Result<()> {
    let mut worst = Worst::default();
    for (round, every) in LOOKED_AT.into_iter().enumerate() {
        interrupt::check()?;
        let has = filling.vertices.len();
        // Not `powf`, whose last digit may differ between machines.
        let growth = libm::pow(wanted as f64 / has as f64, 1.0 / (LOOKED_AT.len() - round) as f64);
        let count = ((has as f64 * growth).round() as usize).min(wanted).saturating_sub(has);
        worst.look((positions, weights), |v| !kept[v] && allows(v), filling, places, every);
        for WorstVertex { vertex, .. } in worst.of_all(count) {
            kept[vertex as usize] = true;
            places.insert(vertex, filling, |triangle| worst.note_change(triangle));
        }
    }
    Ok(())
}

/// A vertex that is over or under a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct WorstVertex {
    /// The square of the vertical distance in steps of z, times the weight of the vertex.
    error: f64,
    vertex: u32,
}

/// The vertex with the greatest error in every triangle. Those of triangles that have not changed stay known.
#[derive(Default)]
struct Worst {
    of_triangles: Vec<WorstVertex>,
    has_changed: Vec<bool>,
    /// Of how many vertices the last look took one; 0 before the first look.
    last_every: usize,
}

impl Worst {
    /// Looks at one of `every` vertices, among them all that were looked at before, as far as it `may_choose` them. What is known of a triangle
    /// that has not changed needs no second look.
    fn look(
        &mut self,
        (positions, weights): (&[[i32; 3]], &[f64]),
        may_choose: impl Fn(usize) -> bool,
        filling: &Filling,
        places: &mut Places,
        every: usize,
    ) {
        self.has_changed.resize(filling.triangles(), true);
        self.of_triangles.resize(filling.triangles(), WorstVertex::default());
        for (worst, _) in self.of_triangles.iter_mut().zip(&self.has_changed).filter(|(_, has_changed)| **has_changed) {
            *worst = WorstVertex::default();
        }
        for v in (0..positions.len()).step_by(every) {
            // Those that were looked at before know their triangle, unless that has changed.
            let is_known = v.is_multiple_of(self.last_every) && !self.has_changed[places.triangles[v] as usize];
            if is_known || !may_choose(v) {
                continue;
            }
            let Some(triangle) = places.locate(v as u32, filling) else { break };
            let corners = filling.corners(triangle);
            let distance = vertical_distance(&corners.map(|site| filling.positions[site as usize]), positions[v]);
            let (error, vertex) = (distance * distance * weights[v], v as u32);
            let worst = &mut self.of_triangles[triangle];
            // Of two that are equal, the first one stays.
            if error > worst.error || error == worst.error && vertex < worst.vertex {
                *worst = WorstVertex { error, vertex };
            }
        }
        self.has_changed.fill(false);
        self.last_every = every;
    }

    /// Returns the `count` vertices with the greatest errors, one of a triangle, in ascending order.
    fn of_all(&self, count: usize) -> Vec<WorstVertex> {
        let mut worst: Vec<WorstVertex> = self.of_triangles.iter().copied().filter(|worst| worst.error > 0.0).collect();
        if count < worst.len() {
            // Errors are not negative, so their bits are in the same order.
            worst.select_nth_unstable_by_key(count, |worst| std::cmp::Reverse((worst.error.to_bits(), worst.vertex)));
            worst.truncate(count);
        }
        // Vertices that follow each other are near each other, and so are their places in memory.
        worst.sort_unstable_by_key(|worst| worst.vertex);
        worst
    }

    /// Notes that a triangle has changed. Those beyond the known ones are new anyway.
    fn note_change(&mut self, triangle: usize) {
        if let Some(has_changed) = self.has_changed.get_mut(triangle) {
            *has_changed = true;
        }
    }
}

/// A triangle for every place, from which it is not far to the one that holds the place.
struct StartCells {
    cells: CellGrid,
    /// A triangle with a corner in each cell, or near it.
    triangles: Vec<u32>,
}

impl StartCells {
    /// Notes the triangles of `filling`.
    fn new(filling: &Filling) -> StartCells {
        let cells = CellGrid::new(&filling.positions, filling.triangles() / TRIANGLES_PER_CELL + 1);
        let mut triangles = vec![u32::MAX; cells.count()];
        for triangle in 0..filling.triangles() {
            let [corner, ..] = filling.corners(triangle);
            triangles[cells.of(&filling.positions[corner as usize]) as usize] = triangle as u32;
        }
        // Where a cell has none, that of the cell before it must do.
        let mut last = triangles.iter().copied().find(|&triangle| triangle != u32::MAX).unwrap_or(0);
        for triangle in &mut triangles {
            if *triangle == u32::MAX {
                *triangle = last;
            }
            last = *triangle;
        }
        StartCells { cells, triangles }
    }

    fn near(&self, place: &[i32; 3]) -> usize {
        self.triangles[self.cells.of(place) as usize] as usize
    }
}
