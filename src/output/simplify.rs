//! A terrain with fewer triangles, for looking at from afar.
//!
//! A vertex goes by being moved to one of its neighbours: the triangles round it are replaced by those that this neighbour makes
//! with the edges round them. It may go where all these are counterclockwise, which is decided exactly. So the triangles cover the
//! same ground once, as before, and no other vertex moves. Vertices of the outline stay, and so do its edges: two terrains that meet
//! along a part of their outlines still meet there when both, or either of them, are simplified.
//!
//! The vertex whose going is noticed least goes first: the vertical distance that it is off the new triangles, with what the ground
//! there has been off already, since it is the greatest distance that is to be small; among vertices that are equal in that, those
//! with short edges.

mod ring;
#[cfg(test)]
mod tests;
mod topology;

use super::Tile;
use super::deviation::deviation;
use super::frame::Frame;
use ring::Ring;
use topology::{NONE, Topology, next};

/// A simplified terrain.
#[derive(Debug)]
pub struct Simplified {
    /// Its vertices are some of the original's, in their order.
    pub tile: Tile,
    /// The greatest vertical distance to the original, metres.
    pub error: f64,
}

/// `tile`, a terrain over ground that it covers once, with `triangles` triangles; with more where its outline has too many.
pub fn simplify(frame: &Frame, tile: &Tile, triangles: usize) -> Simplified {
    let [xy, up] = frame.resolution_metres();
    let mut collapser = Collapser::new(&tile.positions, &tile.triangles, up / xy);
    collapser.run(triangles);
    let coarse = collapser.topology.triangles();
    let error = deviation(&tile.positions, &tile.triangles, &coarse) * up;
    Simplified { tile: subset(tile, coarse), error }
}

/// Of so many vertices one is rated to choose the first limit.
const SAMPLE: usize = 61;
/// The limit rises by this factor from sweep to sweep.
const RISE: f32 = 1.25;

/// A terrain while its vertices go.
struct Collapser<'a> {
    positions: &'a [[i32; 3]],
    topology: Topology,
    /// Steps of x and y in a step of z.
    steepness: f64,
    /// What it costs to take a vertex out, steps of x and y; infinite for those that cannot go.
    costs: Vec<f32>,
    vertices: Vec<Vertex>,
    ring: Ring,
    /// The sweep that is under way, from 1.
    sweep: u32,
}

/// What else is known of a vertex.
#[derive(Clone, Copy)]
struct Vertex {
    /// The half-edge along which it would go; [`NONE`] where it cannot.
    along: u32,
    /// How far the ground around may be off already, steps of x and y.
    off: f32,
    /// The sweep in which its neighbours have changed since it was rated; 0 where they have not.
    changed: u32,
}

impl<'a> Collapser<'a> {
    fn new(positions: &'a [[i32; 3]], triangles: &[[u32; 3]], steepness: f64) -> Collapser<'a> {
        let topology = Topology::new(positions.len(), triangles);
        // What is inside may go for nothing as far as is known.
        let unknown = |v| if topology.is_inside(v) { 0.0 } else { f32::INFINITY };
        Collapser {
            positions,
            costs: (0..positions.len() as u32).map(unknown).collect(),
            topology,
            steepness,
            vertices: vec![Vertex { along: NONE, off: 0.0, changed: u32::MAX }; positions.len()],
            ring: Ring::default(),
            sweep: 0,
        }
    }

    /// Takes vertices out until `triangles` are left, or none can go: in sweeps over all of them, which is kind to the cache, each
    /// for those that cost less than a limit that rises from sweep to sweep.
    fn run(&mut self, triangles: usize) {
        let mut limit = self.middle_cost();
        while self.topology.count() > triangles {
            let least = self.costs.iter().copied().fold(f32::INFINITY, f32::min);
            if least == f32::INFINITY {
                return;
            }
            self.sweep += 1;
            limit = (limit * RISE).max(least * RISE).max(f32::MIN_POSITIVE);
            self.sweep_below(limit, triangles);
        }
    }

    /// The cost that about half of the vertices have.
    fn middle_cost(&mut self) -> f32 {
        let mut costs = Vec::new();
        for v in (0..self.costs.len()).step_by(SAMPLE) {
            if self.costs[v] < f32::INFINITY {
                self.rate(v as u32);
                costs.push(self.costs[v]);
            }
        }
        costs.sort_unstable_by(f32::total_cmp);
        costs.get(costs.len() / 2).copied().filter(|cost| cost.is_finite()).unwrap_or(0.0)
    }

    /// Takes out what costs less than `limit`. What loses a neighbour has to wait for the next sweep: so vertices go everywhere
    /// rather than one after the other, and few are rated in vain.
    fn sweep_below(&mut self, limit: f32, triangles: usize) {
        for v in 0..self.costs.len() {
            if self.costs[v] >= limit || self.vertices[v].changed == self.sweep {
                continue;
            }
            if self.vertices[v].changed > 0 {
                self.rate(v as u32);
            }
            if self.costs[v] < limit {
                self.collapse(v as u32);
                if self.topology.count() <= triangles {
                    return;
                }
            }
        }
    }

    /// Finds where `v` would go best, and what that costs.
    fn rate(&mut self, v: u32) {
        let best =
            self.ring.gather(v, &self.topology, self.positions).then(|| self.ring.best(self.steepness)).flatten();
        let vertex = &mut self.vertices[v as usize];
        vertex.changed = 0;
        (vertex.along, self.costs[v as usize]) = match best {
            Some((edge, cost)) => (edge, vertex.off + cost as f32),
            None => (NONE, f32::INFINITY),
        };
    }

    fn collapse(&mut self, v: u32) {
        let cost = std::mem::replace(&mut self.costs[v as usize], f32::INFINITY);
        let along = self.vertices[v as usize].along;
        for edge in self.topology.around(v) {
            let neighbour = self.topology.origin(next(edge)) as usize;
            let vertex = &mut self.vertices[neighbour];
            vertex.off = vertex.off.max(cost);
            vertex.changed = self.sweep;
            if vertex.along == NONE && self.topology.is_inside(neighbour as u32) {
                // It could not go; whether it can now is found when its turn comes.
                self.costs[neighbour] = cost;
            }
        }
        self.topology.collapse(along);
    }
}

/// The tile of these triangles, without the vertices that they do not use.
fn subset(tile: &Tile, mut triangles: Vec<[u32; 3]>) -> Tile {
    let mut used = vec![false; tile.positions.len()];
    triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let number = |next: &mut u32, &used: &bool| Some(std::mem::replace(next, *next + used as u32));
    let numbers: Vec<u32> = used.iter().scan(0, number).collect();
    triangles.iter_mut().flatten().for_each(|v| *v = numbers[*v as usize]);
    Tile {
        positions: kept(&tile.positions, &used),
        normals: tile.normals.as_ref().map(|normals| kept(normals, &used)),
        colors: tile.colors.as_ref().map(|colors| kept(colors, &used)),
        triangles,
    }
}

fn kept<T: Copy>(values: &[T], used: &[bool]) -> Vec<T> {
    values.iter().zip(used).filter(|(_, used)| **used).map(|(value, _)| *value).collect()
}
