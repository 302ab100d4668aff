//! Putting a tile together: the triangles of its leaf, then those of the seam that it owns, with finished normals and colours.

use crate::index::TileIndex;
use crate::records::{BorderVertex, FinishedBorder, Leaf, SeamTriangle};
use crate::tiles::hull_slivers::HullSlivers;
use crate::tiles::style::TileStyle;
use crate::tiles::vertex_colors::{FoundColors, VertexColors};
use delaunay::mesh::index::SiteIndex;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::Range;
use sys::{Error, Result};
use tiles::Tile;
use tiles::attributes::PointAttributes;
use tiles::normals::NormalSums;

/// The vertices and triangles of a tile. Its own sites come first, then those of its neighbours.
pub(crate) struct TileContent {
    positions: Vec<[i32; 3]>,
    normals: Vec<[f32; 3]>,
    colors: Vec<[u16; 3]>,
    attributes: PointAttributes,
    triangles: Vec<[u32; 3]>,
    /// Whether a triangle that stays has this corner.
    is_used: Vec<bool>,
    /// Triangles that are left out.
    cut: Vec<[u32; 3]>,
    /// How many of them are slivers along the hull.
    pub(crate) slivers: u64,
    /// How many sites of the leaf have no pixel in the orthophoto.
    pub(crate) without_pixel: u64,
}

impl TileContent {
    /// Returns the content that the tile's leaf contributes.
    ///
    /// # Errors
    /// Those of an orthophoto.
    pub(crate) fn of_leaf(
        mut leaf: Leaf,
        border: &FinishedBorder,
        slivers: &HullSlivers,
        style: &TileStyle,
    ) -> Result<TileContent> {
        let mut cut = slivers.take(&leaf.positions, &mut leaf.triangles);
        let slivers = cut.len() as u64;
        cut.extend(style.take_long(&leaf.positions, &mut leaf.triangles));
        let sums = NormalSums::new(&leaf.positions, &leaf.triangles);
        let (is_used, mut normals) = (sums.are_corners(), sums.unit_normals(&style.frame));
        for vertex in &border.vertices {
            normals[vertex.site.get()] = vertex.normal;
        }
        let FoundColors { colors, without_pixel } = style.colors.of_leaf(&leaf)?;
        let Leaf { positions, class, mut intensity, triangles, .. } = leaf;
        let attributes = PointAttributes {
            classification: style.attributes.classification.then_some(class),
            intensity: style.attributes.intensity.then(|| {
                // A record has none if all are 0.
                intensity.resize(positions.len(), 0);
                intensity
            }),
        };
        // As much room for the seam as the columns of the leaf have: growing would double them.
        normals.reserve_exact(positions.capacity() - positions.len());
        Ok(TileContent { positions, normals, colors, attributes, triangles, is_used, cut, slivers, without_pixel })
    }

    /// Adds the triangles of the seam that `tile` owns, with the vertices that belong to neighbours. Returns the number of triangles
    /// that are not left out.
    pub(crate) fn add_seam(
        &mut self,
        border_of: BorderOf,
        tile: TileIndex,
        seam: impl Iterator<Item = SeamTriangle>,
        slivers: &HullSlivers,
        style: &TileStyle,
    ) -> Result<u64> {
        let mut neighbours = NeighbourBorders { border_of, borders: HashMap::new() };
        let mut vertex_of: HashMap<(TileIndex, SiteIndex), u32> = HashMap::new();
        let before = self.triangles.len();
        for triangle in seam {
            let mut corners = [0; 3];
            for (corner, border) in corners.iter_mut().zip(&triangle) {
                *corner = match vertex_of.get(&(border.tile, border.site)) {
                    _ if border.tile == tile => border.site.0,
                    Some(&vertex) => vertex,
                    None => {
                        let vertex = self.add_vertex(border, &mut neighbours, style)?;
                        vertex_of.insert((border.tile, border.site), vertex);
                        vertex
                    }
                };
            }
            let is_sliver = slivers.has(&triangle);
            let is_cut = is_sliver || style.leaves_out(triangle.map(|corner| corner.position));
            self.slivers += u64::from(is_sliver);
            if is_cut {
                self.cut.push(corners);
            } else {
                self.triangles.push(corners);
                corners.iter().for_each(|&v| self.is_used[v as usize] = true);
            }
        }
        if let VertexColors::OfPhoto(photo) = &style.colors {
            self.colors.extend(photo.at(&self.positions[self.colors.len()..])?.colors);
        }
        Ok((self.triangles.len() - before) as u64)
    }

