//! The tile above four.
//!
//! Its vertices are selected from theirs ([`selection`]), those of its sides from those of their sides alone. So a tile needs no neighbour, and meets
//! all of them.

use crate::bound::{FIRST_FLAT_ZOOM, steps};
use crate::mesh::{LAST, Node, OUTSIDE, TileMesh, corner_place, in_order};
use crate::rough::Cells;
use crate::side::selected_along;
use crate::tile::Tile;
use delaunay::geometry::{Bounds, Site};
use delaunay::mesh::half_edge::HalfEdgeMesh;
use delaunay::triangulation::canonical;
use selection::{BlockPoints, ErrorBound, PointSource, select_down};
use std::collections::BTreeMap;

/// A tile of the next finer zoom.
#[derive(Clone, Debug, Default)]
pub struct Child {
    /// 1 in the east, 0 in the west; 1 in the north, 0 in the south.
    pub quadrant: [u8; 2],
    /// Its vertices.
    pub nodes: Vec<Node>,
}

/// The most vertices of a coarser tile, besides those along its sides. Where the bound of its zoom would select more, as in woods, a greater one holds.
const MOST_VERTICES: u64 = 16_384;

/// The steps of the sides of a square that stand for one metre, or for as much in the other direction.
const SCALE: i32 = 1024;

/// Returns the mesh of a tile from the tiles of the next finer zoom in it, and the bound by which its vertices were selected. `outside` is the height of
/// the surroundings at its zoom.
///
/// # Errors
/// [`delaunay::Error::Stopped`].
pub fn coarser(tile: Tile, children: &[Child], outside: i32) -> Result<(TileMesh, u64), delaunay::Error> {
    let candidates = candidates(children);
    let (on_border, inside): (Vec<Node>, Vec<Node>) = candidates.into_iter().partition(|node| node.is_on_border());
    let mut fixed = border(&on_border, tile.zoom, outside);
    fixed.extend(grid(&inside, &fixed, tile.zoom));
    fixed.sort_unstable_by_key(|node| node.order());
    fixed.dedup_by_key(|node| node.order());
    let source = TileSource { tile, fixed: &fixed, inside: &inside, outside };
    let (vertices, bound) = source.vertices()?;
    Ok((source.mesh_of(vertices)?, bound))
}

/// Returns a tile that the terrain does not reach.
pub fn flat(tile: Tile) -> Result<TileMesh, delaunay::Error> {
    coarser(tile, &[], 0).map(|(mesh, _)| mesh)
}

/// Returns the vertices of all children as a tile of the zoom before has them, in order. Of those that come together the highest of the terrain stays.
fn candidates(children: &[Child]) -> Vec<Node> {
    let mut all = Vec::new();
    for child in children {
        let along = |steps: u16, half: u8| {
            let doubled = u32::from(steps) + u32::from(half) * u32::from(LAST);
            let halved = (doubled / 2) as u16;
            // Only what lies on the border comes to lie on it.
            if doubled == 0 || doubled == 2 * u32::from(LAST) { halved } else { halved.clamp(1, LAST - 1) }
        };
        all.extend(child.nodes.iter().map(|node| Node {
            u: along(node.u, child.quadrant[0]),
            v: along(node.v, child.quadrant[1]),
            h: node.h,
        }));
    }
    all.sort_unstable_by_key(|node| (node.order(), std::cmp::Reverse(node.h)));
    all.dedup_by_key(|node| node.order());
    all
}

/// Returns the vertices along the sides: selected ones of `on_border`, and the corners.
fn border(on_border: &[Node], zoom: u8, outside: i32) -> Vec<Node> {
    let mut border: Vec<Node> = Vec::new();
    for corner in 0..4 {
        let [u, v] = corner_place(corner);
        let known = on_border.iter().find(|node| node.corner() == Some(corner));
        border.push(Node { u, v, h: known.map_or(OUTSIDE, |node| node.h) });
    }
    for side in 0..4 {
        let end = if side % 2 == 0 { 0 } else { LAST };
        let along = |node: &Node| {
            let (across, along) = if side < 2 { (node.u, node.v) } else { (node.v, node.u) };
            (across == end).then_some((along, *node))
        };
        // Its corners are in it whether they are known or not, so that it is the same line in both tiles.
        let ends = border[..4].iter().filter_map(along).collect::<Vec<_>>();
        let mut of_side: Vec<(u16, Node)> =
            on_border.iter().filter(|node| node.corner().is_none()).filter_map(along).collect();
        of_side.extend(ends);
        of_side.sort_unstable_by_key(|(along, _)| *along);
        let selected = selected_along(&of_side, zoom, outside);
        border.extend(on_grid(&selected, zoom, outside).into_iter().map(|(along, h)| {
            let [u, v] = if side < 2 { [end, along] } else { [along, end] };
            Node { u, v, h }
        }));
        border.extend(selected.into_iter().map(|(_, node)| node));
    }
    border
}

