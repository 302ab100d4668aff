//! What parts share: edges used on one side in a part, and the vertices at their ends.

use std::path::Path;

use bytemuck::{Pod, Zeroable, bytes_of};
use rayon::slice::ParallelSliceMut;
use xxhash_rust::xxh3::xxh3_64;

use crate::Result;
use crate::geometry::Site;
use crate::verify::exact::{EdgeState, edge_state};
use crate::verify::part::{Records, edge_text};
use crate::verify::source::Source;
use crate::verify::spill::{Record, Spill};
use crate::verify::verdict::{Fault, Faults};

/// An edge with its triangle on one side.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct RimEdge {
    /// The lesser end, then the greater.
    ends: [Site; 2],
    /// 1 if the triangle has the edge from the greater end to the lesser.
    reversed: u32,
    tile: u32,
    apex: Site,
}

impl RimEdge {
    pub(super) fn new(from: Site, to: Site, apex: Site, tile: u32) -> RimEdge {
        RimEdge { ends: [from.min(to), from.max(to)], reversed: (from > to) as u32, tile, apex }
    }

    fn directed(&self) -> [Site; 2] {
        let [a, b] = self.ends;
        if self.reversed == 0 { [a, b] } else { [b, a] }
    }
}

impl Record for RimEdge {
    fn hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.ends))
    }
}

/// A vertex on the rim of a part.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct RimVertex {
    pub(super) site: Site,
    pub(super) tile: u32,
    /// 1 where there is neither normal nor colour, nor should there be.
    pub(super) unshaded: u32,
    /// Hash of the place in the scene.
    pub(super) position: u64,
    /// Hash of normal and colour.
    pub(super) shading: u64,
}

impl Record for RimVertex {
    fn hash(&self) -> u64 {
        xxh3_64(bytes_of(&self.site))
    }
}

/// All edges and vertices that parts may share.
pub(super) struct Rim {
    edges: Spill<RimEdge>,
    vertices: Spill<RimVertex>,
}

/// What came of the edges.
#[derive(Default)]
pub(super) struct Matched {
    pub(super) faults: Faults,
    /// Edges with a triangle on one side only, which is on their left.
    pub(super) hull: Vec<[Site; 2]>,
    /// Edges with triangles in two parts.
    pub(super) edges: u64,
    /// Of these the ones between two tiles.
    pub(super) across_tiles: u64,
    pub(super) ties: u64,
}

/// What came of the vertices.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) faults: Faults,
    pub(super) distinct: u64,
}

impl Rim {
    pub(super) fn new(directory: &Path, memory: u64) -> Rim {
        Rim {
            edges: Spill::new(directory.to_path_buf(), memory / 2),
            vertices: Spill::new(directory.to_path_buf(), memory / 2),
        }
    }

    pub(super) fn add(&mut self, records: &Records) -> Result<()> {
        self.edges.extend(&records.edges)?;
        self.vertices.extend(&records.vertices)
    }

    /// Matches everything; `names` are those of the tiles.
    pub(super) fn finish(self, source: &Source, names: &[String]) -> Result<(Matched, Vertices)> {
        let (mut matched, mut vertices) = (Matched::default(), Vertices::default());
        self.edges.for_each_bucket(|edges| {
            edges.par_sort_unstable();
            edges.chunk_by(|a, b| a.ends == b.ends).for_each(|group| matched.take(group, source, names));
        })?;
        self.vertices.for_each_bucket(|bucket| {
            bucket.par_sort_unstable();
            bucket.chunk_by(|a, b| a.site == b.site).for_each(|group| vertices.take(group, source, names));
        })?;
        Ok((matched, vertices))
    }
}

impl Matched {
    /// Takes all uses of one edge.
    fn take(&mut self, group: &[RimEdge], source: &Source, names: &[String]) {
        match group {
            [edge] => self.hull.push(edge.directed()),
            [left, right] if left.reversed != right.reversed => self.pair(left, right, source, names),
            [first, ..] => {
                let [a, b] = first.ends;
                let tiles: Vec<&str> = group.iter().map(|edge| name(names, edge.tile)).collect();
                self.faults.note(Fault::Overused, first.tile, || {
                    format!("{} {} times, in {}", edge_text(source, a, b), group.len(), tiles.join(", "))
                });
            }
            [] => {}
        }
    }

    fn pair(&mut self, left: &RimEdge, right: &RimEdge, source: &Source, names: &[String]) {
        self.edges += 1;
        self.across_tiles += (left.tile != right.tile) as u64;
        let [a, c] = right.directed();
        // The triangles (c, a, left's apex) and (a, c, right's apex).
        match edge_state(a, left.apex, c, right.apex) {
            EdgeState::Delaunay => {}
            EdgeState::Tie => self.ties += 1,
            EdgeState::NotDelaunay => self.faults.note(Fault::NotDelaunay, left.tile, || {
                format!(
                    "{} between {} and {}",
                    edge_text(source, a, c),
                    name(names, left.tile),
                    name(names, right.tile)
                )
            }),
        }
    }
}

impl Vertices {
    /// Takes all that parts say of one site.
    fn take(&mut self, group: &[RimVertex], source: &Source, names: &[String]) {
        self.distinct += 1;
        let first = group[0];
        let both = |other: &RimVertex| {
            format!("{} in {} and {}", source.site_text(first.site), name(names, first.tile), name(names, other.tile))
        };
        if let Some(other) = group.iter().find(|v| v.position != first.position) {
            self.faults.note(Fault::PlaceDiffers, first.tile, || both(other));
        }
        let mut shaded = group.iter().filter(|v| v.unshaded == 0);
        let shading = shaded.next().map_or(first.shading, |v| v.shading);
        if let Some(other) = shaded.find(|v| v.shading != shading) {
            self.faults.note(Fault::ShadingDiffers, first.tile, || both(other));
        }
    }
}

fn name(names: &[String], tile: u32) -> &str {
    names.get(tile as usize).map_or("?", String::as_str)
}