    fn add_vertex(
        &mut self,
        border: &BorderVertex,
        neighbours: &mut NeighbourBorders,
        style: &TileStyle,
    ) -> Result<u32> {
        let (vertex, intensity) = neighbours.of(border.tile)?.find(border.site).ok_or_else(|| {
            Error::Broken(format!(
                "a seam uses site {} of tile {}, whose border does not have it",
                border.site.0, border.tile
            ))
        })?;
        self.positions.push(border.position);
        self.is_used.push(false);
        self.normals.push(vertex.normal);
        if let VertexColors::OfPoints(coloring) = &style.colors {
            self.colors.push(coloring.color(border.position[2], vertex.rgb, vertex.class as u8));
        }
        self.attributes.push(vertex.class as u8, intensity);
        Ok(self.positions.len() as u32 - 1)
    }

    /// Returns the triangles that are left out, without normals and colours.
    pub(crate) fn left_out(&self) -> Tile {
        Tile::of(&self.positions, self.cut.clone())
    }

    /// Returns the finished tile. It lacks the sites whose triangles all belong to other tiles or are left out.
    pub(crate) fn into_tile(mut self, style: &TileStyle) -> Tile {
        let is_used = std::mem::take(&mut self.is_used);
        debug_assert!(self.triangles.as_flattened().iter().all(|&v| is_used[v as usize]), "corners are used");
        if is_used.contains(&false) {
            self.drop_unused(&is_used);
        }
        Tile {
            positions: self.positions,
            normals: style.normals.then_some(self.normals),
            colors: style.colors.are_wanted().then_some(self.colors),
            attributes: self.attributes,
            triangles: self.triangles,
        }
    }

    fn drop_unused(&mut self, used: &[bool]) {
        let runs = runs_of(used);
        let mut numbers = vec![0; used.len()];
        let mut next = 0..;
        for run in &runs {
            numbers[run.clone()].iter_mut().zip(&mut next).for_each(|(number, new)| *number = new);
        }
        self.triangles.as_flattened_mut().iter_mut().for_each(|v| *v = numbers[*v as usize]);
        keep(&mut self.positions, &runs);
        keep(&mut self.normals, &runs);
        keep(&mut self.colors, &runs);
        self.attributes.classification.iter_mut().for_each(|classes| keep(classes, &runs));
        self.attributes.intensity.iter_mut().for_each(|intensities| keep(intensities, &runs));
    }
}

/// Returns the ranges in which `wanted` is true. Most of them go from one border of the tile to the other.
fn runs_of(wanted: &[bool]) -> Vec<Range<usize>> {
    let mut end = 0;
    let runs = wanted.chunk_by(|a, b| a == b).map(|run| {
        end += run.len();
        (run[0], end - run.len()..end)
    });
    runs.filter(|(wanted, _)| *wanted).map(|(_, run)| run).collect()
}

/// Keeps the values in `runs`, which ascend. An empty column stays empty.
fn keep<T: Copy>(values: &mut Vec<T>, runs: &[Range<usize>]) {
    if values.is_empty() {
        return;
    }
    let mut kept = 0;
    for run in runs {
        values.copy_within(run.clone(), kept);
        kept += run.len();
    }
    values.truncate(kept);
}

/// Returns the finished frontier of a tile.
pub(crate) type BorderOf<'a> = &'a dyn Fn(TileIndex) -> Result<FinishedBorder>;

/// The finished borders of other tiles, each read when it is first needed.
struct NeighbourBorders<'a> {
    border_of: BorderOf<'a>,
    borders: HashMap<TileIndex, FinishedBorder>,
}

impl NeighbourBorders<'_> {
    fn of(&mut self, tile: TileIndex) -> Result<&FinishedBorder> {
        Ok(match self.borders.entry(tile) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert((self.border_of)(tile)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wanted_values_stay_in_order(wanted in prop::collection::vec(any::<bool>(), 0..40)) {
            let mut values: Vec<usize> = (0..wanted.len()).collect();
            let expected: Vec<usize> = values.iter().copied().filter(|&at| wanted[at]).collect();
            let (runs, mut none) = (runs_of(&wanted), Vec::<u8>::new());
            keep(&mut values, &runs);
            keep(&mut none, &runs);
            prop_assert_eq!((values, none), (expected, vec![]));
            prop_assert!(runs.windows(2).all(|two| two[0].end < two[1].start), "{:?}", runs);
        }
    }
}