/// Returns vertices where the lines of the grid of a zoom meet a side, on the straight lines between selected ones: steps along the side, and
/// heights.
fn on_grid(selected: &[(u16, Node)], zoom: u8, outside: i32) -> Vec<(u16, i32)> {
    let lines = grid_lines(zoom);
    let inner = lines.get(1..lines.len() - 1).unwrap_or_default();
    let height = |&line: &u16| {
        let after = selected.partition_point(|(along, _)| *along < line);
        let ((to, last), (from, first)) = (selected.get(after)?, selected.get(after.checked_sub(1)?)?);
        if *to == line {
            return None;
        }
        if [first.h, last.h] == [OUTSIDE; 2] {
            return Some((line, OUTSIDE));
        }
        let [first, last] = [first, last].map(|node| i64::from(node.height(outside)));
        let (part, whole) = (i64::from(line - from), i64::from(to - from));
        Some((line, (first + (2 * (last - first) * part + whole).div_euclid(2 * whole)) as i32))
    };
    inner.iter().filter_map(height).collect()
}

/// Returns where the lines of the grid of a zoom are, with both ends.
fn grid_lines(zoom: u8) -> Vec<u16> {
    let count = if zoom < FIRST_FLAT_ZOOM { (32u32 >> (zoom / 2)).max(1) } else { 1 };
    (0..=count).map(|line| (line * u32::from(LAST) / count) as u16).collect()
}

/// Returns vertices for the curve of the earth: of each cell of the grid one of those that may be selected, or where four cells without any meet,
/// one beside the terrain.
fn grid(inside: &[Node], border: &[Node], zoom: u8) -> Vec<Node> {
    let lines = grid_lines(zoom);
    if lines.len() < 3 {
        return Vec::new();
    }
    let cell = |along: u16| lines.partition_point(|&line| line <= along).clamp(1, lines.len() - 1) - 1;
    let mut first: BTreeMap<[usize; 2], Node> = BTreeMap::new();
    for node in inside.iter().chain(border.iter().filter(|node| node.h != OUTSIDE)) {
        first.entry([cell(node.u), cell(node.v)]).or_insert(*node);
    }
    let mut vertices: Vec<Node> = first.values().copied().collect();
    for i in 1..lines.len() - 1 {
        for j in 1..lines.len() - 1 {
            let around = [[i - 1, j - 1], [i, j - 1], [i - 1, j], [i, j]];
            let is_empty = around.iter().all(|cell| !first.contains_key(cell));
            vertices.extend(is_empty.then_some(Node { u: lines[i], v: lines[j], h: OUTSIDE }));
        }
    }
    vertices
}

/// The vertices that a tile may have, as points to select from. Their x is stretched so that both axes have about the same scale on the ground.
struct TileSource<'a> {
    tile: Tile,
    /// Those that it has in any case.
    fixed: &'a [Node],
    inside: &'a [Node],
    outside: i32,
}

