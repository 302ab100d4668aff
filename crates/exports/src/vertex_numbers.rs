//! The numbers of the vertices of all tiles.
//!
//! Only a vertex on the rim of a tile's mesh can be in another tile too. Such a vertex is remembered until the triangles of the tiles so far
//! close around it: then no later tile can have it. So what is held in memory grows with the border of the terrain and with the border
//! between the tiles so far and those to come, not with the terrain.

use crate::mesh::MeshSummary;
use crate::tile_surface::{TileSurface, twice_area};
use std::collections::{HashMap, HashSet};

/// The greatest number of vertices: readers count in signed numbers of 32 bits.
const MOST_VERTICES: u32 = i32::MAX as u32;

/// There are more vertices than formats can number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyVertices;

/// Numbers vertices from 0 on, in the order of the tiles.
#[derive(Debug, Default)]
pub struct VertexNumbers {
    summary: MeshSummary,
    /// The vertices that later tiles may have too.
    open: HashMap<[i32; 3], OpenVertex>,
    /// The directed edges of triangles with no triangle on the other side so far, by the numbers of their ends.
    rim: HashSet<[u32; 2]>,
}

#[derive(Debug)]
struct OpenVertex {
    number: u32,
    /// The number of edges of [`VertexNumbers::rim`] that end here.
    edges: u32,
}

/// What a tile adds to the mesh.
#[derive(Debug, Default)]
pub struct NumberedTile {
    /// The vertices that no earlier tile has, in the order of their numbers.
    pub new_vertices: Vec<[i32; 3]>,
    /// For each of them, the index of its position among those that the surface was made of.
    pub origins: Vec<u32>,
    /// The triangles by the numbers of their corners.
    pub triangles: Vec<[u32; 3]>,
}

impl VertexNumbers {
    /// Numbers the vertices of the next tile.
    ///
    /// # Errors
    /// [`TooManyVertices`].
    pub fn add(&mut self, tile: &TileSurface) -> Result<NumberedTile, TooManyVertices> {
        const NONE: u32 = u32::MAX;
        let mut numbers = vec![NONE; tile.vertices.len()];
        for &vertex in tile.rim.iter().flatten() {
            if let Some(known) = self.open.get(&tile.vertices[vertex as usize]) {
                numbers[vertex as usize] = known.number;
            }
        }
        let mut numbered = NumberedTile::default();
        let mut next = self.summary.vertices;
        for ((number, &place), &origin) in numbers.iter_mut().zip(&tile.vertices).zip(&tile.origins) {
            if *number == NONE {
                *number = next;
                next = next.checked_add(1).filter(|count| *count <= MOST_VERTICES).ok_or(TooManyVertices)?;
                numbered.new_vertices.push(place);
                numbered.origins.push(origin);
            }
        }
        numbered.triangles = tile.triangles.iter().map(|triangle| triangle.map(|v| numbers[v as usize])).collect();
        self.summary.add(&numbered.new_vertices, tile.triangles.len() as u64, area_of(tile));
        self.join_rim(tile, &numbers);
        Ok(numbered)
    }

    /// Closes the edges that this tile shares with earlier ones, and opens its others.
    fn join_rim(&mut self, tile: &TileSurface, numbers: &[u32]) {
        let ends = |edge: &[u32; 2]| edge.map(|v| (tile.vertices[v as usize], numbers[v as usize]));
        for edge in &tile.rim {
            let [(_, from), (_, to)] = ends(edge);
            let closes = self.rim.remove(&[to, from]);
            if !closes {
                self.rim.insert([from, to]);
            }
            for (place, number) in ends(edge) {
                let vertex = self.open.entry(place).or_insert(OpenVertex { number, edges: 0 });
                vertex.edges = if closes { vertex.edges.saturating_sub(1) } else { vertex.edges + 1 };
            }
        }
        for vertex in tile.rim.iter().flatten() {
            let place = tile.vertices[*vertex as usize];
            if self.open.get(&place).is_some_and(|vertex| vertex.edges == 0) {
                self.open.remove(&place);
            }
        }
    }

    /// Returns what is known of all tiles so far.
    pub fn summary(&self) -> MeshSummary {
        self.summary
    }

    /// Returns the number of vertices that are held in memory.
    pub fn held(&self) -> usize {
        self.open.len()
    }

    /// Returns the number of edges that have a triangle on one side only.
    pub fn border_edges(&self) -> usize {
        self.rim.len()
    }
}

fn area_of(tile: &TileSurface) -> u128 {
    let area = |triangle: &[u32; 3]| twice_area(triangle.map(|corner| tile.vertices[corner as usize]));
    tile.triangles.iter().map(|triangle| u128::from(area(triangle).unsigned_abs())).sum()
}
