//! Matches the borders of all meshes with one another.

use std::path::Path;

use rayon::slice::ParallelSliceMut;

use crate::border::{BorderEdge, BorderSite, MeshBorder};
use crate::exact::{EdgeState, edge_state};
use crate::failures::{Failure, Failures};
use crate::keyed_records::KeyedRecords;
use crate::tile_files::TileFiles;
use delaunay::geometry::Site;
use lattice::VertexDigest;
use sys::Result;
use terrain::SourceGrid;

/// The borders of all meshes that have been checked so far.
pub(super) struct Borders {
    edges: KeyedRecords<BorderEdge>,
    sites: KeyedRecords<BorderSite>,
}

impl Borders {
    /// Returns an empty collection that takes up to `memory` bytes and then writes to temporary files in `directory`.
    pub(super) fn new(directory: &Path, memory: u64) -> Borders {
        Borders {
            edges: KeyedRecords::new(directory.to_path_buf(), memory / 2),
            sites: KeyedRecords::new(directory.to_path_buf(), memory / 2),
        }
    }

    pub(super) fn add(&mut self, border: &MeshBorder) -> Result<()> {
        self.edges.extend(&border.edges)?;
        self.sites.extend(&border.sites)
    }

    /// Matches all borders of the meshes in `files`.
    pub(super) fn match_all(self, grid: &SourceGrid, files: &TileFiles) -> Result<BorderMatches> {
        let mut matches = BorderMatches::default();
        self.edges.for_each_bucket(|edges| {
            edges.par_sort_unstable();
            edges.chunk_by(|a, b| a.ends == b.ends).for_each(|group| matches.add_edge(group, grid, files));
        })?;
        self.sites.for_each_bucket(|sites| {
            sites.par_sort_unstable();
            sites.chunk_by(|a, b| a.site == b.site).for_each(|group| matches.add_site(group, grid, files));
        })?;
        Ok(matches)
    }
}

/// What was found between meshes.
#[derive(Default)]
pub(super) struct BorderMatches {
    pub(super) failures: Failures,
    /// The edges with a triangle on one side only, which is on their left.
    pub(super) hull: Vec<[Site; 2]>,
    /// Edges whose two triangles are in different tiles.
    pub(super) edges_across_tiles: u64,
    /// Edges whose four corners lie on one circle.
    pub(super) ties: u64,
    /// Distinct sites on borders.
    pub(super) sites: u64,
    /// The digest of these sites with their heights.
    pub(super) vertices: VertexDigest,
}

impl BorderMatches {
    /// Adds an edge; `group` holds every use of it on a border.
    fn add_edge(&mut self, group: &[BorderEdge], grid: &SourceGrid, files: &TileFiles) {
        match group {
            [edge] => self.hull.push(edge.directed()),
            [left, right] if left.reversed != right.reversed => self.add_pair(left, right, grid, files),
            [first, ..] => {
                let [a, b] = first.ends;
                let tiles: Vec<String> = group.iter().map(|edge| files.name(edge.tile)).collect();
                self.failures.note(Failure::Overused, first.tile, || {
                    format!("{} {} times, in {}", grid.edge_text(a, b), group.len(), tiles.join(", "))
                });
            }
            [] => {}
        }
    }

    fn add_pair(&mut self, left: &BorderEdge, right: &BorderEdge, grid: &SourceGrid, files: &TileFiles) {
        self.edges_across_tiles += (left.tile != right.tile) as u64;
        let [a, c] = right.directed();
        // The triangles (c, a, left's apex) and (a, c, right's apex).
        match edge_state(a, left.apex, c, right.apex) {
            EdgeState::Delaunay => {}
            EdgeState::Tie => self.ties += 1,
            EdgeState::NotDelaunay => self.failures.note(Failure::NotDelaunay, left.tile, || {
                let [left, right] = [left, right].map(|edge| files.name(edge.tile));
                format!("{} between {left} and {right}", grid.edge_text(a, c))
            }),
        }
    }

    /// Adds a site; `group` holds what each mesh says of it.
    fn add_site(&mut self, group: &[BorderSite], grid: &SourceGrid, files: &TileFiles) {
        self.sites += 1;
        let first = group[0];
        self.vertices.add([first.site[0], first.site[1], first.height]);
        let both = |other: &BorderSite| {
            format!("{} in {} and {}", grid.site_text(first.site), files.name(first.tile), files.name(other.tile))
        };
        if let Some(other) = group.iter().find(|site| site.position != first.position) {
            self.failures.note(Failure::PlaceDiffers, first.tile, || both(other));
        }
        let mut shaded = group.iter().filter(|site| site.unshaded == 0);
        let shading = shaded.next().map_or(first.shading, |site| site.shading);
        if let Some(other) = shaded.find(|site| site.shading != shading) {
            self.failures.note(Failure::ShadingDiffers, first.tile, || both(other));
        }
    }
}