impl TileSource<'_> {
    /// Returns the places in a step along both axes.
    fn scale(&self) -> [i32; 2] {
        let cosine = libm::cos(self.tile.middle_latitude());
        [((f64::from(SCALE) * cosine + 0.5) as i32).clamp(1, SCALE), SCALE]
    }

    fn point(&self, node: &Node) -> [i32; 3] {
        let [x, y] = self.scale();
        [i32::from(node.u) * x, i32::from(node.v) * y, node.height(self.outside)]
    }

    /// Returns the vertices of the tile, and their bound.
    fn vertices(&self) -> Result<(Vec<Node>, u64), delaunay::Error> {
        match self.medians() {
            Some(medians) => Ok((medians, self.range())),
            None => self.selected(),
        }
    }

    /// Returns a vertex for each cell of the tile, and the fixed ones, where the surface is so rough that the bound would select far more vertices than a
    /// tile may have.
    fn medians(&self) -> Option<Vec<Node>> {
        if self.inside.len() as u64 <= MOST_VERTICES {
            return None;
        }
        let (beside, ground): (Vec<Node>, Vec<Node>) = self.inside.iter().partition(|node| node.h == OUTSIDE);
        let cells = Cells::new(&ground);
        let is_rough = cells.off_plane(2 * steps(self.tile.zoom)) as u64 > MOST_VERTICES / 2;
        is_rough.then(|| {
            let mut medians = cells.medians();
            medians.extend(beside);
            medians.retain(|node| !self.is_fixed(node));
            medians.extend(self.fixed);
            medians
        })
    }

    /// Returns the vertices that the bound of the zoom selects, or a greater one if these would be too many.
    fn selected(&self) -> Result<(Vec<Node>, u64), delaunay::Error> {
        let ladder = self.ladder();
        let bounds: Vec<ErrorBound> = ladder.iter().map(|&steps| ErrorBound::new(steps, 1)).collect();
        let (selected, kept) = select_down(self, &bounds, MOST_VERTICES)?;
        let kept = ladder.iter().zip(&bounds).find(|(_, bound)| Some(**bound) == kept).map(|(steps, _)| *steps);
        let [x, y] = self.scale();
        let all = Bounds { min: [0, 0], max: [i32::from(LAST) * x, i32::from(LAST) * y] };
        let nodes =
            selected.within(all).map(|[px, py, h]| Node { u: (px / x) as u16, v: (py / y) as u16, h }).collect();
        Ok((nodes, kept.unwrap_or_else(|| self.range())))
    }

    fn is_fixed(&self, node: &Node) -> bool {
        // Without a grid all fixed vertices lie on the border.
        self.tile.zoom < FIRST_FLAT_ZOOM
            && self.fixed.binary_search_by_key(&node.order(), |fixed| fixed.order()).is_ok()
    }

    /// Returns the mesh of vertices.
    fn mesh_of(&self, mut nodes: Vec<Node>) -> Result<TileMesh, delaunay::Error> {
        nodes.sort_unstable_by_key(|node| node.order());
        let [x, y] = self.scale();
        let sites: Vec<Site> = nodes.iter().map(|node| [i32::from(node.u) * x, i32::from(node.v) * y]).collect();
        let mesh = canonical(&sites)?;
        let triangles = in_order(nodes.len(), mesh.corners());
        // Heights beside the terrain are again those of the surroundings, whatever these are at the next zoom.
        let all = self.fixed.iter().chain(self.inside);
        let mut outside: Vec<u32> = all.filter(|node| node.h == OUTSIDE).map(|node| node.order()).collect();
        outside.sort_unstable();
        nodes.iter_mut().filter(|node| outside.binary_search(&node.order()).is_ok()).for_each(|node| node.h = OUTSIDE);
        Ok(TileMesh { nodes, triangles })
    }

    /// Returns the lowest and the highest height apart.
    fn range(&self) -> u64 {
        let heights = self.fixed.iter().chain(self.inside).map(|node| node.height(self.outside));
        let [low, high] = heights.fold([i32::MAX, i32::MIN], |[low, high], h| [low.min(h), high.max(h)]);
        if low > high { 0 } else { high.abs_diff(low).into() }
    }

    /// Returns bounds from one that few vertices exceed down to that of the zoom, in steps.
    fn ladder(&self) -> Vec<u64> {
        const FACTOR: u64 = 4;
        let (last, range) = (steps(self.tile.zoom).max(1), self.range());
        let mut ladder: Vec<u64> = std::iter::successors(Some(last), |bound| Some(bound * FACTOR))
            .take_while(|bound| *bound < range / FACTOR)
            .collect();
        if ladder.is_empty() {
            ladder.push(last);
        }
        ladder.reverse();
        ladder
    }
}

impl PointSource for TileSource<'_> {
    type Error = delaunay::Error;

    fn blocks(&self) -> usize {
        1
    }

    fn load(&self, _: usize) -> Result<BlockPoints, delaunay::Error> {
        let fixed: Vec<[i32; 3]> = self.fixed.iter().map(|node| self.point(node)).collect();
        let inside = self.inside.iter().filter(|node| !self.is_fixed(node)).map(|node| self.point(node));
        Ok(BlockPoints { points: inside.chain(fixed.iter().copied()).collect(), fixed })
    }

    fn triangulate(&self, sites: &[Site]) -> Result<HalfEdgeMesh, delaunay::Error> {
        canonical(sites)
    }

    fn keeps_blocks(&self, _: u64, _: u64) -> bool {
        true
    }

    fn asks_about(&self, _: [Site; 3]) -> bool {
        false
    }

    fn after_round(&self, _: u32, _: u64) -> Result<(), delaunay::Error> {
        Ok(())
    }
}
